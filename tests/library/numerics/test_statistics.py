"""Fits and averages over runs: slopes above a floor, trends and their intervals."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scipy.stats import linregress
from scipy.stats import t as student

from nearharmonic.numerics.portable import (
    jackknife_interval,
    line_fit,
    linear_trend,
    observed_order,
    student_975,
    trend_linearity,
)

#: Twenty step sizes a decade, fine to coarse.
TAU = 10.0 ** (np.arange(81) / 20 - 4)


def order_of(tau, error):
    tau, error = (xr.DataArray(x, dims="tau_per_stage") for x in (tau, error))
    return observed_order(tau, error).item()


def sixth_order(tau):
    """1e-13 at tau = 1e-2, so 1e-4 at tau = 0.32."""
    return 0.1 * tau**6


def test_slope_is_that_between_floor_and_bent_top():
    """Below the curve a floor of 1e-16 to 3e-16, in no order; above 1e-4 errors that grow faster."""
    floor = np.where(np.arange(TAU.size) % 2, 3e-16, 1e-16)
    errors = np.maximum(sixth_order(TAU), floor)
    errors = np.where(errors > 1e-4, errors * TAU**5, errors)
    assert order_of(TAU, errors) == pytest.approx(6, abs=1e-9)
    assert order_of(TAU[::-1], errors[::-1]) == pytest.approx(6, abs=1e-9)  # whatever the order of the points


def test_points_within_factor_100_of_lowest_error_are_skipped():
    tau = TAU[TAU > 0.02]
    errors = 1e3 * tau**6
    errors /= errors[0] / 1e-13
    wrong = errors < 99 * errors[0]
    assert 5 < wrong.sum() < 8
    bent = np.where(wrong, errors[0], errors)
    assert order_of(tau, bent) == pytest.approx(6, abs=1e-9)
    first = np.flatnonzero(errors > 101 * errors[0])[0]
    bent[first] *= 2  # above the floor by more than 100: it counts
    assert abs(order_of(tau, bent) - 6) > 1e-3


def test_peak_among_points_of_floor_is_no_truncation():
    errors = np.maximum(sixth_order(TAU), 1e-15)
    errors[3] = 1e-9
    assert order_of(TAU, errors) == pytest.approx(6, abs=1e-9)


def test_a_lucky_zero_does_not_lower_the_floor():
    """The floor of a double is eps/2 = 1.1e-16 at least: what is below 1.1e-14 may be rounding."""
    errors = np.where(sixth_order(TAU) < 1e-14, 1e-15 * TAU**-0.3, sixth_order(TAU))
    for lucky in (0.0, 1e-30):
        errors[2] = lucky
        assert order_of(TAU, errors) == pytest.approx(6, abs=1e-9)


def test_errors_above_one_in_ten_thousand_are_left_out():
    tau = TAU[-40:-5]
    errors = 0.99e-4 * (tau / tau[12]) ** 6
    floor = 1e-13
    errors = np.where(errors > 1e-4, 1e-4 * (1 + 1e-6), errors)
    assert order_of(np.append(1e-6, tau), np.append(floor, errors)) == pytest.approx(6, abs=1e-9)
    errors[13] = 0.9999e-4  # just below: it counts
    assert order_of(np.append(1e-6, tau), np.append(floor, errors)) < 5.999


def test_slope_is_fitted_to_twenty_smallest_errors_above_floor():
    tau = 10.0 ** (np.arange(60) / 80 - 2)
    errors = 1e-12 * (tau / tau[0]) ** 6
    at = np.append(tau[0] / 10, tau)  # a floor of one point, 100 times lower than the rest
    bent = np.append(9e-15, np.where(np.arange(60) >= 20, 2 * errors, errors))
    assert order_of(at, bent) == pytest.approx(6, abs=1e-9)
    bent[20] *= 2
    assert order_of(at, bent) > 6.01


def test_three_points_make_a_slope_and_two_none():
    tau, errors = np.array([1e-3, 0.01, 0.02, 0.04]), np.array([1e-15, 1e-10, 2e-10, 4e-10])
    assert order_of(tau, errors) == pytest.approx(1, abs=1e-9)
    assert np.isnan(order_of(tau[:3], errors[:3]))
    assert np.isnan(order_of(tau, np.full(4, np.nan)))


def test_runs_that_diverged_or_were_skipped_are_no_points():
    tau, errors = TAU.copy(), np.maximum(sixth_order(TAU), 1e-15)
    errors[-3:], errors[50], tau[52], errors[52] = np.inf, np.nan, np.nan, np.nan
    assert order_of(tau, errors) == pytest.approx(6, abs=1e-9)


def test_each_method_has_the_slope_of_its_own_step_sizes():
    """Against the step as used: here 1, 2 and 3 stages times the coordinate, and a step as used that is its square."""
    grid = np.geomspace(1e-3, 1e-1, 41)
    tau = xr.DataArray([grid, 2 * grid, grid**2], dims=("integrator", "tau_per_stage"))
    errors = xr.DataArray(
        np.maximum([grid**4, 3 * (2 * grid) ** 6, grid**4], 1e-15), dims=("integrator", "tau_per_stage")
    )
    for order in (("integrator", "tau_per_stage"), ("tau_per_stage", "integrator")):
        found = observed_order(tau.transpose(*order), errors.transpose(*order))
        assert found.dims == ("integrator",)
        np.testing.assert_allclose(found, [4, 6, 2], atol=1e-9)
    assert found.attrs["units"] == "1"


def allowed(freedom):
    """Relative error of the quantile: exact for 1 and 2; 2e-3 at 3, then as n^-5, the first order that is left out."""
    return 1e-14 if freedom < 3 else 2e-3 * (3 / freedom) ** 5 + 1e-13


def test_quantile_is_students_for_1_to_200_degrees_of_freedom():
    for freedom in range(1, 201):
        assert student_975(freedom) == pytest.approx(student.ppf(0.975, freedom), rel=allowed(freedom)), freedom


def test_the_trend_of_four_points_and_its_interval_by_hand():
    """Angles 0, 1, 1, 2 at 0 ... 3: slope 3/5; squares 0.2 over two degrees of freedom and 5; t_0.975 = 4.302653."""
    slope, width = linear_trend(np.arange(4.0), np.array([0.0, 1.0, 1.0, 2.0]))
    assert slope == pytest.approx(0.6, rel=1e-14)
    assert width == pytest.approx(4.302652729749462 * np.sqrt(0.2 / 2 / 5), rel=1e-14)


@pytest.mark.parametrize("points", [3, 4, 7, 50])
def test_trend_is_least_squares_with_n_minus_2_freedoms(points):
    random = np.random.default_rng(points)
    t, angle = np.sort(random.uniform(0, 100, points)), random.normal(0, 0.3, points)
    expected = linregress(t, angle)
    slope, width = linear_trend(t, angle)
    assert slope == pytest.approx(expected.slope, rel=1e-10)
    interval = expected.stderr * student.ppf(0.975, points - 2)
    assert width == pytest.approx(interval, rel=allowed(points - 2) + 1e-10)


@pytest.mark.parametrize("rate", [0.3, -0.3, 3.0])
def test_an_angle_that_passes_pi_turns_on(rate):
    t = np.linspace(0, 100, 400)
    slope, width = linear_trend(t, np.angle(np.exp(1j * (2.5 + rate * t))))
    assert slope == pytest.approx(rate, rel=1e-12)
    assert 0 <= width < 1e-12


def test_samples_that_are_missing_do_not_enter_a_trend():
    t, angle = np.array([0.0, 1.0, np.nan, 2.0, 3.0, 4.0]), np.array([0.0, 1.0, 0.0, 1.0, 2.0, np.nan])
    assert linear_trend(t, angle) == linear_trend(np.arange(4.0), np.array([0.0, 1.0, 1.0, 2.0]))
    assert np.isnan(linear_trend(t[:3], angle[:3])).all()


@pytest.mark.parametrize("points", [3, 4, 7, 50])
def test_linearity_is_the_squared_correlation_and_halves_compare_slopes(points):
    """A mean of 1e3 and angles that grow by 0.3 a point on average; both sides round sums of some 50 terms."""
    random = np.random.default_rng(points)
    t, angle = 1e3 + np.sort(random.uniform(0, 100, points)), np.cumsum(random.uniform(-0.2, 0.8, points))
    determination, halves = trend_linearity(t, (angle + np.pi) % (2 * np.pi) - np.pi)
    assert determination == pytest.approx(np.corrcoef(t, angle)[0, 1] ** 2, rel=1e-10)
    half = (points + 1) // 2
    first, second = (np.polyfit(t[part] - 1e3, angle[part], 1)[0] for part in (slice(half), slice(points - half, None)))
    assert halves == pytest.approx(second / first, rel=1e-10)


def test_linearity_needs_three_points_and_an_angle_that_turns():
    t = np.arange(4.0)
    assert np.isnan(trend_linearity(t, np.zeros(4))).all()
    assert np.isnan(trend_linearity(t[:2], t[:2])).all()
    assert np.isnan(trend_linearity(t, np.array([0.0, 1.0, np.nan, np.inf]))).all()


def test_jackknife_of_mean_is_interval_of_mean():
    """Leaving one out in turn gives the standard error s/sqrt(n) of a mean exactly."""
    values = np.random.default_rng(3).normal(5, 2, 9)
    without = np.array([np.delete(values, i).mean() for i in range(9)])
    interval = student.ppf(0.975, 8) * values.std(ddof=1) / 3
    assert jackknife_interval(without) == pytest.approx(interval, rel=allowed(8) + 1e-12)


def test_line_is_fitted_to_ordinates_of_any_mean_and_size():
    """Nothing is unwrapped: ordinates in steps of more than pi stay as they are."""
    x, y = np.array([-3.0, -1.0, 0.0, 4.0]), np.array([100.0, 140.0, 90.0, 210.0])
    expected = linregress(x, y)
    slope, width = line_fit(x, y)
    assert slope == pytest.approx(expected.slope, rel=1e-13)
    assert width == pytest.approx(expected.stderr * student.ppf(0.975, 2), rel=1e-12)
