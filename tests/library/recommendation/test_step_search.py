"""The search for the fewest steps that meet an error, on error curves whose answer is known without it."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, inf, nan

import pytest

from nearharmonic.recommendation.measure import MARGIN, fewest_for_good, fewest_steps, ladder, measured_errors

MOST = 20_000
NO_FLOOR = 0.0


def search(error_of, bound, floor=NO_FLOOR, most=MOST):
    """(fewest steps, errors measured) for the curve ``error_of``, a function of the number of steps."""
    errors = measured_errors(lambda steps: [error_of(n) for n in steps], ladder(most), bound, floor)
    return fewest_for_good(errors, bound), errors


@pytest.mark.parametrize("bound", [3.0, 1e-2, 1e-5, 1e-9, 1e-13])
def test_power_law_crosses_within_half_percent_of_formula(bound):
    exact = ceil((3.0 / bound) ** 0.25)  # 3 n^-4 <= bound
    fewest, _ = search(lambda n: 3.0 * n**-4, bound)
    assert exact <= fewest <= exact * (1 + 1 / 200) + 1


@pytest.mark.parametrize("spike", [19, 30, MARGIN * 18])
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
    near = [steps for steps in ladder(MOST) if fewest <= steps <= MARGIN * fewest]
    assert len(near) > 15
    assert set(near) <= set(errors)


def test_what_no_number_of_steps_meets_has_no_answer():
    for error_of in (lambda n: 1.0, lambda n: inf, lambda n: nan):
        assert search(error_of, 1e-3)[0] is None
    assert search(lambda n: n**-2, (MOST + 1) ** -2)[0] is None


def test_an_error_that_is_no_number_meets_nothing():
    assert fewest_for_good({1: 0.0, 2: nan, 3: 0.0}, 1.0) == 3
    assert fewest_for_good({1: 0.0, 2: nan}, 1.0) is None
    assert fewest_for_good({}, 1.0) is None
    assert fewest_for_good({1: 2.0, 2: 1.0, 3: 0.5}, 1.0) == 2  # the bound itself is met


def test_doubling_and_halving_find_the_fewest_steps():
    for threshold in (1, 2, 3, 17, 100, 997):
        tried = []
        found = fewest_steps(lambda n, t=threshold, seen=tried: seen.append(n) or n >= t, 1, 1000)
        assert threshold <= found <= threshold + max(1, threshold // 19)
        assert len(tried) < 20
    assert fewest_steps(lambda n: False, 1, 1000) is None
    assert fewest_steps(lambda n: True, 7, 5) is None


def test_no_step_is_run_far_below_the_rounding_floor():
    _, errors = search(lambda n: max(n**-4, 1e-8), 1e-4, floor=1e-8)  # the floor begins at 100 steps
    assert max(errors) < MOST / 10
    _, errors = search(lambda n: max(n**-4, 1e-8), 1e-12, floor=1e-8)  # it is no floor for who asks for less
    assert max(errors) > MOST / 2


def test_ladder_has_all_cheap_step_counts_then_fixed_ratios():
    rungs = ladder(MOST)
    # n (n / MOST)^(1/2) / 24 < 2 up to n = (48 MOST^(1/2))^(2/3) = 358.
    assert rungs[:358] == list(range(1, 359))
    gaps = [b / a - 1 for a, b in pairwise(rungs[358:])]
    assert max(gaps) <= 1 / 24
    assert gaps[-1] > 1 / 30
    assert MOST / (1 + 1 / 24) < rungs[-1] <= MOST
