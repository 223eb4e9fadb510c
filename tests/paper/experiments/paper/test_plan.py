"""The plan: grids, shards, steps, precision, reasons for omissions, and runs of an earlier config."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
import xarray as xr
from mpmath import mpf

from nearharmonic.engine.settings import Sweep, steps_over, tau_grid, tau_range
from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.integrators import integrators
from nearharmonic.output.store import write
from nearharmonic.output.table import Table, save
from nearharmonic_paper.experiments.paper import reductions, run
from nearharmonic_paper.experiments.paper import run as plan
from nearharmonic_paper.experiments.paper.earlier import Earlier, forget, keep
from nearharmonic_paper.tasks.provenance import provenance, task
from support.oracles.reference_solutions import ellipse_error
from support.projects.plans import omitted, planned_runs

# --- The plan: grids, shards, steps, precision and omissions.


SHO = Sweep(
    system="sho",
    t_end="500",
    lowest=1e-4,
    highest=1.0,
    points_per_decade=40,
    precision=("double", "extended"),
    summation="compensated",
    samples=500,
    shards=2,
)
HENON_HEILES = replace(SHO, system="henon_heiles", precision=("double",))


def config(*sweeps, methods=("ruth", "babs7o7h")):
    return sweeps, methods


def test_grid_has_equal_ratios_from_lowest_to_highest():
    grid = tau_grid(1e-4, 1.0, 40)
    assert (len(grid), grid[0], grid[-1]) == (161, 1e-4, 1.0)
    for a, b in pairwise(grid):
        assert b / a == pytest.approx(10 ** (1 / 40), rel=1e-5)  # six significant digits in each
    assert tau_grid(0.01, 158.489, 40)[-1] == 158.489  # itself rounded, below 10^2.2 = 158.48932
    assert tau_grid(1.0, 99.0, 1) == (1.0, 10.0)


@pytest.mark.parametrize("count", [1, 2, 7, 161])
def test_shards_share_the_grid_without_gap_or_overlap(count):
    asked = replace(SHO, shards=count)
    shards = [plan.shard_range(asked, "ruth", index) for index in range(plan.shards_of(asked, "ruth"))]
    assert [i for part in shards for i in part] == list(range(161))


@pytest.mark.parametrize("points_per_decade", [40, 25_000, 250_000])
def test_part_of_a_grid_is_that_of_the_whole(points_per_decade):
    """The step sizes are computed as products of two powers; one at a time is a power."""
    begin, end = 3 * points_per_decade - 5, 3 * points_per_decade + 5
    part = tau_range(1e-4, points_per_decade, begin, end)
    assert part == tuple(tau_range(1e-4, points_per_decade, i, i + 1)[0] for i in range(begin, end))
    assert part[5] == 0.1
    for i, tau in enumerate(part, begin):
        with mpmath.workdps(40):
            assert abs(tau / (mpf("1e-4") * mpf(10) ** (mpf(i) / points_per_decade)) - 1) < 5e-6
    assert len(set(part)) == 10


@pytest.mark.parametrize("name", ["ruth", "babps9o7h"])
def test_steps_of_a_grid_are_those_of_each_step_size(name):
    """Ratios at exactly a half, as 500 / (3 * 100 / 3) = 5 and 2.5, are rounded to even."""
    taus = np.array([*tau_grid(1e-3, 100.0, 50), 500 / 2.5 / integrators[name].stages, 200 / 3])
    each = [integrators[name].steps(tau, Fraction(500)) for tau in taus.tolist()]
    assert steps_over(taus, "500", integrators[name]).tolist() == each


def test_jobs_of_a_fine_grid_take_the_time_asked_for():
    """10^5 step sizes: all jobs have equal shares, but for one run, of which there are thousands in each."""
    fine = replace(HENON_HEILES, points_per_decade=25_000, samples=0)
    count = plan.suitable_shards(fine, 5.0)
    assert plan.suitable_shards(fine, 50.0) == -(-count // 10)
    asked = replace(fine, shards=count)
    parts = [plan.runs_of(asked, "ruth", index)[0] for index in (0, count // 2, count - 1)]
    costs = [sum(part.steps) * 3 * 2e-9 + len(part.steps) * 1e-4 for part in parts]
    assert costs == pytest.approx([5.0] * 3, rel=0.05)


@pytest.mark.parametrize("name", ["ruth", "aba864", "abas5o6h", "babs7o7h"])
def test_extended_precision_covers_exactly_step_sizes_near_double_floor(name):
    tableau, limit = integrators[name], 1e-13  # two decades above a floor of 1e-15
    extended = {
        tau
        for index in (0, 1)
        for run in plan.runs_of(SHO, name, index)
        if run.precision == "extended"
        for tau in run.tau_per_stage
    }
    grid = tau_grid(SHO.lowest, SHO.highest, SHO.points_per_decade)
    last = max(extended)
    first_left_out = grid[grid.index(last) + 1]
    assert extended == {tau for tau in grid if tau <= last}
    assert ellipse_error(tableau, mpf(last * tableau.stages)) < limit
    assert ellipse_error(tableau, mpf(first_left_out * tableau.stages)) >= limit


def test_extended_precision_covers_whole_grid_where_nothing_foretells_error():
    both = replace(HENON_HEILES, precision=("double", "extended"))
    double, extended = plan.runs_of(both, "ruth", 0)
    assert double.tau_per_stage == extended.tau_per_stage


def test_extended_precision_alone_covers_the_whole_grid():
    alone = replace(SHO, precision=("extended",), shards=1)
    (run,) = plan.runs_of(alone, "ruth", 0)
    assert run.tau_per_stage == tau_grid(SHO.lowest, SHO.highest, SHO.points_per_decade)
    assert {row.reason for row in omitted(*config(alone))}.isdisjoint(
        {"in double, the error is over 100 times the rounding floor"}
    )


def test_step_sizes_with_equal_steps_share_shard():
    short = replace(HENON_HEILES, t_end="5")  # one to five steps at the coarse end: many coincide
    seen = {}
    for index in range(plan.shards_of(short, "ruth")):
        (run,) = plan.runs_of(short, "ruth", index)
        assert list(run.steps) == sorted(run.steps, reverse=True)
        for steps in run.steps:
            assert seen.setdefault(steps, index) == index
    repeated = [row for row in omitted(*config(short)) if "neighbour" in row.what and row.integrator == "ruth"]
    assert sum(row.runs for row in repeated) == 161 - len(seen)


def test_runs_and_omissions_add_up_to_the_whole_product():
    sweeps, methods = config(SHO, HENON_HEILES)
    runs = planned_runs(sweeps, methods)
    extended = sum(len(run.steps) for run in runs if run.precision == "extended")
    left_out = sum(row.runs for row in omitted(sweeps, methods) if row.what == "runs in extended precision")
    assert extended + left_out == 4 * 161
    assert sum(len(run.steps) for run in runs if run.precision == "double") == 4 * 161


@pytest.mark.parametrize("name", ["ruth", "babs7o7h"])
@pytest.mark.parametrize("steps", [1, 2, 5])
def test_evaluations_count_the_kicks_that_are_left_when_neighbours_merge(name, steps):
    tableau = integrators[name]
    other = {"kick": "drift", "drift": "kick"}[tableau.first]
    one_step = [tableau.first, other] * tableau.stages + [tableau.first]
    merged = [operator for i, operator in enumerate(one_step * steps) if i % len(one_step) or not i]
    assert tableau.evaluations(steps) == merged.count("kick")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"lowest": 1e-9}, "would take 166666666667 steps"),
        ({"lowest": 1e-300, "highest": 1e-299}, "steps"),
        ({"points_per_decade": 10**6}, "may have 1000001"),
        ({"lowest": 4e-7, "points_per_decade": 150_000}, "force evaluations"),
        ({"samples": 10**7}, "add shards"),
    ],
)
def test_more_than_a_machine_has_is_refused_with_the_number(change, says):
    with pytest.raises(SettingError, match=says):
        plan.check_sweep(replace(HENON_HEILES, **change), ("ruth", "babs7o7h"))


def test_most_steps_of_method_are_those_of_fewest_stages():
    plan.check_sweep(replace(HENON_HEILES, lowest=1e-7, highest=1e-7), ("babs7o7h",))  # 500 / 7e-7 = 7.1e8
    with pytest.raises(NearharmonicError, match="1666666667 steps"):
        plan.check_sweep(replace(HENON_HEILES, lowest=1e-7, highest=1e-7), ("babs7o7h", "ruth"))


# --- Each reason for an omission, with its runs and force evaluations counted by hand.


def asked_of(system, method, t_end, lowest, highest, precision=("double",)):
    sweep = Sweep(
        system=system, t_end=t_end, lowest=lowest, highest=highest, points_per_decade=1, precision=precision,
        summation="compensated", samples=10, shards=1,
    )  # fmt: skip
    return (sweep,), (method,)


def found(settings, cubes=None):
    """(precision, what, runs, evaluations) of each row; all are of the config's one system and method."""
    rows = plan.skipped(*settings, cubes or {})
    assert {(row.system, row.integrator) for row in rows} == {(settings[0][0].system, settings[1][0])}
    return {(row.precision, row.what): (row.runs, row.evaluations) for row in rows}


