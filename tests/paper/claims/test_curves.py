"""Ranges of step sizes and slopes, for curves with known values."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.stats import spearmanr

from nearharmonic_paper.claims.claim import combined, counted
from nearharmonic_paper.claims.judging import Curves, Range, for_larger_steps, over, rank_correlation

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


def test_the_longest_piece_is_that_of_the_largest_ratio():
    x = np.array([1.0, 4.0, 5.0, 6.0, 16.0])  # a factor of four, and of 2.7 in a longer piece
    assert Range(x, x > 0, "").longest(x != 5) == (1.0, 4.0), "longest piece"


def test_statement_holds_in_part_over_half_decade_in_one_piece():
    everywhere = Range(X, np.ones(X.size, dtype=bool), " h")
    assert over(everywhere, X > 0).verdict == "holds"
    assert over(everywhere, X > 0).value == "τ/s = 0.0001 to 1 h, all 161 step sizes"
    half = (X > 0.0099) & (X < 0.033)
    assert over(everywhere, half).verdict == "holds in part"
    assert over(everywhere, half).value.startswith("τ/s = 0.01 to 0.0316 h, in one piece; 21 of 161")
    assert over(everywhere, half & (X < 0.031)).verdict == "fails"
    assert over(everywhere, half & ((X < 0.019) | (X > 0.021))).verdict == "fails"
    assert over(everywhere, X < 0).verdict == "fails"


def test_statement_holds_but_for_edges_at_19_of_20_sizes():
    hundred = Range(X, np.arange(X.size) < 100, "")
    for missing, verdict in (
        (range(5), "holds but for edges"),
        (range(6), "holds in part"),  # 94 of 100
        ((0, 9, 90, 99), "holds but for edges"),  # among the first and the last tenth
        ((10,), "holds in part"),  # the eleventh
        ((89,), "holds in part"),
    ):
        assert over(hundred, ~np.isin(np.arange(X.size), missing)).verdict == verdict, missing


def test_statement_on_larger_steps_holds_over_half_decade_to_end():
    everywhere = Range(X, np.ones(X.size, dtype=bool), " h")
    assert for_larger_steps(everywhere, X > 0)[:2] == ("holds", "at all step sizes of τ/s = 0.0001 to 1 h")
    assert for_larger_steps(everywhere, X > 0.3)[:2] == ("holds", "from τ/s = 0.316 h on, of τ/s = 0.0001 to 1 h")
    assert for_larger_steps(everywhere, X > 0.32).verdict == "fails"
    assert for_larger_steps(everywhere, X < 0.99).verdict == "holds in part"
    assert for_larger_steps(everywhere, X < 0).verdict == "fails"
    assert everywhere.at_the_end(X > 0.9) == (pytest.approx(10 ** (-1 / 40)), 1.0)
    assert everywhere.at_the_end(X < 0.9) == (1.0, 0.0)


def test_what_lies_outside_the_range_does_not_count():
    asked = (X > 0.01) & (X < 0.5)
    assert over(Range(X, asked, ""), asked).verdict == "holds"


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
        (["holds", "holds but for edges"], "holds but for edges"),
        (["holds but for edges", "fails"], "holds in part"),
    ],
)
def test_statement_of_parts_holds_or_fails_with_all_of_them(parts, verdict):
    assert combined(parts, "").verdict == verdict


@pytest.mark.parametrize("values", [4, 1000])  # with many ties, and with few
def test_rank_correlations_are_those_of_scipy(values):
    one, other = np.random.default_rng(3).integers(0, values, (2, 40, 6)).astype(float)
    other[0, 0] = np.inf
    expected = [spearmanr(one[:, i], other[:, i]).statistic for i in range(6)]
    assert rank_correlation(one, other) == pytest.approx(expected, abs=1e-14)  # sums of integers, but for one quotient


def test_what_has_no_order_has_no_correlation():
    assert rank_correlation(np.ones((5, 1)), np.arange(5.0)[:, None]) == 0
