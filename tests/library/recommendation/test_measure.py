"""The measuring engine: errors and calls of curves, where they cross a target, and searches for the fewest steps."""

from itertools import pairwise
from math import ceil, inf, nan

import numpy as np
import pytest
from mpmath import cos, mpf

import nearharmonic as nh
from nearharmonic.engine.reference import reference
from nearharmonic.engine.settings import tau_grid
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.recommendation import measure as engine
from nearharmonic.systems import systems
from support.cubes.figure_cubes import curves, label, timed
from support.oracles.reference_solutions import oscillator_state


def power_law(order=4, constant=3.0, points=9):
    """Errors constant * tau^order at tau = 1, 1/2, 1/4, ...; cost 1/tau: every crossing has a closed form."""
    taus = [2.0**-i for i in range(points)]
    return [constant * tau**order for tau in taus], [1 / tau for tau in taus]


@pytest.mark.parametrize("target", [1e-1, 1e-3, 1e-6])
def test_a_power_law_is_crossed_where_its_formula_says(target):
    errors, costs = power_law()
    status, (cost,) = engine.cross(errors, [costs], target)
    assert status == "reached"
    # Straight lines through logarithms are exact on a power law, up to rounding of log and exp.
    assert cost == pytest.approx((3.0 / target) ** 0.25, rel=1e-13)


@pytest.mark.parametrize(
    ("errors", "costs", "target", "status", "cost"),
    [
        ([1e-2, 1e-4, 1e-6], [1, 2, 4], 1e-4, "reached", 2),  # a point meets it exactly
        ([1e-9, 1e-2, 1e-4, 1e-6], [1, 2, 4, 8], 1e-4, "reached", 4),  # a lucky coarse step does not count
        ([1e-2, 1e-12, 1e-11], [1, 2, 4], 1e-12, "reached", 2),  # rounding lifts the curve again
        ([1e-4, 1e-6], [1, 2], 1e-3, "below throughout", 1),  # an upper bound
        ([inf, 1e-7], [1, 2], 1e-6, "reached", 2),  # no line is drawn from a run that failed
        ([1e-2, 0.0], [1, 2], 1e-12, "reached", 2),
        ([1e-2, 1e-3], [1, 1], 1e-6, "not reached", nan),
        ([inf, inf], [1, 1], 1e-6, "not reached", nan),
        ([nan], [1], 1e-6, "not reached", nan),
        ([], [], 1e-6, "not reached", nan),
    ],
)
def test_a_curve_crosses_where_finer_settings_bear_it_out(errors, costs, target, status, cost):
    found, (at,) = engine.cross(errors, [costs], target)
    assert (found, at) == (status, pytest.approx(cost, rel=1e-12, nan_ok=True))


def test_a_finer_setting_that_costs_less_is_taken():
    assert engine.cross([1e-2, 1e-4, 1e-8], [[5.0, 4.0, 1.0], [50.0, 40.0, 10.0]], 1e-3)[1] == (1.0, 10.0)


def test_errors_for_good_never_rise_and_end_at_the_least():
    assert engine.for_good([1.0, 1e-5, 1e-2, nan, 1e-6, 5e-5]) == [inf, inf, inf, inf, 1e-6]


def made(method, errors, times, kind="splitting", **more):
    """A curve whose point i has the error errors[i], taken in times[i] seconds by 1000 times as many evaluations."""
    solver = timed(method, errors, times, kind, **more)
    solver.columns["evaluations"] = 1e6 * np.array(times)
    return solver


def test_ranking_goes_by_time_and_ends_with_those_that_fail():
    slow = made("slow", [1e-2, 1e-9], [1e-3, 1e-2])
    fast = made("fast", [1e-2, 1e-9], [1e-5, 1e-4])
    never = made("never", [1e-2, 1e-3], [1e-6, 1e-5])
    order = [curve.solver.item() for curve, _ in engine.ranking(curves(never, slow, fast), "max", 1e-6)]
    assert order == ["fast", "slow", "never"]


