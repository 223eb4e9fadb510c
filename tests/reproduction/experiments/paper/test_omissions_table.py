"""The table of what was left out: planned omissions, runs that ended early, and totals that add up to the full grid."""

from __future__ import annotations

import csv
from dataclasses import replace
from fractions import Fraction

import pytest
import xarray as xr

from nearharmonic.engine.settings import Sweep
from nearharmonic.integrators import integrators
from nearharmonic.output.table import save
from nearharmonic.reproduction.experiments.paper.grid.omissions import skipped, summary_line, table_of, totals
from nearharmonic.reproduction.experiments.paper.grid.plan import Omission, plan

CONFIG = (
    (
        Sweep(
            system="henon_heiles",
            t_end="30",
            lowest=0.1,
            highest=1.0,
            points_per_decade=1,
            precision=("double",),
            summation="compensated",
            samples=10,
            shards=1,
        ),
    ),
    ("ruth",),
)
ROW = Omission(
    system="henon_heiles",
    integrator="ruth",
    precision="double",
    what="the rest of a run",
    reason="it left its energy surface",
    runs=1,
    evaluations=18,
)
#: Both step sizes of the grid, 0.1 and 1, in extended precision: 100 and 10 steps of three stages.
NOT_ASKED = replace(
    ROW,
    precision="extended",
    what="runs in extended precision",
    reason="the config does not ask for this precision",
    runs=2,
    evaluations=330,
)


def cube():
    """100 steps of 3 x 0.1 that stayed, 10 steps of 3 x 1 that left after 4: 30 - 12 = 18 evaluations spared."""
    runs = xr.Dataset(
        {
            "status": (("integrator", "tau_per_stage"), [["ok", "diverged"]]),
            "steps": (("integrator", "tau_per_stage"), [[100, 10]]),
            "evaluations": (("integrator", "tau_per_stage"), [[300, 12]]),
        },
        coords={"integrator": ["ruth"], "tau_per_stage": [0.1, 1.0]},
    )
    return runs.expand_dims(precision=["double"])


def made_by(config):
    """Cubes of runs that all stay, with the evaluations counted from the methods' stages alone."""
    cubes = {}
    for sweep in config[0]:
        layers = {}
        for run in plan(*config).runs:
            if run.system == sweep.system:
                tableau = integrators[run.integrator]
                opening = tableau.first == "kick"
                for tau, steps in zip(run.tau_per_stage, run.steps, strict=True):
                    layers[run.precision, run.integrator, tau] = steps, steps * tableau.stages + opening
        axes = [sorted({key[i] for key in layers}) for i in range(3)]
        shape = [[[layers.get((p, n, t)) for t in axes[2]] for n in axes[1]] for p in axes[0]]

        def table(pick, shape=shape):
            return [[[pick(entry) for entry in row] for row in layer] for layer in shape]

        dims = ("precision", "integrator", "tau_per_stage")
        cubes[sweep.system] = xr.Dataset(
            {
                "status": (dims, table(lambda entry: "ok" if entry else "skipped")),
                "steps": (dims, table(lambda entry: entry[0] if entry else 0)),
                "evaluations": (dims, table(lambda entry: entry[1] if entry else 0)),
            },
            coords=dict(zip(dims, axes, strict=True)),
        )
    return cubes


def test_diverged_run_skips_its_remaining_steps():
    assert skipped(*CONFIG, {"henon_heiles": cube()}) == [NOT_ASKED, ROW]


def test_step_sizes_that_share_run_spare_rest_of_it_once():
    again = cube().isel(tau_per_stage=[1]).assign_coords(tau_per_stage=[1.01])
    twice = xr.concat([cube(), again], "tau_per_stage", data_vars="all")
    assert skipped(*CONFIG, {"henon_heiles": twice}) == [NOT_ASKED, ROW]


def test_totals_state_work_done_and_cost_of_full_grid():
    done, full, *saved = totals([NOT_ASKED, ROW], {"henon_heiles": cube()})
    assert (done.what, done.runs, done.evaluations) == ("done", 2, 312)
    assert (full.what, full.runs, full.evaluations) == ("full grid", 4, 660)
    assert [row.evaluations for row in saved] == [330, 18]


SMALL = {"points_per_decade": 7, "summation": "compensated", "samples": 10, "shards": 2}
EVERY_REASON = (
    (
        Sweep(system="sho", t_end="20", lowest=0.01, highest=4, precision=("double", "extended"), **SMALL),
        Sweep(system="kepler", t_end="8766", lowest=2, highest=900, precision=("double",), **SMALL),
    ),
    ("ruth", "babs7o7h"),
)


def test_done_and_saved_add_up_to_hand_counted_grid():
    """Each step size twice, to its end; a second pass over Kepler orbits and the forces handed on, where runs were."""
    expected = 0
    sweeps, methods = EVERY_REASON
    for sweep in sweeps:
        grid = [float(f"{sweep.lowest * 10 ** (i / 7):.6g}") for i in range(100)]
        for tableau in (integrators[name] for name in methods):
            opening = tableau.first == "kick"
            steps = [
                max(1, round(Fraction(sweep.t_end) / Fraction(t * tableau.stages)))
                for t in grid
                if t <= sweep.highest * 1.0002
            ]
            expected += 2 * sum(n * tableau.stages + opening for n in steps)
    for run in plan(*EVERY_REASON).runs:
        tableau = integrators[run.integrator]
        opening = tableau.first == "kick"
        for n in set(run.steps):
            expected += (run.system == "kepler") * (n * tableau.stages + opening) + opening * (n - 1)
    cubes = made_by(EVERY_REASON)
    done, full, *saved = totals(skipped(*EVERY_REASON, cubes), cubes)
    assert full.evaluations == expected
    assert done.evaluations + sum(row.evaluations for row in saved) == full.evaluations
    assert len(saved) == 5
    assert [row.evaluations for row in saved] == sorted((row.evaluations for row in saved), reverse=True)


def test_the_table_has_one_line_for_each_omission(tmp_path):
    save(table_of([ROW]), [tmp_path / "skipped.csv"])
    with (tmp_path / "skipped.csv").open(newline="") as file:
        (line,) = csv.DictReader(file)
    assert (line["reason"], line["runs"], line["evaluations"]) == ("it left its energy surface", "1", "18")
    assert [path.name for path in tmp_path.iterdir()] == ["skipped.csv"]


@pytest.mark.parametrize(
    "words", ["312 force evaluations done, 0.47 of the 660", "0.5 (runs in ext", "0.027 (the rest"]
)
def test_one_line_sums_it_up(tmp_path, words):
    rows = [NOT_ASKED, ROW]
    save(table_of([*rows, *totals(rows, {"henon_heiles": cube()})]), [tmp_path / "skipped.csv"])
    line = summary_line(tmp_path / "skipped.csv")
    assert words in line
    assert "\n" not in line
