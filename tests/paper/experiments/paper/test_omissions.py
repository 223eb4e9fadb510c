"""Each reason for an omission, with its runs and force evaluations counted by hand."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from nearharmonic.engine.settings import Sweep
from nearharmonic.output.table import Table, save
from nearharmonic_paper.experiments.paper.run import Omission, skipped, summary_line, totals


def config(system, method, t_end, lowest, highest, precision=("double",)):
    sweep = Sweep(
        system=system, t_end=t_end, lowest=lowest, highest=highest, points_per_decade=1, precision=precision,
        summation="compensated", samples=10, shards=1,
    )  # fmt: skip
    return (sweep,), (method,)


def found(settings, cubes=None):
    """(precision, what, runs, evaluations) of each row; all are of the config's one system and method."""
    rows = skipped(*settings, cubes or {})
    assert {(row.system, row.integrator) for row in rows} == {(settings[0][0].system, settings[1][0])}
    return {(row.precision, row.what): (row.runs, row.evaluations) for row in rows}


def test_kepler_orbits_run_once_and_leapfrog_reuses_force():
    """700 h in 7 steps of 100 h and one step of 1000 h: 8 and 2 forces, of which 6 open a step that is not the first.

    The full grid has the runs in both precisions, and in double each once more for the perihelion.
    """
    assert found(config("kepler", "leapfrog", "700", 100, 1000)) == {
        ("double", "runs for the perihelion alone"): (2, 10),
        ("double", "the force that opens a step"): (1, 6),
        ("extended", "runs in extended precision"): (2, 10),
    }


def test_step_sizes_that_round_to_same_steps_are_run_once():
    """Five units of time in 2 steps of 3 x 1 (rounded from 1.67) and one step of 3 x 10 or 3 x 100."""
    assert found(config("henon_heiles", "ruth", "5", 1, 100)) == {
        ("double", "runs of a step size"): (1, 3),
        ("extended", "runs in extended precision"): (3, 12),
    }


def test_extended_precision_is_left_out_where_double_is_good_enough():
    """0.9 in 3000, 300, 30 and 3 steps: the error, tau^4/60 for Ruth, is below 1e-13 for the finest alone."""
    precisions = ("double", "extended")
    assert found(config("sho", "ruth", "0.9", 1e-4, 0.1, precisions)) == {
        ("extended", "runs in extended precision"): (3, 3 * (300 + 30 + 3)),
    }


def runs(steps, evaluations, status, precision="double"):
    """A cube of one method made by hand, the step sizes 1, 2, ... per stage."""
    over = ("precision", "integrator", "tau_per_stage")
    columns = {"steps": steps, "evaluations": evaluations, "status": status}
    return xr.Dataset(
        {name: (over, np.array([[values]])) for name, values in columns.items()},
        coords={"precision": [precision], "integrator": ["leapfrog"], "tau_per_stage": np.arange(1.0, len(steps) + 1)},
    )


def test_rest_of_runs_that_left_is_spared_by_each_once():
    """One run made 5 of 20 steps, with 6 of 21 forces, one 3 of 10 steps, with 4 of 11; one stayed, one was shared."""
    cube = runs([40, 20, 20, 10], [41, 6, 6, 4], ["ok", "diverged", "diverged", "diverged"])
    rows = found(config("henon_heiles", "leapfrog", "40", 1, 1), {"henon_heiles": cube})
    assert rows["double", "the rest of a run"] == (2, 15 + 7)


def test_runs_that_were_skipped_are_not_counted_as_done():
    """In extended precision the finest was run alone: 41 + 6 + 41 forces, of three runs."""
    double = runs([40, 20], [41, 6], ["ok", "diverged"])
    extended = runs([40, 0], [41, 0], ["ok", "skipped"], "extended")
    cube = xr.concat([double, extended], "precision", data_vars="all")
    done, full, *saved = totals([], {"henon_heiles": cube})
    assert (done.runs, done.evaluations) == (full.runs, full.evaluations) == (3, 88)
    assert saved == []


@pytest.mark.parametrize("many", [100, 900])
def test_totals_add_rows_of_reason_and_put_largest_first(many):
    row = {"system": "sho", "integrator": "ruth", "precision": "double"}
    rows = [
        Omission(**row, what="runs of a step size", reason="few", runs=3, evaluations=400),
        Omission(**row, what="the rest of a run", reason="many", runs=1, evaluations=many),
        Omission(**row, what="the rest of a run", reason="many", runs=2, evaluations=50),
    ]
    cube = runs([40], [41], ["ok"])
    done, full, *saved = totals(rows, {"henon_heiles": cube})
    assert (done.runs, done.evaluations) == (1, 41)
    assert (full.runs, full.evaluations) == (1 + 3, 41 + 450 + many)
    few, rest = ("runs of a step size: few", 3, 400), ("the rest of a run: many", 3, many + 50)
    assert [(r.reason, r.runs, r.evaluations) for r in saved] == ([rest, few] if many > 350 else [few, rest])
    assert {(r.system, r.integrator, r.precision) for r in (done, full, *saved)} == {("all", "all", "all")}


def test_the_line_has_the_shares_of_the_full_grid(tmp_path):
    """41 forces done and 123 saved: a quarter of 164, and three quarters."""
    row = Omission(
        system="sho", integrator="ruth", precision="double", what="the rest of a run", reason="left", runs=1,
        evaluations=123,
    )  # fmt: skip
    rows = [row, *totals([row], {"henon_heiles": runs([40], [41], ["ok"])})]
    save(Table(header=Omission._fields, rows=rows, caption=""), [tmp_path / "skipped.csv"])
    assert summary_line(tmp_path / "skipped.csv").startswith(
        "25% of the full grid of 1.6e+02 force evaluations was needed; skipped, as it changes no result: "
        "75% the rest of a run: left. Details: "
    )
