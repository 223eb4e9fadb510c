"""The cube and the table of structure: every number at its place, and on the oscillator against its closed form."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.stats import linregress
from scipy.stats import t as student

import nearharmonic as nh
from nearharmonic.integrators import integrators
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.stability.reductions import structure_cube, structure_table
from support.oracles.structures import runs_of, structure

NYSTROM = next(tableau.name for tableau in integrators.values() if tableau.requires)
METHODS = ["ruth", NYSTROM, "leapfrog"]
T_END = {"sho": "20", "relativistic_oscillator": "50"}
#: Variables of the cube, and columns of the table, in their order.
KEYS = [
    "tau_per_stage", "steps", "growth", "return_error", "return_walk", "return_bound", "plain_return_error",
    "plain_return_walk", "plain_return_bound", "symplectic_defect", "symplectic_walk", "energy_drift",
    "energy_drift_interval", "energy_walk",
]  # fmt: skip
#: Every pair of system and method that fit each other.
FITTING = [("sho", name) for name in METHODS] + [("relativistic_oscillator", name) for name in ("ruth", "leapfrog")]


@pytest.mark.slow
def test_a_number_stands_at_its_system_and_method():
    tableaus = [integrators[name] for name in METHODS]
    cube = structure_cube(tableaus, {name: runs_of(systems[name], tableaus, t_end) for name, t_end in T_END.items()})
    assert [*cube] == KEYS
    for system, name in FITTING:
        alone = vars(structure(systems[system], integrators[name], t_end=T_END[system]))
        assert {key: cube[key].sel(system=system, integrator=name).item() for key in cube} == alone
    assert np.isnan(cube.sel(system="relativistic_oscillator", integrator=NYSTROM).to_dataarray()).all()
    assert cube.label.sel(integrator="leapfrog") == "Leapfrog"


def test_row_has_all_numbers_and_unfit_methods_have_none():
    steps = np.arange(320.0, 326).reshape(2, 3)
    steps[1, 1] = np.nan
    dims = ("system", "integrator")
    cube = xr.Dataset(
        {"return_error": (dims, steps / 7), "steps": (dims, steps)}, {"system": [*T_END], "integrator": METHODS}
    )
    table = structure_table(cube)
    assert table.header == ("system", "integrator", "return error", "steps")
    assert [row[:2] for row in table.rows] == FITTING
    assert [row[2:] for row in table.rows] == [(n / 7, n) for n in (320, 321, 322, 323, 325)]
    assert type(table.rows[0][3]) is int


@pytest.fixture(scope="module")
def oscillator():
    return structure(systems["sho"], integrators["ruth"], t_end="500")


#: 10^4/25 evaluations in steps of three, over a 25th of [0, 500]; u = 2^-53.
STEPS, END, U = 133, 20.0, 2.0**-53


def test_steps_cover_25th_of_interval_at_ten_thousand_evaluations(oscillator):
    assert oscillator.steps == STEPS
    assert oscillator.tau_per_stage == pytest.approx(END / STEPS / 3, rel=1e-15)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def near(value, rel):
    """Without pytest's absolute tolerance of 1e-12, which hides all of these numbers."""
    return pytest.approx(value, rel=rel, abs=0)


def test_rounding_is_the_sum_of_all_updates_of_the_circle(oscillator):
    """q = cos t, p = -sin t at 65 states; a rotation carries errors on as they are. Ruth errs by 1e-5 at this step."""
    t = np.arange(65) * STEPS // 64 * END / STEPS
    q, p = rms(np.cos(t)), rms(np.sin(t))
    assert oscillator.growth == near(1, rel=1e-4)
    # Plain: four drifts round q, three kicks p; forwards and back.
    squares, total = STEPS * (4 * q**2 + 3 * p**2), STEPS * (4 * q + 3 * p)
    assert oscillator.plain_return_walk == near(U * np.sqrt(2 * squares), rel=1e-3)
    assert oscillator.plain_return_bound == near(U * 2 * total, rel=1e-3)
    # Symplectic: double-double rounds by 2^-104, divided by a spacing of 2^-24; J enters twice.
    assert oscillator.symplectic_walk == near(2 * 2.0**-104 * 2.0**24 * np.sqrt(squares), rel=1e-3)
    # Compensated: an update c tau is rounded of the increment, c tau p for q and c tau q for p.
    w, tau = 1 / (2 - 2 ** (1 / 3)), END / STEPS
    drifts, kicks = np.array([w / 2, (w - 1) / 2] * 2) * tau * p, np.array([w, 2 * w - 1, w]) * tau * q
    squares, total = STEPS * (sum(drifts**2) + sum(kicks**2)), STEPS * (sum(drifts) + sum(kicks))
    assert oscillator.return_walk == near(U * np.sqrt(2 * squares), rel=1e-3)
    assert oscillator.return_bound == near(U * 2 * total, rel=1e-3)
    # Energy: each update is rounded by u c tau |q p| of H0 = 1/2.
    coefficients = sum(c**2 for c in (w / 2, (w - 1) / 2) * 2) + sum(c**2 for c in (w, 2 * w - 1, w))
    steps = STEPS * 250
    power = np.sqrt(1 / 8) / 0.5  # of cos t sin t, over hundreds of periods
    assert oscillator.energy_walk == near(U * tau * power * np.sqrt(coefficients * steps), rel=1e-2)


def test_drift_of_energy_is_regression_through_means_of_fifty_blocks(oscillator):
    steps = STEPS * 250
    run = nh.integrate("sho", "ruth", 5000 / steps, t_end=5000, samples=steps + 1)
    assert run.steps == steps
    means = [block.mean() for block in np.array_split(run.energy_error.values[1:], 50)]
    fit = linregress(np.linspace(0.01, 0.99, 50), means)
    assert oscillator.energy_drift == near(fit.slope, rel=1e-6)
    assert oscillator.energy_drift_interval == near(fit.stderr * student.ppf(0.975, 48), rel=1e-6)
