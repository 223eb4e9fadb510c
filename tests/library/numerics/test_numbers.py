"""Numbers: equal bits on every processor, fits, numbers written as text, and times."""

import os
import time
from decimal import Decimal
from fractions import Fraction
from math import inf, isnan

import mpmath
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import linregress
from scipy.stats import t as student

from nearharmonic.numerics import portable
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor, summary
from nearharmonic.numerics.written import any_decimal_of, decimal_of, exact_number, fraction_of, integer_of, is_integer

# --- Functions with the same bits everywhere, against exact fractions, multiprecision and LAPACK


#: A double of 1 is off by half of this at most.
EPS = 2.0**-52
numbers = st.floats(-1e100, 1e100)


@given(st.lists(numbers))
def test_a_total_is_the_exact_sum_rounded_once(terms):
    assert portable.total(terms) == float(sum(map(Fraction, terms)))


@given(st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=5, max_size=5), max_size=4))
def test_totals_of_rows_are_exact_sums_rounded_once_whatever_their_sizes(rows):
    terms = [[x / 8 for x in row] for row in rows]  # no sum is beyond the range of doubles
    assert portable.totals(np.array(terms).reshape(-1, 5)).tolist() == [float(sum(map(Fraction, row))) for row in terms]


def test_totals_of_long_rows_neither_lose_nor_reorder_bits():
    sizes = 10.0 ** np.random.default_rng(4).uniform(-30, 30, (3, 4, 700))
    terms = sizes * np.random.default_rng(5).normal(size=sizes.shape)
    terms = np.concatenate([terms, -terms[..., ::-1], np.full((3, 4, 1), 1e-40)], axis=-1)
    assert portable.totals(terms[..., :700]).tolist() == [
        [float(sum(map(Fraction, x))) for x in y[..., :700]] for y in terms
    ]
    assert (portable.totals(terms) == 1e-40).all()


def test_totals_of_other_rows_are_those_of_a_total():
    rows = np.array([[1.0, np.inf], [np.inf, -np.inf], [np.nan, 1.0], [1e308, -1e308], [2.0, 3.0], [0.0, 0.0]])
    np.testing.assert_array_equal(portable.totals(rows), [portable.total(row) for row in rows])
    assert portable.totals(np.zeros((2, 0))).tolist() == [0.0, 0.0]


@given(st.lists(st.tuples(numbers, numbers)))
def test_a_dot_product_is_the_exact_sum_of_rounded_products(pairs):
    one, other = np.array(pairs).reshape(-1, 2).T
    assert portable.dot(one, other) == float(sum(Fraction(float(a) * float(b)) for a, b in pairs))


@pytest.mark.parametrize(("terms", "expected"), [([1.0, np.inf], np.inf), ([-np.inf, 1.0], -np.inf)])
def test_a_total_with_an_infinity_is_infinite(terms, expected):
    assert portable.total(terms) == expected


def test_a_total_of_what_is_undefined_is_nan():
    assert np.isnan([portable.total([1.0, np.nan]), portable.total([np.inf, -np.inf])]).all()


@given(st.floats(1e-300, 1e300))
def test_log10_is_off_by_two_ulp_at_most(x):
    """Errors of the logarithm, of ln 10 and of the quotient are half an ulp each, or one ulp for our logarithm."""
    exact = mpmath.log10(mpmath.mpf(x))
    assert abs(mpmath.mpf(portable.log10(x)) - exact) <= 2 * EPS * abs(exact)
    assert portable.log10(np.array([x]))[0] == portable.log10(x)


@given(st.integers(-1000, 1000), st.floats(1.0, 2.0, exclude_max=True))
def test_a_power_of_two_is_the_nearest_in_the_logarithm(exponent, factor):
    x = mpmath.mpf(factor) * mpmath.mpf(2) ** exponent
    assert portable.nearest_power_of_two(float(x)) == mpmath.mpf(2) ** mpmath.nint(mpmath.log(x, 2))


@pytest.mark.parametrize("x", [np.inf, np.nan])
def test_what_is_not_finite_has_no_power_of_two(x):
    assert not np.isfinite(portable.nearest_power_of_two(x))