def test_each_measure_reads_its_own_error_and_the_least_time():
    (curve,) = curves(made("one", [1e-3, 1e-6], [1e-5, 1e-4]))
    assert engine.crossing(curve, "max", 1e-6).time == pytest.approx(1e-4, rel=1e-12)
    assert engine.crossing(curve, "mean", 5e-7).time == pytest.approx(1e-4, rel=1e-12)
    assert engine.crossing(curve, "position", 1e-6).status == "not reached"


def test_untimed_point_is_not_part_of_curve():
    (curve,) = curves(made("one", [1e-3, 1e-6], [1e-5, 1e-4]))
    assert engine.crossing(curve, "max", 1e-4, mode="lanes").status == "not reached"


def test_grid_visits_each_number_of_steps_once_from_coarse():
    here, taus = engine.Interval(systems["sho"], "10"), tau_grid(1e-3, 10.0, 10)
    steps = engine.measured(here, integrators["ruth"], taus, evaluations=1000, modes=()).columns["steps"].tolist()
    assert steps == sorted(set(steps))
    assert steps[0] == 1
    assert 3 * steps[-1] <= 1000 < 3 * steps[-1] * 10**0.15


#: Each coefficient is rounded by up to 1.1e-16 of itself, which shifts the phase at t = 20 by no more than twice that
#: part of t; sums are compensated.
PHASE = 20 * 2.2e-16


def test_errors_of_a_curve_are_those_of_the_matrix_power():
    tableau = integrators["aba864"]
    here = engine.Interval(systems["sho"], "20", reference(systems["sho"], "20"))
    found = engine.measure(here, [tableau], (0.05, 0.1)).isel(solver=0)
    assert (found.time_trajectory > 0).all()
    for i, steps in enumerate((29, 57)):
        q, _ = oscillator_state(tableau, mpf(20) / steps, steps)
        assert found.position_error[i].item() == pytest.approx(float(abs(q - cos(mpf(20)))), abs=PHASE)
        assert (found.steps[i], found.evaluations[i]) == (steps, 7 * steps)


@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_every_timed_call_returns_final_state_of_same_trajectory(summation):
    steps, ruth = 67, integrators["ruth"]
    calls = {mode: engine.prepared_call(systems["sho"], ruth, "20", steps, summation, mode) for mode in engine.MODES}
    q, p = oscillator_state(ruth, mpf(20) / steps, steps)
    # Plain sums of numbers up to 1: three stages a step, each rounded by half a unit.
    bound = PHASE if summation == "compensated" else PHASE + 3 * steps * 2 * 1.2e-16
    for mode in ("trajectory", "energy") * 2:  # each call begins at the start
        found = calls[mode]()
        assert [part.shape for part in found] == [(1,), (1,)]
        assert [float(part[0]) for part in found] == pytest.approx([float(q), float(p)], abs=bound)
    for one, many in zip(calls["trajectory"](), calls["lanes"](), strict=True):
        assert many.shape == (engine.members_of(systems["sho"], ruth, steps), 1, 1)
        assert set(many.ravel()) == {one[0]}


def test_an_ensemble_has_fewer_members_the_longer_they_run():
    members = [engine.members_of(systems["sho"], integrators["ruth"], steps) for steps in (100, 20_000, 400_000)]
    assert members[0] == 2048  # the most
    assert members[1] == 2**25 // (3 * 20_000)
    assert members[2] == 64  # the fewest


def test_sums_are_plain_if_harmless_and_compensated_otherwise():
    """Plain sums of 1e5 steps err by some 1e-14; the method by 1e-3 in the coarse run, below 1e-15 in the fine one."""
    here, taus = engine.Interval(systems["sho"], "20"), [20 / 7 / 6, 20 / 7 / 10_000]
    found = engine.measured(here, integrators["aba864"], taus).columns
    coarse, fine = found["max_energy_error"]
    assert found["compensated"].tolist() == [0.0, 1.0]
    assert coarse > 1e-6
    assert fine < 1e-14
    plain = engine.measured(here, integrators["aba864"], taus[1:], "plain").columns
    assert plain["compensated"].tolist() == [0.0]
    assert plain["max_energy_error"][0] > 1.05 * fine


