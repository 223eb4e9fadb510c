"""Judging of statements: ranges of step sizes, slopes, margins, and statements on trained methods."""

import numpy as np
import pytest
import xarray as xr
from scipy.stats import spearmanr

from nearharmonic.integrators import plain_integrators as integrators
from nearharmonic_paper.claims.claim import Undecided, combined, counted, margin
from nearharmonic_paper.claims.equations import picked_among_thousands
from nearharmonic_paper.claims.judging import (
    BAND,
    LONG,
    SHORT,
    Curves,
    Range,
    for_larger_steps,
    large_steps,
    local_slopes,
    orders,
    over,
    rank_correlation,
)
from nearharmonic_paper.claims.performance import best_performance, high_order_negative
from nearharmonic_paper.claims.tableaus import ENSEMBLES, FEWEST_METHODS, RELATED, minimised_coefficients
from support.results.recorded_results import held_results

# --- ranges of step sizes and slopes, for curves with known values ----------------------------------------------------


X = np.geomspace(1e-4, 1, 161)  # forty a decade


def curves(**errors):
    """Return curves of errors, given as functions of the step size, with a floor of 1e-16."""
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


def test_the_longest_piece_has_the_largest_ratio():
    x = np.array([1.0, 4.0, 5.0, 6.0, 16.0])  # a factor of four, and of 2.7 in a longer piece
    assert Range(x, x > 0, "").longest(x != 5) == (1.0, 4.0), "longest piece"


def test_statement_holds_in_part_over_half_decade_in_one_piece():
    everywhere = Range(X, np.ones(X.size, dtype=bool), " h")
    assert over(everywhere, X > 0).verdict == "holds"
    assert over(everywhere, X > 0).value == "true at all 161 step sizes of τ/s = 0.0001 to 1 h"
    half = (X > 0.0099) & (X < 0.033)
    assert over(everywhere, half).verdict == "holds in part"
    assert over(everywhere, half).value.startswith("true at every step size of τ/s = 0.01 to 0.0316 h; in total at 21 ")
    assert over(everywhere, half & (X < 0.031)).verdict == "fails"
    assert over(everywhere, half & ((X < 0.019) | (X > 0.021))).verdict == "fails"
    assert over(everywhere, X < 0)[:2] == ("fails", "true at 0 of 161 step sizes of τ/s = 0.0001 to 1 h")


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
    assert for_larger_steps(everywhere, X > 0.3).value == "from τ/s = 0.316 h to the end of τ/s = 0.0001 to 1 h"
    assert for_larger_steps(everywhere, X > 0.32)[:2] == ("fails", "at 20 of 161 step sizes")
    assert for_larger_steps(everywhere, X < 0.99).value.startswith("for τ/s = 0.0001 to 0.944 h, but not at the end")
    assert for_larger_steps(everywhere, X < 0).verdict == "fails"
    assert everywhere.at_the_end(X > 0.9) == (pytest.approx(10 ** (-1 / 40)), 1.0)
    assert everywhere.at_the_end(X < 0.9) == (1.0, 0.0)


def test_step_sizes_outside_the_range_do_not_count():
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
        (["holds", "holds"], "holds"), (["fails", "fails"], "fails"), (["holds", "fails"], "holds in part"),
        (["fails", "holds in part"], "holds in part"), (["holds", "holds but for edges"], "holds but for edges"),
        (["holds but for edges", "fails"], "holds in part"),
    ],
)  # fmt: skip
def test_statement_of_parts_holds_or_fails_with_all_of_them(parts, verdict):
    assert combined(parts, "").verdict == verdict


@pytest.mark.parametrize("values", [4, 1000])  # with many ties, and with few
def test_rank_correlations_agree_with_scipy(values):
    one, other = np.random.default_rng(3).integers(0, values, (2, 40, 6)).astype(float)
    other[0, 0] = np.inf
    expected = [spearmanr(one[:, i], other[:, i]).statistic for i in range(6)]
    assert rank_correlation(one, other) == pytest.approx(expected, abs=1e-14)  # sums of integers, but for one quotient


def test_equal_values_have_no_rank_correlation():
    assert rank_correlation(np.ones((5, 1)), np.arange(5.0)[:, None]) == 0


# --- local slopes and the lengths of their ranges, for curves with known values ---------------------------------------


def curve(error):
    """Return a curve of an error, given as a function of the step size."""
    return curves(one=error)