@given(st.floats(1e-200, 1e200), st.floats(1e-200, 1e200), st.integers(2, 9))
def test_a_geometric_grid_is_correctly_rounded(lowest, highest, count):
    """Ends stand for the decimals that name them, as the config writes them."""
    first, last = mpmath.mpf(repr(lowest)), mpmath.mpf(repr(highest))
    inner = [first * (last / first) ** (mpmath.mpf(i) / (count - 1)) for i in range(1, count - 1)]
    assert portable.geometric(lowest, highest, count) == [lowest, *map(float, inner), highest]


def test_a_geometric_grid_holds_the_decimals_that_it_passes():
    assert portable.geometric(1e-4, 1, 5) == [1e-4, 1e-3, 1e-2, 1e-1, 1.0]
    assert portable.geometric(3.0, 5.0, 1) == [3.0]
    assert [float(x) for x in portable.decades(0.2, 2, 0, 5)][::2] == [0.2, 2.0, 20.0]


def symmetric(seed, count, n):
    A = np.random.default_rng(seed).normal(size=(count, n, n))
    return A + A.swapaxes(-1, -2)


@pytest.mark.parametrize("n", [1, 2, 5, 8])
def test_eigenvalues_are_those_of_lapack_and_vectors_are_orthonormal(n):
    """To rounding of some sweeps of n^2 / 2 rotations, times the size of the matrix."""
    A = symmetric(n, 20, n)
    values, vectors = portable.eigen(A)
    bound = 100 * n * EPS * np.abs(A).max()
    assert np.abs(values - np.linalg.eigvalsh(A)).max() < bound
    assert np.abs(A @ vectors - vectors * values[:, None, :]).max() < bound
    assert np.abs(vectors.swapaxes(-1, -2) @ vectors - np.eye(n)).max() < 100 * n * EPS


def test_degenerate_eigenvalues_have_an_orthonormal_basis():
    """The differences of a ring of six: frequencies 0, 1, 1, 3, 3, 4 squared, known in closed form."""
    ring = 2 * np.eye(6) - np.roll(np.eye(6), 1, axis=0) - np.roll(np.eye(6), -1, axis=0)
    values, vectors = portable.eigen(ring)
    assert values == pytest.approx([0, 1, 1, 3, 3, 4], abs=1e-14)
    assert np.abs(vectors.T @ vectors - np.eye(6)).max() < 1e-14


def test_a_diagonal_matrix_keeps_the_axes():
    values, vectors = portable.eigen(np.diag([3.0, 1.0, 1.0]))
    assert values.tolist() == [1, 1, 3]
    assert vectors.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def test_norms_are_largest_singular_values():
    A = np.random.default_rng(1).normal(size=(30, 5, 3))
    assert portable.norms(A) == pytest.approx(np.linalg.norm(A, ord=2, axis=(1, 2)), rel=100 * EPS)


def test_a_product_is_that_of_matrices():
    rows, matrix = np.random.default_rng(2).integers(-9, 9, (4, 3, 5)) * 1.0, np.arange(10.0).reshape(5, 2)
    assert (portable.product(rows, matrix) == rows @ matrix).all()


# --- Fits and averages over runs: slopes above a floor, trends and their intervals


#: Twenty step sizes a decade, fine to coarse.
TAU = 10.0 ** (np.arange(81) / 20 - 4)


def order_of(tau, error):
    tau, error = (xr.DataArray(x, dims="tau_per_stage") for x in (tau, error))
    return portable.observed_order(tau, error).item()


def slope_by_the_rule(tau, error):
    """The slope of log(error) over the twenty smallest steps above all errors near the lowest, in plain Python."""
    points = sorted((t, e) for t, e in zip(tau, error, strict=True) if np.isfinite([t, e]).all() and e > 0)
    floor = max(min((e for _, e in points), default=1.0), 2.0**-53)
    last = max((t for t, e in points if e < 100 * floor), default=0.0)
    used = np.log([(t, e) for t, e in points if t > last and e < 1e-4][:20])
    return linregress(*used.T).slope if len(used) > 2 else np.nan


