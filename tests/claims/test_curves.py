"""Ranges of step sizes and slopes, on curves of which they are known."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.stats import spearmanr

from nearharmonic.claims.claim import combined, counted
from nearharmonic.claims.curves import Curves, Range, for_larger_steps, orders, over, rank_correlation, slope
from nearharmonic.claims.results import Undecided

X = np.geomspace(1e-4, 1, 161)  # forty a decade


def curves(**errors):
    """Curves of the errors given as functions of the step size, with a floor of 1e-16."""
    rows = [np.maximum(error(X), 1e-16) for error in errors.values()]
    dims = ("integrator", "tau_per_stage")
    tau = np.tile(3 * X, (len(rows), 1))
    cube = xr.Dataset(
        {"max_energy_error": (dims, rows), "tau": (dims, tau)}, coords={"integrator": list(errors), "tau_per_stage": X}
    )
    return Curves(cube)


def test_the_range_starts_above_rounding_and_ends_at_one_percent():
    found = curves(fourth=lambda x: x**4, sixth=lambda x: 100 * x**6)
    asked = found.compared(found.errors(["fourth", "sixth"]))
    # The sixth is 100 roundings, 1.11e-14, at 2.19e-3; the fourth is 1 % at 0.316, and the sixth at 0.215.
    start, end = (1.11e-16) ** (1 / 6), 1e-4 ** (1 / 6)
    assert X[asked.asked].min() == pytest.approx(start, rel=0.06)
    assert X[asked.asked].max() == pytest.approx(end, rel=0.06)
    assert X[asked.asked].min() > start
    assert X[asked.asked].max() < end
    kept = found.compared(found.errors(["fourth", "sixth"]), kept=found.errors(["fourth"]))
    assert X[kept.asked].max() == pytest.approx(0.01 ** (1 / 4), rel=0.06)


def test_a_spike_above_the_limit_ends_the_range_there():
    found = curves(spiked=lambda x: np.where((x > 0.0099) & (x < 0.0107), 1.0, x**4))
    asked = found.compared(found.errors(["spiked"]))
    assert X[asked.asked].max() < 0.01


def test_runs_that_diverged_or_were_not_made_end_the_range():
    found = curves(fourth=lambda x: np.where(x > 0.05, np.inf, x**4))
    assert X[found.compared(found.errors(["fourth"])).asked].max() <= 0.05
    found = curves(fourth=lambda x: np.where(x > 0.05, np.nan, x**4))
    assert X[found.compared(found.errors(["fourth"])).asked].max() <= 0.05


def test_a_statement_holds_in_part_over_half_a_decade_in_one_piece_and_no_less():
    everywhere = Range(X, np.ones(X.size, dtype=bool), " h")
    assert over(everywhere, X > 0).verdict == "holds"
    assert over(everywhere, X > 0).value == "τ/s = 0.0001 to 1 h, all 161 step sizes"
    half = (X > 0.0099) & (X < 0.033)
    assert over(everywhere, half).verdict == "holds in part"
    assert over(everywhere, half).value.startswith("τ/s = 0.01 to 0.0316 h, in one piece; 21 of 161")
    assert over(everywhere, half & (X < 0.031)).verdict == "fails"
    assert over(everywhere, half & ((X < 0.019) | (X > 0.021))).verdict == "fails"
    assert over(everywhere, X < 0).verdict == "fails"


def test_a_statement_about_larger_steps_holds_over_half_a_decade_to_the_end_of_the_range():
    everywhere = Range(X, np.ones(X.size, dtype=bool), " h")
    assert for_larger_steps(everywhere, X > 0) == ("holds", "at all of τ/s = 0.0001 to 1 h")
    assert for_larger_steps(everywhere, X > 0.3) == ("holds", "from τ/s = 0.316 on, of τ/s = 0.0001 to 1 h")
    assert for_larger_steps(everywhere, X > 0.32).verdict == "fails"
    assert for_larger_steps(everywhere, X < 0.99).verdict == "holds in part"
    assert for_larger_steps(everywhere, X < 0).verdict == "fails"
    assert everywhere.at_the_end(X > 0.9) == (pytest.approx(10 ** (-1 / 40)), 1.0)
    assert everywhere.at_the_end(X < 0.9) == (1.0, 0.0)


def test_what_lies_outside_the_range_does_not_count():
    asked = (X > 0.01) & (X < 0.5)
    assert over(Range(X, asked, ""), asked).verdict == "holds"


def test_a_slope_is_that_of_the_power_law_above_its_floor_and_the_interval_that_of_a_straight_line():
    found = slope(curves(fourth=lambda x: 7 * x**4), "fourth")
    assert found.value == pytest.approx(4, abs=1e-10)
    assert found.interval < 1e-10
    assert found.low > (1.11e-14 / 7) ** 0.25
    # Twenty points, forty a decade.
    assert found.high / found.low == pytest.approx(10 ** (19 / 40))


def test_the_interval_of_a_slope_covers_its_scatter():
    rng = np.random.default_rng(3)
    misses = 0
    for _ in range(200):
        noise = np.exp(0.05 * rng.standard_normal(X.size))
        found = slope(curves(fourth=lambda x, noise=noise: x**4 * noise), "fourth")
        misses += abs(found.value - 4) > found.interval
    # 95 % intervals miss 10 of 200; more than 20 would happen once in 700 times.
    assert 2 <= misses <= 20


@pytest.mark.parametrize(("power", "verdict"), [(4.0, "holds"), (4.09, "holds"), (4.11, "fails"), (3.8, "fails")])
def test_an_order_is_confirmed_within_a_tenth(power, verdict):
    assert orders(curves(one=lambda x: x**power), {"one": 4}).verdict == verdict


def test_a_curve_that_is_all_rounding_has_no_slope():
    with pytest.raises(Undecided, match="between rounding and an error of 1e-4"):
        slope(curves(one=lambda x: 0 * x), "one")


@pytest.mark.parametrize(
    ("good", "verdict"), [([True, True], "holds"), ([True, False], "holds in part"), ([False, False], "fails")]
)
def test_several_things_hold_in_part_if_some_do(good, verdict):
    assert counted(good, "").verdict == verdict


@pytest.mark.parametrize(
    ("parts", "verdict"),
    [
        (["holds", "holds"], "holds"),
        (["fails", "fails"], "fails"),
        (["holds", "fails"], "holds in part"),
        (["fails", "holds in part"], "holds in part"),
    ],
)
def test_a_statement_of_parts_holds_or_fails_if_all_of_them_do(parts, verdict):
    assert combined(parts, "").verdict == verdict


@pytest.mark.parametrize("values", [4, 1000])  # with many ties, and with few
def test_rank_correlations_are_those_of_scipy(values):
    one, other = np.random.default_rng(3).integers(0, values, (2, 40, 6)).astype(float)
    other[0, 0] = np.inf
    expected = [spearmanr(one[:, i], other[:, i]).statistic for i in range(6)]
    assert rank_correlation(one, other) == pytest.approx(expected, abs=1e-14)  # sums of integers, but for one quotient


def test_what_has_no_order_has_no_correlation():
    assert rank_correlation(np.ones((5, 1)), np.arange(5.0)[:, None]) == 0
