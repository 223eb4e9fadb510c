"""Curves of time against error: where they cross a target, exact positions, fair repeats, and the file they live in."""

from __future__ import annotations

from fractions import Fraction
from math import inf, isnan, nan

import mpmath
import numpy as np
import pytest
from mpmath import cos, mpf

from nearharmonic.engine.reference import position_t_end, reference
from nearharmonic.engine.settings import Sweep, tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.recommendation import measure as engine
from nearharmonic.recommendation.measure import (
    Interval,
    Solver,
    clock,
    cross,
    crossing,
    curves_of,
    for_good,
    measure,
    measured,
    members_of,
    prepared_calls,
    ranking,
    variables,
)
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision.run import WorkPrecisionSettings, intervals, solvers_on
from nearharmonic_paper.experiments.work_precision.tables import ns_per_evaluation
from support.cubes.figure_cubes import curves, label, timed
from support.oracles.reference_solutions import oscillator_state


def power_law(order=4, constant=3.0, points=9):
    """Errors constant * tau^order at tau = 1, 1/2, 1/4, ...; cost 1/tau: every crossing has a closed form."""
    taus = [2.0**-i for i in range(points)]
    return [constant * tau**order for tau in taus], [1 / tau for tau in taus]


@pytest.mark.parametrize("target", [1e-1, 1e-3, 1e-6])
def test_a_power_law_is_crossed_where_its_formula_says(target):
    errors, costs = power_law()
    status, (cost,) = cross(errors, [costs], target)
    assert status == "reached"
    # Straight lines through logarithms are exact on a power law, up to rounding of log and exp.
    assert cost == pytest.approx((3.0 / target) ** 0.25, rel=1e-13)


def test_target_that_point_meets_exactly_costs_what_that_point_costs():
    errors, costs = power_law()
    assert cross(errors, [costs], errors[4])[1][0] == pytest.approx(costs[4], rel=1e-13)


def test_a_lucky_coarse_step_does_not_count():
    assert cross([1e-9, 1e-2, 1e-4, 1e-6], [[1.0, 2.0, 4.0, 8.0]], 1e-4) == ("reached", (4.0,))


def test_curve_that_rounding_lifts_again_still_reaches_its_least_error():
    status, (cost,) = cross([1e-2, 1e-12, 1e-11], [[1.0, 2.0, 4.0]], 1e-12)
    assert (status, cost) == ("reached", pytest.approx(2.0, rel=1e-12))


def test_what_is_good_enough_from_start_is_upper_bound():
    assert cross([1e-4, 1e-6], [[1.0, 2.0]], 1e-3) == ("below throughout", (1.0,))


def test_what_never_gets_there_costs_nothing_that_can_be_named():
    for errors in ([1e-2, 1e-3], [inf, inf], [nan], []):
        status, (cost,) = cross(errors, [[1.0] * len(errors)], 1e-6)
        assert status == "not reached"
        assert isnan(cost)


def test_no_line_is_drawn_from_a_run_that_failed():
    assert cross([inf, 1e-7], [[1.0, 2.0]], 1e-6) == ("reached", (2.0,))


def test_an_error_of_zero_is_below_every_target():
    assert cross([1e-2, 0.0], [[1.0, 2.0]], 1e-12) == ("reached", (2.0,))


def test_a_finer_setting_that_costs_less_is_taken():
    assert cross([1e-2, 1e-4, 1e-8], [[5.0, 4.0, 1.0], [50.0, 40.0, 10.0]], 1e-3)[1] == (1.0, 10.0)


def test_errors_for_good_never_rise_and_end_at_the_least():
    assert for_good([1.0, 1e-5, 1e-2, nan, 1e-6, 5e-5]) == [inf, inf, inf, inf, 1e-6]


def made(method, errors, times, kind="splitting", **more):
    """A curve whose point i has the error errors[i], taken in times[i] seconds by 1000 times as many evaluations."""
    solver = timed(method, errors, times, kind, **more)
    solver.columns["evaluations"] = 1e6 * np.array(times)
    return solver