@pytest.mark.parametrize("seed", range(60))
def test_slope_of_a_rough_curve_is_that_of_the_rule(seed):
    """Each point that is taken or left out changes the slope of a rough curve; some points are lucky zeros, or lost."""
    random = np.random.default_rng(seed)
    order, size, floor = random.integers(2, 9), 10.0 ** random.uniform(-3, 2), 10.0 ** random.uniform(-18, -12)
    rough = np.exp(random.normal(0, 0.3, TAU.size))
    errors = np.maximum(size * TAU**order, floor * random.uniform(1, 3, TAU.size)) * rough
    errors[random.integers(0, TAU.size, 3)] = random.choice([0.0, 1e-30, np.inf, np.nan], 3)
    mixed = random.permutation(TAU.size)[: random.integers(5, TAU.size + 1)]
    expected = slope_by_the_rule(TAU[mixed], errors[mixed])
    assert order_of(TAU[mixed], errors[mixed]) == pytest.approx(expected, rel=1e-9, nan_ok=True)


def test_slope_is_that_between_floor_and_bent_top():
    """Below the curve a floor of 1e-16 to 3e-16 with a peak; above 1e-4 errors that grow faster."""
    errors = np.maximum(0.1 * TAU**6, np.where(np.arange(TAU.size) % 2, 3e-16, 1e-16))
    errors = np.where(errors > 1e-4, errors * TAU**5, errors)
    errors[3] = 1e-9
    assert order_of(TAU, errors) == pytest.approx(6, abs=1e-9)
    assert np.isnan(order_of(TAU[:4], np.full(4, np.nan)))


def test_each_method_has_the_slope_of_its_own_step_sizes():
    """Against the step as used: here 1, 2 and 3 stages times the coordinate, and a step as used that is its square."""
    grid = np.geomspace(1e-3, 1e-1, 41)
    tau = xr.DataArray([grid, 2 * grid, grid**2], dims=("integrator", "tau_per_stage"))
    errors = tau.copy(data=np.maximum([grid**4, 3 * (2 * grid) ** 6, grid**4], 1e-15))
    for order in (("integrator", "tau_per_stage"), ("tau_per_stage", "integrator")):
        found = portable.observed_order(tau.transpose(*order), errors.transpose(*order))
        assert found.dims == ("integrator",)
        np.testing.assert_allclose(found, [4, 6, 2], atol=1e-9)
    assert found.attrs["units"] == "1"


def allowed(freedom):
    """Relative error of the quantile: exact for 1 and 2; 2e-3 at 3, then as n^-5, the first order that is left out."""
    return 1e-14 if freedom < 3 else 2e-3 * (3 / freedom) ** 5 + 1e-13


def test_quantile_is_students_for_1_to_200_degrees_of_freedom():
    for freedom in range(1, 201):
        expected = pytest.approx(student.ppf(0.975, freedom), rel=allowed(freedom))
        assert portable.student_975(freedom) == expected, freedom


def test_the_trend_of_four_points_and_its_interval_by_hand():
    """Angles 0, 1, 1, 2 at 0 ... 3: slope 3/5; squares 0.2 over two degrees of freedom and 5; t_0.975 = 4.302653."""
    slope, width = portable.line_fit(*portable.unwrapped(np.arange(4.0), np.array([0.0, 1.0, 1.0, 2.0])))
    assert slope == pytest.approx(0.6, rel=1e-14)
    assert width == pytest.approx(4.302652729749462 * np.sqrt(0.2 / 2 / 5), rel=1e-14)


@pytest.mark.parametrize("points", [3, 4, 7, 50])
def test_trend_is_least_squares_with_n_minus_2_freedoms(points):
    random = np.random.default_rng(points)
    t, angle = np.sort(random.uniform(0, 100, points)), random.normal(0, 0.3, points)
    expected = linregress(t, angle)
    slope, width = portable.line_fit(*portable.unwrapped(t, angle))
    assert slope == pytest.approx(expected.slope, rel=1e-10)
    interval = expected.stderr * student.ppf(0.975, points - 2)
    assert width == pytest.approx(interval, rel=allowed(points - 2) + 1e-10)


@pytest.mark.parametrize("rate", [0.3, -0.3, 3.0])
def test_an_angle_that_passes_pi_turns_on(rate):
    t = np.linspace(0, 100, 400)
    slope, width = portable.line_fit(*portable.unwrapped(t, np.angle(np.exp(1j * (2.5 + rate * t)))))
    assert slope == pytest.approx(rate, rel=1e-12)
    assert 0 <= width < 1e-12