def test_times_are_per_trajectory(monkeypatch):
    monkeypatch.setattr(engine, "interleaved", lambda calls, _: [[8.0, 16.0] for _ in calls])
    calls = dict.fromkeys([("trajectory", 0), ("lanes", 0), ("energy", 0)], lambda: None)
    solver = engine.Solver(method="m", label="m", kind="splitting", columns={"members": [8]}, calls=calls)
    engine.clock([solver], ("lanes", "trajectory"))
    assert solver.times == {("lanes", 0): [1.0, 2.0], ("trajectory", 0): [8.0, 16.0]}


def test_the_file_gives_back_what_was_measured(tmp_path):
    first = made("first", [1e-3, 1e-6, 1e-9], [1e-5, 1e-4, 1e-3], setup=1e-4)
    empty = engine.Solver(method="absent", label="Absent", kind="peer", status="not installed")
    store.write(tmp_path / "times.h5", {}, {"problems": "{}"}, groups={"sho": engine.variables([first, empty], "s")})
    group = store.read(tmp_path / "times.h5", "sho")
    back, absent = engine.curves_of(group)
    assert (back.label, back.kind, back.setup) == (label("first"), "splitting", 1e-4)
    assert (absent.status, absent.sizes["point"]) == ("not installed", 0)
    assert back.max_energy_error.values.tolist() == [1e-3, 1e-6, 1e-9]
    assert back.time_trajectory.values.tolist() == [1e-5, 1e-4, 1e-3]
    assert group.repeats_trajectory.sel(solver="first").values.tolist() == [3, 3, 3]
    assert group.time_trajectory.sel(solver="first", quartile="median").values.tolist() == [2e-5, 2e-4, 2e-3]


MOST = 20_000
NO_FLOOR = 0.0


def search(error_of, bound, floor=NO_FLOOR, most=MOST):
    """(fewest steps, errors measured) for the curve ``error_of``, a function of the number of steps."""
    errors = engine.measured_errors(lambda steps: [error_of(n) for n in steps], engine.ladder(most), bound, floor)
    return engine.fewest_for_good(errors, bound), errors


@pytest.mark.parametrize("bound", [3.0, 1e-2, 1e-5, 1e-9, 1e-13])
def test_power_law_crosses_within_half_percent_of_formula(bound):
    exact = ceil((3.0 / bound) ** 0.25)  # 3 n^-4 <= bound
    fewest, _ = search(lambda n: 3.0 * n**-4, bound)
    assert exact <= fewest <= exact * (1 + 1 / 200) + 1


@pytest.mark.parametrize("spike", [19, 30, engine.MARGIN * 18])
def test_search_sees_resonance_down_to_half_the_step(spike):
    fewest, _ = search(lambda n: 1.0 if n == spike else 3.0 * n**-2, 1e-2)  # the power law meets it from 18 on
    assert fewest == spike + 1


@pytest.mark.parametrize("centre", [50, 200, 1000, 5000, 10000])
def test_a_resonance_of_thirty_percent_is_seen_wherever_it_lies(centre):
    fewest, _ = search(lambda n: 1.0 if centre <= n <= 1.3 * centre else 3.0 * n**-2, 1e-2)
    assert 1.3 * centre < fewest <= 1.3 * centre * (1 + 1 / 200) + 1


@pytest.mark.parametrize("spike", [501, 533, 578])
def test_search_sees_resonance_of_single_step_size_near_step(spike):
    # The power law meets the bound from 500 on; rungs lie 3 apart there, and MOST / 500 = 40 times four runs are made.
    fewest, _ = search(lambda n: 1.0 if n == spike else 2500.0 * n**-2, 1e-2)
    assert fewest == spike + 1


@pytest.mark.parametrize("ripple", [1, 3, 8])
def test_a_ripple_right_behind_the_edge_is_seen(ripple):
    # The power law alone meets the bound from 10 000 steps on, where rungs lie 300 apart.
    def rippled(n):
        return 1.0 if n % 9 == ripple and n < 10_100 else 1e6 * n**-2

    fewest, errors = search(rippled, 1e-2)
    assert all(rippled(n) <= 1e-2 for n in range(fewest, fewest + 9))
    assert all(n in errors for n in range(fewest, fewest + 9))


def test_lucky_coarse_steps_do_not_count():
    fewest, _ = search(lambda n: 0.0 if n < 40 else 1e4 * n**-2, 1e-2)
    assert fewest == 1000