def test_kepler_orbits_run_once_and_leapfrog_reuses_force():
    """700 h in 7 steps of 100 h and one step of 1000 h: 8 and 2 forces, of which 6 open a step that is not the first.

    The full grid has the runs in both precisions, and in double each once more for the perihelion.
    """
    assert found(asked_of("kepler", "leapfrog", "700", 100, 1000)) == {
        ("double", "runs for the perihelion alone"): (2, 10),
        ("double", "first force of a step"): (1, 6),
        ("extended", "runs in extended precision"): (2, 10),
    }


def test_step_sizes_that_round_to_same_steps_are_run_once():
    """Five units of time in 2 steps of 3 x 1 (rounded from 1.67) and one step of 3 x 10 or 3 x 100."""
    assert found(asked_of("henon_heiles", "ruth", "5", 1, 100)) == {
        ("double", "runs with as many steps as their neighbour"): (1, 3),
        ("extended", "runs in extended precision"): (3, 12),
    }


def test_extended_precision_is_left_out_where_double_is_good_enough():
    """0.9 in 3000, 300, 30 and 3 steps: the error, tau^4/60 for Ruth, is below 1e-13 for the finest alone."""
    precisions = ("double", "extended")
    assert found(asked_of("sho", "ruth", "0.9", 1e-4, 0.1, precisions)) == {
        ("extended", "runs in extended precision"): (3, 3 * (300 + 30 + 3))
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
    rows = found(asked_of("henon_heiles", "leapfrog", "40", 1, 1), {"henon_heiles": cube})
    assert rows["double", "the rest of a run"] == (2, 15 + 7)


def test_runs_that_were_skipped_are_not_counted_as_done():
    """In extended precision the finest was run alone: 41 + 6 + 41 forces, of three runs."""
    double = runs([40, 20], [41, 6], ["ok", "diverged"])
    extended = runs([40, 0], [41, 0], ["ok", "skipped"], "extended")
    cube = xr.concat([double, extended], "precision", data_vars="all")
    done, full, *saved = plan.totals([], {"henon_heiles": cube})
    assert (done.runs, done.evaluations) == (full.runs, full.evaluations) == (3, 88)
    assert saved == []


@pytest.mark.parametrize("many", [100, 900])
def test_totals_add_rows_of_reason_and_put_largest_first(many):
    row = {"system": "sho", "integrator": "ruth", "precision": "double"}
    rows = [
        plan.Omission(**row, what="runs of a step size", reason="few", runs=3, evaluations=400),
        plan.Omission(**row, what="the rest of a run", reason="many", runs=1, evaluations=many),
        plan.Omission(**row, what="the rest of a run", reason="many", runs=2, evaluations=50),
    ]
    cube = runs([40], [41], ["ok"])
    done, full, *saved = plan.totals(rows, {"henon_heiles": cube})
    assert (done.runs, done.evaluations) == (1, 41)
    assert (full.runs, full.evaluations) == (1 + 3, 41 + 450 + many)
    few, rest = ("runs of a step size: few", 3, 400), ("the rest of a run: many", 3, many + 50)
    assert [(r.reason, r.runs, r.evaluations) for r in saved] == ([rest, few] if many > 350 else [few, rest])
    assert {(r.system, r.integrator, r.precision) for r in (done, full, *saved)} == {("all", "all", "all")}


@pytest.mark.parametrize(("unit", "counts"), [(10**6, "41 of 164 million"), (10**8, "4.1 of 16.4 billion")])
def test_line_has_evaluations_done_and_in_full_grid(tmp_path, unit, counts):
    row = plan.Omission(
        system="sho", integrator="ruth", precision="double", what="the rest of a run", reason="left", runs=1,
        evaluations=123 * unit,
    )  # fmt: skip
    rows = [row, *plan.totals([row], {"henon_heiles": runs([40 * unit], [41 * unit], ["ok"])})]
    save(Table(header=plan.Omission._fields, rows=rows, caption=""), [tmp_path / "skipped.csv"])
    said = f"Computed {counts} force evaluations; the rest cannot change a result"
    assert plan.summary_line(tmp_path / "skipped.csv") == said


# --- Runs that an earlier config has made are taken over: what is integrated, and the bytes of the files.


EARLIER_SHO = Sweep(
    system="sho", t_end="5", lowest=1e-4, highest=1.0, points_per_decade=40, precision=("double", "extended"),
    samples=20, shards=1,
)  # fmt: skip
KEPLER = replace(EARLIER_SHO, system="kepler", t_end="8766", lowest=1.0, highest=100.0, precision=("double",))
KEEPING, REDUCING = "run:integrate", "reductions:integrate_and_reduce"
FUNCTIONS = {KEEPING: run, REDUCING: reductions}


@pytest.fixture
def integrated(monkeypatch):
    """Each (precision, steps) that is integrated; step sizes with equal steps share one."""
    seen = []
    original = run.integrate_run

    def noting(one):
        seen.extend(dict.fromkeys((one.precision, steps) for steps in one.steps))
        return original(one)

    for module in FUNCTIONS.values():
        monkeypatch.setattr(module, "integrate_run", noting)
    return seen


def make(folder, asked, function=KEEPING):
    """Write the run files of Ruth's method as jobs do, and return their bytes."""
    contents = {}
    shards = [folder / f"runs/{asked.system}/ruth/{i}.h5" for i in range(plan.shards_of(asked, "ruth"))]
    keep(folder, shards)
    for index, place in enumerate(shards):
        settings = {"sweep": asked, "integrator": "ruth", "shard": index}
        origin = provenance(task(f"nearharmonic_paper.experiments.paper.{function}", **settings))
        module, name = FUNCTIONS[function], function.partition(":")[2]
        made = getattr(module, name)(**settings, earlier=Earlier(folder, place, origin))["run"]
        place.parent.mkdir(parents=True, exist_ok=True)
        write(place, made.variables, {**made.attributes, **origin}, made.groups, coordinates=made.coordinates)
        contents[place.name] = place.read_bytes()
    forget(folder)
    return contents


def planned(asked):
    runs = [one for index in range(plan.shards_of(asked, "ruth")) for one in plan.runs_of(asked, "ruth", index)]
    return {(one.precision, steps) for one in runs for steps in one.steps}


@pytest.mark.parametrize(
    ("asked", "function"),
    [
        (EARLIER_SHO, KEEPING),
        *(
            pytest.param(*of, marks=pytest.mark.slow)
            for of in ((KEPLER, KEEPING), (replace(EARLIER_SHO, samples=0), REDUCING))
        ),
    ],
)
def test_twice_as_fine_a_grid_integrates_exactly_the_new_half(tmp_path, integrated, asked, function):
    fine = replace(asked, points_per_decade=80)
    make(tmp_path / "one", asked, function)
    assert set(integrated) == planned(asked)
    integrated.clear()
    made = make(tmp_path / "one", fine, function)
    assert len(integrated) == len(set(integrated))
    assert set(integrated) == planned(fine) - planned(asked)
    assert made == make(tmp_path / "other", fine, function)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "known"),
    [
        *(
            (change, True)
            for change in (
                {"shards": 2, "lowest": 0.1}, {"shards": 3}, {"lowest": 1e-2}, {"highest": 0.5},
                {"precision": ("double",)}, {"precision": ("double", "extended")},
            )
        ),
        *((change, False) for change in ({"t_end": "6"}, {"samples": 30}, {"summation": "plain"})),
    ],
)  # fmt: skip
def test_runs_of_equal_settings_are_taken_over_and_no_others(tmp_path, integrated, change, known):
    asked = replace(EARLIER_SHO, points_per_decade=10)
    if change.get("precision") == asked.precision:
        asked = replace(asked, precision=("double",))
    make(tmp_path / "one", asked)
    other = replace(asked, **change)
    integrated.clear()
    made = make(tmp_path / "one", other)
    assert set(integrated) == planned(other) - (planned(asked) if known else set())
    assert made == make(tmp_path / "other", other)


@pytest.mark.slow
def test_damaged_earlier_file_gives_nothing(tmp_path, integrated):
    asked = replace(EARLIER_SHO, points_per_decade=5)
    whole = make(tmp_path / "one", asked)
    place = tmp_path / "one/runs/sho/ruth/0.h5"
    damaged = bytearray(whole["0.h5"])
    damaged[len(damaged) // 2] ^= 1
    place.write_bytes(damaged)
    integrated.clear()
    assert make(tmp_path / "one", asked) == whole
    assert set(integrated) == planned(asked)