def test_samples_that_are_missing_do_not_enter_a_trend():
    t, angle = np.array([0.0, 1.0, np.nan, 2.0, 3.0, 4.0]), np.array([0.0, 1.0, 0.0, 1.0, 2.0, np.nan])
    assert portable.line_fit(*portable.unwrapped(t, angle)) == portable.line_fit(
        *portable.unwrapped(np.arange(4.0), np.array([0.0, 1.0, 1.0, 2.0]))
    )
    assert np.isnan(portable.line_fit(*portable.unwrapped(t[:3], angle[:3]))).all()


def test_rows_have_the_trends_that_they_have_alone():
    random = np.random.default_rng(6)
    t, angle = np.sort(random.uniform(0, 100, (6, 40))), np.cumsum(random.uniform(-2, 3, (6, 40)), axis=1)
    angle[1, 7], angle[2, 20:], t[3, :30], angle[4, 2:], angle[5] = np.nan, np.nan, np.inf, np.nan, np.nan
    for fit in (portable.line_fit, portable.trend_linearity):
        parts = ([row[np.isfinite(x) & np.isfinite(y)] for row in (x, y)] for x, y in zip(t, angle, strict=True))
        alone = [fit(*portable.unwrapped(*part)) for part in parts]
        np.testing.assert_array_equal(np.transpose(fit(*portable.unwrapped(t, angle))), alone)
        assert np.isnan(alone).all(axis=1).tolist() == [False] * 4 + [True] * 2


@pytest.mark.parametrize("points", [3, 4, 7, 50])
def test_linearity_is_the_squared_correlation_and_halves_compare_slopes(points):
    """A mean of 1e3 and angles that grow by 0.3 a point on average; both sides round sums of some 50 terms."""
    random = np.random.default_rng(points)
    t, angle = 1e3 + np.sort(random.uniform(0, 100, points)), np.cumsum(random.uniform(-0.2, 0.8, points))
    determination, halves = portable.trend_linearity(*portable.unwrapped(t, (angle + np.pi) % (2 * np.pi) - np.pi))
    assert determination == pytest.approx(np.corrcoef(t, angle)[0, 1] ** 2, rel=1e-10)
    half = (points + 1) // 2
    first, second = (np.polyfit(t[part] - 1e3, angle[part], 1)[0] for part in (slice(half), slice(points - half, None)))
    assert halves == pytest.approx(second / first, rel=1e-10)


def test_linearity_needs_three_points_and_an_angle_that_turns():
    t = np.arange(4.0)
    assert np.isnan(portable.trend_linearity(*portable.unwrapped(t, np.zeros(4)))).all()
    assert np.isnan(portable.trend_linearity(*portable.unwrapped(t[:2], t[:2]))).all()
    assert np.isnan(portable.trend_linearity(*portable.unwrapped(t, np.array([0.0, 1.0, np.nan, np.inf])))).all()


def test_jackknife_of_mean_is_interval_of_mean():
    """Leaving one out in turn gives the standard error s/sqrt(n) of a mean exactly."""
    values = np.random.default_rng(3).normal(5, 2, 9)
    without = np.array([np.delete(values, i).mean() for i in range(9)])
    interval = student.ppf(0.975, 8) * values.std(ddof=1) / 3
    assert portable.jackknife_interval(without) == pytest.approx(interval, rel=allowed(8) + 1e-12)


def test_line_is_fitted_to_ordinates_of_any_mean_and_size():
    """Nothing is unwrapped: ordinates in steps of more than pi stay as they are."""
    x, y = np.array([-3.0, -1.0, 0.0, 4.0]), np.array([100.0, 140.0, 90.0, 210.0])
    expected = linregress(x, y)
    slope, width = portable.line_fit(x, y)
    assert slope == pytest.approx(expected.slope, rel=1e-13)
    assert width == pytest.approx(expected.stderr * student.ppf(0.975, 2), rel=1e-12)


# --- Numbers written as text: the limits within which they are read, and their exact values


SLOW = ["1e999999999", "-1E-999999999", "1e" + "9" * 500, "9" * 10**6, "0." + "3" * 10**6, "1e401", "1e-401"]
#: Text that ``Fraction``, ``Decimal``, ``int`` or ``float`` would accept, and other text that is no number.
OTHER = [
    "", " ", "nan", "inf", "-Infinity", "1_000", "٣", "１", "0x10", "1e", "e1", ".", "+", "1 2", "1,5", "1e1.5", "ten",
]  # fmt: skip