def pieces(*powers):
    """Return an error that is 1e-6 at 0.01 and a power of the step size in each piece: (log10 of its start, power)."""

    def error(x):
        log, found = np.log10(x), np.zeros(x.size)
        for (low, power), (high, _) in zip(powers, (*powers[1:], (np.inf, 0)), strict=True):
            found += power * (np.clip(log, low, high) - np.clip(-2.0, low, high))
        return 1e-6 * 10**found

    return error


def test_the_local_slope_of_a_power_law_is_its_power():
    found = local_slopes(curve(lambda x: 7 * x**4), "one")
    inside = (X > 1e-3) & (X < 0.9)
    assert found[inside] == pytest.approx(4, abs=1e-9)


def test_the_local_slope_is_fitted_to_five_step_sizes():
    error = lambda x: x**4 * np.where(abs(x - X[80]) < 1e-9, np.e, 1)  # noqa: E731
    found = local_slopes(curve(error), "one")
    near = np.arange(161)[np.abs(found - 4) > 1e-6]
    assert near.tolist() == [78, 79, 81, 82]  # at the point itself it is even
    # Least squares over the places -2 ... 2 of a fortieth of a decade: weight k/10 of a unit of ln(e).
    assert found[78] - 4 == pytest.approx(0.2 * 40 / np.log(10))


def test_ten_step_sizes_per_decade_decide_no_order():
    """Neighbours are a tenth of a decade apart, so each step size is alone in its window for any error."""
    few = Curves(curve(lambda x: 7 * x**4).cube.isel(tau_per_stage=slice(None, None, 4)))
    with pytest.raises(Undecided, match=r"fewer than three step sizes in 0\.1 decades"):
        orders(few, {"one": 4}, BAND)


def test_step_sizes_near_a_gap_have_no_slope():
    found = local_slopes(curve(lambda x: np.where(abs(x - X[80]) < 1e-9, np.inf, x**4)), "one")
    assert np.isnan(found[78:83]).all()
    assert np.isfinite(found[[77, 83]]).all()


@pytest.mark.parametrize(("off", "verdict"), [(-0.51, "fails"), (-0.49, "holds"), (0.49, "holds"), (0.51, "fails")])
def test_a_slope_keeps_to_an_order_within_the_band(off, verdict):
    assert orders(curve(lambda x: x ** (4 + off)), {"one": 4}, BAND).verdict == verdict


@pytest.mark.parametrize(
    ("decades", "verdict"),
    [(LONG + 0.1, "holds"), (LONG, "holds in part"), (SHORT + 0.1, "holds in part"), (SHORT, "fails")],
)
def test_the_length_of_the_range_decides(decades, verdict):
    """Slope 6 between slopes of 4 and 9: windows at both ends have two slopes, and cost up to a tenth of a decade."""
    error = pieces((-9, 4), (-2, 6), (-2 + decades, 9))
    decision = orders(curve(error), {"one": 6}, BAND)
    assert decision.verdict == verdict


def test_rounding_has_no_order():
    with pytest.raises(Undecided, match="fewer than three step sizes at which all curves show truncation"):
        orders(curve(lambda x: 0 * x), {"one": 4}, BAND)


def test_large_steps_are_the_decade_below_one_percent():
    asked = large_steps(curve(lambda x: x**2), "one")  # 1 % at 0.1
    assert X[asked.asked].min() == pytest.approx(0.01, rel=0.06)
    assert X[asked.asked].max() == pytest.approx(0.1, rel=0.06)
    with pytest.raises(Undecided, match="in the decade below an error of 1 %"):
        large_steps(curve(lambda x: 1e-3 * x), "one")


# --- margins of thresholds, for known verdicts at every threshold -----------------------------------------------------


def between(low, high):
    return lambda bound: "holds" if low <= bound <= high else "fails"


@pytest.mark.parametrize(
    ("verdict_at", "words"),
    [
        (between(83.25, 191.5), "threshold 100; the verdict is the same from 83.3 to 191"),
        (between(0, 191.5), "threshold 100; the verdict is the same up to 191"),
        (between(2e-74, 1e300), "threshold 100; the verdict is the same from 2 × 10⁻⁷⁴ upwards"),
        (between(0, 3e17), "threshold 100; the verdict is the same up to 3 × 10¹⁷"),
        (between(-1, 1e300), "threshold 100; any other threshold gives the same verdict"),
    ],
)
def test_the_margin_ends_where_the_verdict_changes(verdict_at, words):
    assert margin(verdict_at, 100.0) == words


def test_the_nearest_change_ends_the_margin():
    """The verdict returns beyond a gap."""
    assert margin(lambda bound: "fails" if 150 < bound < 200 else "holds", 100.0).endswith("up to 150")


