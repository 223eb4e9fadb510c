"""Recommendations and curves of methods with kicks of a modified potential, and of processed ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.reference import reference
from nearharmonic.recommendation.measure import Interval, measure
from nearharmonic.systems import systems

pytestmark = pytest.mark.slow

NAMES = ("ruth", "rowlands", "chin_4a", "trained_modified")


@pytest.mark.parametrize("measure", ["max", "mean"])
def test_a_recommended_run_is_that_of_integrate(measure):
    found = nh.recommend("henon_heiles", 1e-5, measure=measure, methods=NAMES, t_end=50, budget=20000)
    assert set(found.integrator.values) == set(NAMES)
    for one in (found.isel(rank=i) for i in range(found.sizes["rank"])):
        run = nh.integrate("henon_heiles", str(one.integrator.values), float(one.tau), t_end=50,
                           summation=str(one.summation.values))  # fmt: skip
        assert run[f"{measure}_energy_error"] <= 1e-5
        assert (one.max_energy_error, one.evaluations) == (run.max_energy_error, run.evaluations)


def test_processed_method_is_measured_along_its_runs_not_at_ends():
    """The energy error at the end of the interval alone is a tenth of the largest one, and would take longer steps."""
    found = nh.recommend("henon_heiles", 1e-5, methods=["rowlands"], t_end=50, budget=20000).isel(rank=0)
    ends = nh.integrate("henon_heiles", "rowlands", float(found.tau), t_end=50, samples=1)
    assert ends.max_energy_error < found.max_energy_error / 2
    assert 1e-6 < found.max_energy_error <= 1e-5


def test_final_position_is_found_after_fewer_samples_than_others():
    system, tableau = systems["henon_heiles"], nh.integrators["rowlands"]
    exact = reference(system, "20")
    found = measure(Interval(system, "20", exact), [tableau], np.geomspace(0.005, 0.5, 5), modes=()).isel(solver=0)
    assert found.sizes["point"] == 5
    for i in range(5):
        point = found.isel(point=i)
        way = "compensated" if point.compensated else "plain"
        run = nh.integrate("henon_heiles", tableau, point.tau.item(), t_end=20, summation=way)
        low = run.q_low.values[-1] if way == "compensated" else np.zeros(2)
        assert point.position_error == exact.error(run.q.values[-1], low)
        assert point.max_energy_error == run.max_energy_error


def test_methods_that_do_not_fit_are_named_with_the_reason():
    loops = replace(systems["relativistic_oscillator"], name="loops")
    with pytest.warns(UserWarning, match="no method has an error of at most 0.01 within 2000 evaluations"):
        found = nh.recommend(loops, 1e-2, methods=["ruth", "chin_4a", "rowlands"], budget=2000)
    assert "chin_4a, rowlands (does not fit: it requires a quadratic kinetic energy)" in found.attrs["not_run"]
    found = nh.recommend("kepler_regularised", 1e-2, methods=["ruth", "rowlands"], budget=2000)
    assert found.attrs["not_run"] == "rowlands (does not fit: its kicks are of a modified potential)"
