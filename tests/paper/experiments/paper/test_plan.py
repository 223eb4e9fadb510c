"""The plan: grids, shards, steps, precision and omissions."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from mpmath import mpf

from nearharmonic.engine.settings import Sweep, steps_over, tau_grid, tau_range
from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.integrators import integrators
from nearharmonic_paper.experiments.paper.run import check_sweep, runs_of, shard_range, shards_of, suitable_shards
from support.oracles.reference_solutions import ellipse_error
from support.projects.plans import omitted, planned_runs

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


def test_a_grid_reaches_a_highest_that_is_itself_rounded():
    assert tau_grid(0.01, 158.489, 40)[-1] == 158.489  # below 10^2.2 = 158.48932


def test_a_grid_stops_below_a_highest_between_its_points():
    assert tau_grid(1.0, 99.0, 1) == (1.0, 10.0)


@pytest.mark.parametrize("count", [1, 2, 7, 161])
def test_shards_share_the_grid_without_gap_or_overlap(count):
    asked = replace(SHO, shards=count)
    shards = [shard_range(asked, "ruth", index) for index in range(shards_of(asked, "ruth"))]
    assert [i for part in shards for i in part] == list(range(161))


@pytest.mark.parametrize("points_per_decade", [40, 25_000, 250_000])
def test_part_of_a_grid_is_that_of_the_whole(points_per_decade):
    """The step sizes are computed as products of two powers; those of one at a time are powers."""
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


def test_two_shards_cost_same_within_one_step_of_grid():
    costs = [
        sum(run.steps[i] for run in runs_of(HENON_HEILES, "aba864", k) for i in range(len(run.steps))) for k in (0, 1)
    ]
    # Cut at a step size, each part is off by at most the largest of them: a share 1 - 10^(-1/40) of the whole.
    assert abs(costs[0] / sum(costs) - 0.5) <= 1 - 10 ** (-1 / 40)


def test_jobs_of_a_fine_grid_take_the_time_asked_for():
    """10^5 step sizes: all jobs have equal shares, but for one run, of which there are thousands in each."""
    fine = replace(HENON_HEILES, points_per_decade=25_000, samples=0)
    count = suitable_shards(fine, 5.0)
    assert suitable_shards(fine, 50.0) == -(-count // 10)
    asked = replace(fine, shards=count)
    parts = [runs_of(asked, "ruth", index)[0] for index in (0, count // 2, count - 1)]
    costs = [sum(part.steps) * 3 * 2e-9 + len(part.steps) * 1e-4 for part in parts]
    assert costs == pytest.approx([5.0] * 3, rel=0.05)


@pytest.mark.parametrize("name", ["ruth", "babps9o7h"])
def test_steps_cover_the_interval_as_closely_as_whole_steps_can(name):
    stages = integrators[name].stages
    for index in (0, 1):
        (run,) = runs_of(HENON_HEILES, name, index)
        for tau, steps in zip(run.tau_per_stage, run.steps, strict=True):
            off = abs(Fraction(run.sweep.t_end) - steps * Fraction(tau * stages))
            assert off <= Fraction(tau * stages) / 2


@pytest.mark.parametrize("name", ["ruth", "aba864", "abas5o6h", "babs7o7h"])
def test_extended_precision_covers_exactly_step_sizes_near_double_floor(name):
    tableau, limit = integrators[name], 1e-13  # two decades above a floor of 1e-15
    extended = {
        tau
        for index in (0, 1)
        for run in runs_of(SHO, name, index)
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
    double, extended = runs_of(both, "ruth", 0)
    assert double.tau_per_stage == extended.tau_per_stage


def test_extended_precision_alone_covers_the_whole_grid():
    alone = replace(SHO, precision=("extended",), shards=1)
    (run,) = runs_of(alone, "ruth", 0)
    assert run.tau_per_stage == tau_grid(SHO.lowest, SHO.highest, SHO.points_per_decade)
    assert {row.reason for row in omitted(*config(alone))}.isdisjoint(
        {"in double, the error is over 100 times the rounding floor"}
    )


def test_step_sizes_with_equal_steps_share_shard():
    short = replace(HENON_HEILES, t_end="5")  # one to five steps at the coarse end: many coincide
    seen = {}
    for index in range(shards_of(short, "ruth")):
        (run,) = runs_of(short, "ruth", index)
        assert list(run.steps) == sorted(run.steps, reverse=True)
        for steps in run.steps:
            assert seen.setdefault(steps, index) == index
    repeated = [row for row in omitted(*config(short)) if "neighbour" in row.reason and row.integrator == "ruth"]
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
        check_sweep(replace(HENON_HEILES, **change), ("ruth", "babs7o7h"))


def test_most_steps_of_method_are_those_of_fewest_stages():
    check_sweep(replace(HENON_HEILES, lowest=1e-7, highest=1e-7), ("babs7o7h",))  # 500 / 7e-7 = 7.1e8
    with pytest.raises(NearharmonicError, match="1666666667 steps"):
        check_sweep(replace(HENON_HEILES, lowest=1e-7, highest=1e-7), ("babs7o7h", "ruth"))