def test_ranking_goes_by_time_and_ends_with_those_that_fail():
    slow = made("slow", [1e-2, 1e-9], [1e-3, 1e-2])
    fast = made("fast", [1e-2, 1e-9], [1e-5, 1e-4])
    never = made("never", [1e-2, 1e-3], [1e-6, 1e-5])
    order = [curve.solver.item() for curve, _ in ranking(curves(never, slow, fast), "max", 1e-6)]
    assert order == ["fast", "slow", "never"]


def test_each_measure_reads_its_own_error_and_the_least_time():
    (curve,) = curves(made("one", [1e-3, 1e-6], [1e-5, 1e-4]))
    assert crossing(curve, "max", 1e-6).time == pytest.approx(1e-4, rel=1e-12)
    assert crossing(curve, "mean", 5e-7).time == pytest.approx(1e-4, rel=1e-12)
    assert crossing(curve, "position", 1e-6).status == "not reached"
    assert ns_per_evaluation(curve) == pytest.approx(1e3, rel=1e-12)


def test_untimed_point_is_not_part_of_curve():
    (curve,) = curves(made("one", [1e-3, 1e-6], [1e-5, 1e-4]))
    assert crossing(curve, "max", 1e-4, mode="lanes").status == "not reached"
    assert isnan(ns_per_evaluation(curve, "lanes"))


def test_chaos_gets_a_shorter_interval_for_positions_and_only_there():
    assert intervals(systems["henon_heiles"], "500") == {
        "henon_heiles": ("500", ("max", "mean")), "henon_heiles_position": ("20", ("position",)),
    }  # fmt: skip
    assert intervals(systems["henon_heiles"], "20") == {"henon_heiles": ("20", ("max", "mean", "position"))}
    assert intervals(systems["kepler"], "87660") == {"kepler": ("87660", ("max", "mean", "position"))}


def test_grid_visits_each_number_of_steps_once_from_coarse():
    here, taus = Interval(systems["sho"], "10"), tau_grid(1e-3, 10.0, 10)
    steps = measured(here, integrators["ruth"], taus, evaluations=1000, modes=()).columns["steps"].tolist()
    assert steps == sorted(set(steps))
    assert steps[0] == 1
    assert 3 * steps[-1] <= 1000 < 3 * steps[-1] * 10**0.15


#: Each coefficient is rounded by up to 1.1e-16 of itself, which shifts the phase at t = 20 by no more than twice that
#: part of t; sums are compensated.
PHASE = 20 * 2.2e-16


def test_errors_of_a_curve_are_those_of_the_matrix_power():
    tableau = integrators["aba864"]
    here = Interval(systems["sho"], "20", reference(systems["sho"], "20"))
    found = measure(here, [tableau], (0.05, 0.1)).isel(solver=0)
    assert (found.time_trajectory > 0).all()
    for i, steps in enumerate((29, 57)):
        q, _ = oscillator_state(tableau, mpf(20) / steps, steps)
        assert found.position_error[i].item() == pytest.approx(float(abs(q - cos(mpf(20)))), abs=PHASE)
        assert (found.steps[i], found.evaluations[i]) == (steps, 7 * steps)


@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_every_timed_call_returns_final_state_of_same_trajectory(summation):
    steps, ruth = 67, integrators["ruth"]
    calls = prepared_calls(systems["sho"], ruth, "20", steps, summation, ("trajectory", "energy", "lanes"))
    q, p = oscillator_state(ruth, mpf(20) / steps, steps)
    # Plain sums of numbers up to 1: three stages a step, each rounded by half a unit.
    bound = PHASE if summation == "compensated" else PHASE + 3 * steps * 2 * 1.2e-16
    for mode in ("trajectory", "energy") * 2:  # each call begins at the start
        found = calls[mode]()
        assert [part.shape for part in found] == [(1,), (1,)]
        assert [float(part[0]) for part in found] == pytest.approx([float(q), float(p)], abs=bound)
    for one, many in zip(calls["trajectory"](), calls["lanes"](), strict=True):
        assert many.shape == (members_of(systems["sho"], ruth, steps), 1, 1)
        assert set(many.ravel()) == {one[0]}


def test_an_ensemble_has_fewer_members_the_longer_they_run():
    members = [members_of(systems["sho"], integrators["ruth"], steps) for steps in (100, 20_000, 400_000)]
    assert members[0] == 2048  # the most
    assert members[1] == 2**25 // (3 * 20_000)
    assert members[2] == 64  # the fewest