@pytest.mark.parametrize("bound", [1e-4, 1e-7])
def test_finer_runs_meet_error_and_all_near_ones_were_made(bound):
    def ragged(n):
        return (5.0 if n % 7 == 0 else 1.0) * n**-2

    fewest, errors = search(ragged, bound)
    assert all(error <= bound for steps, error in errors.items() if steps >= fewest)
    near = [steps for steps in engine.ladder(MOST) if fewest <= steps <= engine.MARGIN * fewest]
    assert len(near) > 15
    assert set(near) <= set(errors)


def test_what_no_number_of_steps_meets_has_no_answer():
    for error_of in (lambda n: 1.0, lambda n: inf, lambda n: nan):
        assert search(error_of, 1e-3)[0] is None
    assert search(lambda n: n**-2, (MOST + 1) ** -2)[0] is None


def test_an_error_that_is_no_number_meets_nothing():
    assert engine.fewest_for_good({1: 0.0, 2: nan, 3: 0.0}, 1.0) == 3
    assert engine.fewest_for_good({1: 0.0, 2: nan}, 1.0) is None
    assert engine.fewest_for_good({}, 1.0) is None
    assert engine.fewest_for_good({1: 2.0, 2: 1.0, 3: 0.5}, 1.0) == 2  # the bound itself is met


def test_doubling_and_halving_find_the_fewest_steps():
    for threshold in (1, 2, 3, 17, 100, 997):
        tried = []
        found = engine.fewest_steps(lambda n, t=threshold, seen=tried: seen.append(n) or n >= t, 1, 1000)
        assert threshold <= found <= threshold + max(1, threshold // 19)
        assert len(tried) < 20
    assert engine.fewest_steps(lambda n: False, 1, 1000) is None
    assert engine.fewest_steps(lambda n: True, 7, 5) is None


def test_no_step_is_run_far_below_the_rounding_floor():
    _, errors = search(lambda n: max(n**-4, 1e-8), 1e-4, floor=1e-8)  # the floor begins at 100 steps
    assert max(errors) < MOST / 10
    _, errors = search(lambda n: max(n**-4, 1e-8), 1e-12, floor=1e-8)  # it is no floor for who asks for less
    assert max(errors) > MOST / 2


def test_ladder_has_all_cheap_step_counts_then_fixed_ratios():
    rungs = engine.ladder(MOST)
    # n (n / MOST)^(1/2) / 24 < 2 up to n = (48 MOST^(1/2))^(2/3) = 358.
    assert rungs[:358] == list(range(1, 359))
    gaps = [b / a - 1 for a, b in pairwise(rungs[358:])]
    assert max(gaps) <= 1 / 24
    assert gaps[-1] > 1 / 30
    assert MOST / (1 + 1 / 24) < rungs[-1] <= MOST


def test_costs_between_two_points_are_those_of_the_power_law():
    """Costs grow as the fourth root of 1/error: from 1 at 1e-2 to 100 at 1e-10, hence to 10 at 1e-6."""
    for target, cost in ((1e-6, 10), (1e-8, 10**1.5), (1e-3, 10**0.25)):
        status, (found, tau) = engine.cross([1e-2, 1e-10], [[1, 100], [1, 0.01]], target)
        assert (status, found, tau) == ("reached", pytest.approx(cost, rel=1e-14), pytest.approx(1 / cost, rel=1e-14))


@pytest.mark.slow
def test_final_position_is_found_after_fewer_samples_than_others():
    system, tableau = systems["henon_heiles"], nh.integrators["rowlands"]
    exact = reference(system, "20")
    interval = engine.Interval(system, "20", exact)
    found = engine.measure(interval, [tableau], np.geomspace(0.005, 0.5, 5), modes=()).isel(solver=0)
    assert found.sizes["point"] == 5
    for i in range(5):
        point = found.isel(point=i)
        way = "compensated" if point.compensated else "plain"
        run = nh.integrate("henon_heiles", tableau, point.tau.item(), t_end=20, summation=way)
        low = run.q_low.values[-1] if way == "compensated" else np.zeros(2)
        assert point.position_error == exact.error(run.q.values[-1], low)
        assert point.max_energy_error == run.max_energy_error