def test_a_threshold_without_a_verdict_ends_the_margin():
    def verdict_at(bound):
        if bound > 120:
            raise Undecided
        return "holds"

    assert margin(verdict_at, 100.0) == "threshold 100; the verdict is the same up to 120"


# --- statements on trained methods, for known errors ------------------------------------------------------------------


THREE = ("babps9o7h", "babps8o7h", "abas5o6h")
TRAINED = held_results().cubes["trained"]["integrator"].values.tolist()
HIGH = [name for name in integrators.registered if name in TRAINED and integrators[name].order >= 4]


def total(name):
    return sum(abs(float(c)) for c in (*integrators[name].kick, *integrators[name].drift))


def with_errors(rows):
    """Return results with the errors (method, four step sizes) of all methods of order four or more."""
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].isel(point=slice(0, 4))
    errors = results.cubes["trained"]["mean_log_error"]
    errors[:] = -16.0
    errors.loc[{"integrator": HIGH}] = np.broadcast_to(rows, (len(errors), *np.shape(rows)))
    return results


def test_random_order_is_related_in_one_of_twenty_cases():
    random = np.random.default_rng(1)
    share = {}
    for count in (FEWEST_METHODS - 1, FEWEST_METHODS):
        ranks = random.permuted(np.tile(np.arange(count), (200_000, 1)), axis=1)
        squares = ((ranks - np.arange(count)) ** 2).sum(axis=1)
        share[count] = (1 - 6 * squares / (count**3 - count) >= RELATED).mean()
    # Shares of 200000 draws scatter by 0.0005.
    assert 0.045 < share[FEWEST_METHODS] < 0.05 < share[FEWEST_METHODS - 1]


@pytest.mark.parametrize(("turned", "verdict"), [((), "holds"), ((0, 2), "holds in part"), ((0, 1, 2, 3), "fails")])
def test_verdict_counts_step_sizes_at_which_smaller_sums_err_less(turned, verdict):
    rows = np.array([[total(name)] * 4 for name in HIGH])
    rows[:, list(turned)] *= -1
    decision = minimised_coefficients.decision(with_errors(rows))
    assert decision.verdict == verdict
    assert f"; 0.5 or more at {4 - len(turned)} of 4 step sizes; " in decision.value


@pytest.mark.parametrize(("count", "decided"), [(FEWEST_METHODS - 1, False), (FEWEST_METHODS, True)])
def test_few_methods_are_not_compared(count, decided):
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].sel(integrator=HIGH[:count])
    verdict, value, *_ = minimised_coefficients.decision(results)
    assert (verdict != "not decided here") == decided
    assert decided or value == "the results have fewer than 12 methods of order four or more, or no step size"


@pytest.mark.parametrize("missing", ENSEMBLES)
def test_without_an_ensemble_nothing_is_decided(missing):
    results = held_results()
    results.cubes["trained"] = results.cubes["trained"].drop_sel(ensemble=missing)
    expected = ("not decided here", f"the results do not have the random potentials {missing}", "", "")
    assert minimised_coefficients.decision(results) == expected
    assert "trained" not in best_performance.decision(results).value


def test_value_on_best_three_contains_lead_of_trained_methods():
    rows = np.full((len(HIGH), 4), -3.0)
    rows[HIGH.index(THREE[0])] = -6.0
    trained = [i for i, name in enumerate(HIGH) if name.startswith("trained_")]
    rows[trained[0]], rows[trained[1]] = (-6.5, -5.0, -5.0, -8.0), (-4.0, -7.0, -5.5, -7.0)
    value = best_performance.decision(with_errors(rows)).value
    assert value.endswith("than the three methods at 3 of 4 step sizes, the best one by -0.5 to 2 decades")


# --- words for numbers: tables just above and just below the meaning of a word ----------------------------------------


@pytest.mark.parametrize(
    ("statement", "table", "column", "verdicts"),
    [
        # The other half of this statement, a large negative coefficient, is false.
        (high_order_negative, "integrators", "negative coefficients", {"1": "fails", "2": "holds in part"}),
        (picked_among_thousands, "derived_families", "members found", {"1999": "fails", "2000": "holds"}),
    ],
)
def test_several_are_two_and_thousands_are_two_of_them(statement, table, column, verdicts):
    for number, verdict in verdicts.items():
        results = held_results()
        for row in results.tables[table]:
            row[column] = number
        assert statement.decision(results).verdict == verdict