@given(st.integers(-(10**30), 10**30), st.integers(-300, 300))
def test_a_decimal_has_its_exact_value(digits, power):
    exact = digits * Fraction(10) ** power
    assert fraction_of(f"{digits}e{power}") == Fraction(decimal_of(f" {digits}E{power}\n")) == exact


@given(st.integers(-(10**30), 10**30), st.integers(1, 10**30))
def test_a_quotient_has_its_exact_value(above, below):
    assert fraction_of(f"{above}/{below}") == exact_number(Fraction(above, below)) == Fraction(above, below)


@pytest.mark.parametrize("text", [*SLOW, *OTHER], ids=lambda text: text[:12] or "empty")
def test_other_text_is_refused_at_once(text):
    begin = time.process_time()
    for read in (decimal_of, fraction_of, integer_of, exact_number):
        for one in (text, f"{text}/3", f"1/{text}"):
            with pytest.raises(ValueError):  # noqa: PT011
                read(one)
    assert time.process_time() - begin < 1


def test_a_zero_of_any_exponent_is_zero_and_no_divisor():
    assert fraction_of("0e999999999") == decimal_of("-0e-999999999") == any_decimal_of("0e999999999") == 0
    with pytest.raises(ValueError):  # noqa: PT011
        fraction_of("1/0e5")


def test_an_extreme_decimal_can_be_compared():
    assert any_decimal_of("1e999999999") > any_decimal_of("1e999999998")


@pytest.mark.parametrize("value", [10, 10.0, "10", "10.0", "1e1", Decimal(10), Fraction(10), "20/2"])
def test_an_integer_may_be_written_in_each_form(value):
    assert integer_of(value) == 10
    assert type(integer_of(value)) is int


@pytest.mark.parametrize("value", [True, None, [1], {1: 2}, b"1", 1j])
def test_what_is_no_number_is_a_type_error(value):
    with pytest.raises(TypeError):
        integer_of(value)
    with pytest.raises(TypeError):
        exact_number(value)


@pytest.mark.parametrize("value", [0.5, "0.5", float("inf"), float("nan"), Decimal("inf"), Decimal("nan"), "1/3"])
def test_what_is_no_integer_is_a_value_error(value):
    with pytest.raises(ValueError):  # noqa: PT011
        integer_of(value)


def test_an_integer_has_ascii_digits_alone():
    assert all(map(is_integer, ("0", "-12", "+3")))
    assert not any(map(is_integer, ("1.0", "", "٣", "1_0", " 1", "1" * 401)))


# --- Times: repeats that take turns, patience that ends, one core that is kept, a processor that is named


def test_repeats_take_turns():
    seen = []
    interleaved([lambda: seen.append("a"), lambda: seen.append("b")], Patience(least=2, most=3, seconds=inf))
    assert seen == ["a", "b"] * 3


def test_patience_ends_with_time_but_not_before_least_number():
    patience = Patience(least=3, most=9, seconds=1.0, longest=10.0)
    assert patience.goes_on([])
    assert patience.goes_on([4.0, 4.0])  # over the time, under the least number
    assert patience.goes_on([11.0])  # over the longest, but once is no repeat
    assert not patience.goes_on([4.0, 7.0])
    assert not patience.goes_on([0.4, 0.4, 0.4])
    assert patience.goes_on([0.1] * 8)
    assert not patience.goes_on([0.1] * 9)


def test_quartiles_are_kept():
    assert summary([4.0, 1.0, 2.0, 3.0, 5.0]) == (1.0, 2.0, 3.0, 4.0)
    assert all(map(isnan, summary([])))


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system cannot pin")
def test_pinning_keeps_to_one_core_and_gives_the_others_back():
    before = os.sched_getaffinity(0)
    with pinned() as core:
        assert os.sched_getaffinity(0) == {core}
    assert os.sched_getaffinity(0) == before


def test_the_processor_is_named_with_its_clock_and_vectors(tmp_path):
    (tmp_path / "cpuinfo").write_text("model name\t: Fast 9\ncpu MHz\t\t: 2500.0\nflags\t\t: sse avx2 avx512f\n")
    assert processor(tmp_path / "cpuinfo") == "Fast 9, 2.50 GHz, AVX-512"
    assert processor(tmp_path / "none")
