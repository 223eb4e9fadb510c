"""Long runs: artificial trends, backward runs, rounding as a random walk; and gains at equal time."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import xarray as xr

import nearharmonic as nh
from nearharmonic.output.store import assembled
from nearharmonic_paper.tasks import job
from nearharmonic_studies.trained import run as proof
from nearharmonic_studies.trained import times
from nearharmonic_studies.trained.long_runs_reductions import long_table, reduction, trends
from nearharmonic_studies.trained.problems import NAMED, named_ensemble
from nearharmonic_studies.trained.proof_reductions import reduce
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.run import STARTS, long_runs, run
from nearharmonic_studies.trained.run import long_runs_measure as measure

SMALL = ProofSettings(
    systems=4, t_end="10", tau_per_stage=("0.1",), evaluations_per_orbit=(60,), steps=2000
)  # fmt: skip


def henon_heiles_starts():
    (one,) = (one for one in NAMED if one.name == "henon_heiles")
    return named_ensemble(one, STARTS, 3, 100.0)


def reduced(*methods, steps=2000):
    """Reductions of long runs on the Hénon-Heiles system, by method."""
    variables = long_runs({"henon_heiles": henon_heiles_starts()}, [nh.integrators[name] for name in methods], steps)
    return reduction.of(assembled(variables, ("label", "step"), {}), over="problem").isel(system=0)


def test_a_run_is_that_of_integrate(tmp_path):
    start = henon_heiles_starts().start[2].reshape(4, 2)
    alone = nh.integrate("henon_heiles", "babps8o7h", 0.8, t_end=40, q0=start[0], p0=start[2], samples=2)
    paths = run(henon_heiles_starts(), nh.integrators["babps8o7h"], 0.1, 50, samples=2)
    assert paths.max_energy_error[2] == pytest.approx(float(alone.max_energy_error), rel=1e-9)


def test_trend_that_is_put_in_is_found_within_its_interval():
    slope, random = 3e-7, np.random.default_rng(4)
    marks = np.arange(0, 2001, 5)
    own = slope + 1e-8 * random.normal(size=(STARTS, 1))
    errors = own * (marks / 2000) + 1e-7 * np.sin(marks * 0.37)
    found = trends(xr.Dataset({"energy_error": (("problem", "sample"), errors), "step": ("sample", marks)}))
    width = found.trend_half_width.item()
    # Student's t of 15 degrees of freedom is 2.13; the spread of 16 numbers is known to a fifth or so.
    assert width == pytest.approx(2.13 * 1e-8 / 4, rel=0.5)
    assert abs(found.trend.item() - slope) < 2 * width + 1e-9


def test_symmetric_methods_drift_nowhere_and_one_that_is_not_does():
    """McLachlan & Atela's of order three is symplectic but not symmetric: the way back does not retrace the orbit."""
    found = reduced("babps8o7h", "mclachlan_atela_3", steps=20_000)
    own = found.sel(integrator="babps8o7h")
    assert abs(own.trend) < 3 * own.trend_half_width
    assert abs(own.trend) < own.max_energy_error / 50
    back = found.way_back.sel(summation="compensated")
    assert back[0] < 1e-12 < back[1]


def test_rounding_errors_are_few_units_and_smaller_when_compensated():
    """A random walk of 2 s + 1 roundings of 2^-53 a step: 10^4 evaluations have sqrt(2 10^4) 2^-53 = 1.6e-14."""
    compensated, plain = reduced("babps8o7h", steps=10**5).rounding.isel(integrator=0).values
    assert compensated < plain / 2
    assert 2.0**-53 < plain < 1.6e-14 * 10


@pytest.mark.slow
def test_table_has_rows_of_method_beside_and_of_all_others():
    found = measure(("ruth",), "babps8o7h", SMALL)["run"]
    table = long_table(assembled(found.variables, found.coordinates, {}))
    rows = table.records()
    assert [(row["system"], row["method"]) for row in rows] == [
        (system, method) for system in ("morse", "henon_heiles") for method in ("babps8o7h", "ruth")
    ]
    assert [row["rounding_ratio"] for row in rows[::2]] == [1, 1]
    largest = found.variables["max_energy_error"][1].max(axis=-1)
    assert [row["max_energy_error"] for row in rows] == largest.ravel().tolist()
    for row in rows:
        method = nh.integrators[row["method"]]
        assert row["sum of coefficients"] == pytest.approx(sum(abs(float(c)) for c in (*method.kick, *method.drift)))
        assert row["drift"] == ("no" if abs(row["trend"]) <= row["trend_half_width"] else "yes")
        assert row["rounding_ratio"] > 0


@pytest.mark.long
def test_gains_at_equal_time_use_measured_charge(monkeypatch, tmp_path):
    methods = ("babps8o7h", "srkn_b11", "chin_4a", "mclachlan_ss5", "abag5o6")
    monkeypatch.setattr(times, "costs", lambda _, width: (2.0, 3.0) if width > 1 else (8.0, 1e-9))
    monkeypatch.setattr(times, "kind_of", lambda name: "trained" if name == "chin_4a" else "published")
    job.write(proof.proof_measure(methods, SMALL)["run"], [str(tmp_path / "run.h5")], {})
    job.write(reduce(methods, SMALL, str(tmp_path / "run.h5"))["cube"], [str(tmp_path / "cube.h5")], {})
    table = times.measure_times(str(tmp_path / "cube.h5"), methods, SMALL)["table"]
    rows = table.records()
    assert {(row["ns_lanes"], row["ns_single"], row["charge_lanes"]) for row in rows} == {(2.0, 8.0, 3.0)}
    for trial, row in zip(times.proof_ensembles(SMALL), rows, strict=True):
        for mode, charge in (("lanes", 3.0), ("single", 1e-9)):
            logs = proof.log_errors(trial.ensemble, methods, trial.tau_per_stage, charge).mean(axis=-1)[:, 0]
            assert row[f"gain_{mode}"] == pytest.approx(min(logs[[0, 1, 3, 4]]) - logs[2]), trial.ensemble.name
    # A more expensive gradient means longer steps at equal time, which no force-gradient method gains from.
    assert np.mean([row["gain_lanes"] for row in rows]) < np.mean([row["gain_single"] for row in rows])


@pytest.mark.parametrize(("width", "problems"), [(1, 1), (16, times.PROBLEMS)])
def test_costs_add_up_to_least_time_of_step_in_nanoseconds(monkeypatch, width, problems):
    clock = ([2e-3, 1e-3], [3.5e-3, 4e-3])  # seconds of all steps of all problems
    monkeypatch.setattr(times, "interleaved", lambda calls, patience: clock)
    nanoseconds, charge = times.costs(henon_heiles_starts(), width)
    plain, modified = times.integrators[times.PLAIN], times.integrators[times.MODIFIED]
    steps = times.STEPS * problems
    assert plain.stages * nanoseconds == pytest.approx(1e6 / steps)
    assert (modified.stages + modified.gradients * charge) * nanoseconds == pytest.approx(3.5e6 / steps)


def test_run_back_has_same_steps_with_other_sign():
    one = partial(run, henon_heiles_starts(), nh.integrators["babps8o7h"], 0.2, 10, samples=2)
    there, back = one(), one(back=True)
    mirrored = henon_heiles_starts().start.copy()
    mirrored.reshape(-1, 4, 2)[:, 2] *= -1
    assert one(mirrored).q[:, -1] == pytest.approx(back.q[:, -1], abs=1e-14)
    assert not np.allclose(there.q[:, -1], back.q[:, -1])