def test_sums_are_plain_if_harmless_and_compensated_otherwise():
    """Plain sums of 1e5 steps err by some 1e-14; the method by 1e-3 in the coarse run, below 1e-15 in the fine one."""
    here, taus = Interval(systems["sho"], "20"), [20 / 7 / 6, 20 / 7 / 10_000]
    found = measured(here, integrators["aba864"], taus).columns
    coarse, fine = found["max_energy_error"]
    assert found["compensated"].tolist() == [0.0, 1.0]
    assert coarse > 1e-6
    assert fine < 1e-14
    plain = measured(here, integrators["aba864"], taus[1:], "plain").columns
    assert plain["compensated"].tolist() == [0.0]
    assert plain["max_energy_error"][0] > 1.05 * fine


def test_times_are_per_trajectory(monkeypatch):
    monkeypatch.setattr(engine, "interleaved", lambda calls, _: [[8.0, 16.0] for _ in calls])
    calls = dict.fromkeys([("trajectory", 0), ("lanes", 0), ("energy", 0)], lambda: None)
    solver = Solver(method="m", label="m", kind="splitting", columns={"members": [8]}, calls=calls)
    clock([solver], ("lanes", "trajectory"))
    assert solver.times == {("lanes", 0): [1.0, 2.0], ("trajectory", 0): [8.0, 16.0]}


def test_the_file_gives_back_what_was_measured(tmp_path):
    first = made("first", [1e-3, 1e-6, 1e-9], [1e-5, 1e-4, 1e-3], setup=1e-4)
    empty = Solver(method="absent", label="Absent", kind="peer", status="not installed")
    store.write(tmp_path / "times.h5", {}, {"problems": "{}"}, groups={"sho": variables([first, empty], "s")})
    group = store.read(tmp_path / "times.h5", "sho")
    back, absent = curves_of(group)
    assert (back.label, back.kind, back.setup) == (label("first"), "splitting", 1e-4)
    assert (absent.status, absent.sizes["point"]) == ("not installed", 0)
    assert back.max_energy_error.values.tolist() == [1e-3, 1e-6, 1e-9]
    assert back.time_trajectory.values.tolist() == [1e-5, 1e-4, 1e-3]
    assert group.repeats_trajectory.sel(solver="first").values.tolist() == [3, 3, 3]
    assert group.time_trajectory.sel(solver="first", quartile="median").values.tolist() == [2e-5, 2e-4, 2e-3]


def test_a_small_measurement_has_every_method_and_every_mode():
    sweep = Sweep(
        system="sho", t_end="5", lowest=0.05, highest=0.5, points_per_decade=4, precision=("double",),
        summation="compensated", samples=2, shards=1,
    )  # fmt: skip
    settings = WorkPrecisionSettings(points_per_decade=4, evaluations=200, peers=("numpy",), longest=1.0)
    here = Interval(systems["sho"], "5", reference(systems["sho"], "5"))
    ours, theirs, _ = curves(*solvers_on(here, ("max", "position"), [integrators["aba864"]], sweep, settings))
    assert ours.position_error[-1] < 1e-2
    assert all((ours[f"time_{mode}"] > 0).all() for mode in ("trajectory", "lanes", "energy"))
    assert ours.members.values.tolist() == [2048] * ours.sizes["point"]
    assert (theirs.time_trajectory.notnull() == np.isfinite(theirs.max_energy_error)).all()
    assert theirs.time_lanes.isnull().all()
    for steps, error in zip(ours.steps.values, ours.max_energy_error.values, strict=True):
        # The same method at the same step: plain numpy adds no more than rounding.
        twins = theirs.max_energy_error.values[theirs.steps.values == steps]
        assert twins == pytest.approx(np.full(twins.size, error), rel=1e-6, abs=1e-13)


def test_fractions_of_the_interval_are_compared_as_numbers():
    assert len(intervals(systems["sho"], "20.0")) == 1
    assert Fraction(position_t_end(systems["henon_heiles"], "9")) == 9
    assert mpmath.mp.dps == 60  # no computation here leaves another precision behind
