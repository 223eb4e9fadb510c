"""Ratios of the table of kinetic energies, from a cube made by hand."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic_paper.experiments.stability.reductions import OF_KINETIC_ENERGY as reduction
from nearharmonic_paper.experiments.stability.reductions import kinetic_energy_table
from nearharmonic_paper.experiments.stability.run import exchanged

AMPLITUDES, GRID = [0.01, 0.3, 1.0], [0.01, 0.049, 0.06, 1.0]


@pytest.fixture
def cube():
    """At 0.049, the step size nearest to 0.05: Ruth errs by 8, 16, 32 in its own roles, twice that exchanged; the other
    by 2, 16, 128 and 4, 64, 8; elsewhere all err by 7."""
    errors = np.full((2, 3, 2, 4), 7.0)
    errors[0, :, 0, 1], errors[1, :, 0, 1] = [8, 16, 32], [16, 32, 64]
    errors[0, :, 1, 1], errors[1, :, 1, 1] = [2, 16, 128], [4, 64, 8]
    dims = ("roles", "amplitude", "integrator", "tau_per_stage")
    data = xr.Dataset(
        {"max_energy_error": (dims, errors)},
        coords={
            "roles": ["own", "exchanged"], "amplitude": AMPLITUDES, "integrator": ["ruth", "babs7o7h"],
            "tau_per_stage": GRID,
        },
    )  # fmt: skip
    return data.assign(reduction.of(data, over="tau_per_stage"))


def test_errors_are_relative_to_ruth_and_decline_to_least_amplitude(cube):
    table = kinetic_energy_table(cube)
    assert table.header == (
        "integrator", "roles", "error / Ruth's at A = 0.01", "error / Ruth's at A = 0.3", "error / Ruth's at A = 1",
        "decline to A = 1",
    )  # fmt: skip
    assert table.rows == [
        ("ruth", "own", 1.0, 1.0, 1.0, 1.0),
        ("ruth", "exchanged", 2.0, 2.0, 2.0, 1.0),
        ("babs7o7h", "own", 0.25, 1.0, 4.0, 16.0),
        ("babs7o7h", "exchanged", 0.5, 4.0, 0.25, 0.5),
    ]


def test_without_the_yardstick_there_are_no_ratios(cube):
    alone = cube.isel(integrator=[1])
    assert np.isnan(reduction.of(alone, over="tau_per_stage").relative_error).all()


@pytest.mark.parametrize(("name", "first"), [("ruth", "kick"), ("babs7o7h", "drift")])
def test_exchanged_roles_give_the_rows_to_the_other_operator(name, first):
    own, other = integrators[name], exchanged(integrators[name])
    assert (other.first, other.kick, other.drift) == (first, own.drift, own.kick)
