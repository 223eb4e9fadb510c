"""Roots, zeros and formats of numbers against closed forms and exact fractions."""

from decimal import ROUND_HALF_EVEN, Decimal, localcontext
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import inf, mp, mpf, sqrt

from nearharmonic.exact import polynomials

#: No real root: x^2 + x + 1, and one with roots as close to the axis as 0.01.
COMPLEX = ([1, 1, 1], [10001, -20000, 10000])


def multiplied(factors):
    result = [1]
    for factor in factors:
        result = polynomials.product(result, factor)
    return result


def with_roots(roots):
    """The polynomial with these roots, as often as they are named."""
    return multiplied([-root.numerator, root.denominator] for root in roots)


def rationals(lowest=-50):
    return st.builds(Fraction, st.integers(lowest, 50), st.integers(1, 12))


@given(st.lists(rationals(), min_size=1, max_size=6), st.sampled_from([[1], *COMPLEX]))
@settings(max_examples=60, deadline=None)
def test_real_roots_are_factors_of_polynomial_once_each(roots, without):
    polynomial, distinct = polynomials.product(with_roots(roots), without), sorted(set(roots))
    found = polynomials.real_roots(polynomial, 80)
    assert len(found) == len(distinct) == polynomials.real_root_count(polynomials.sturm_chain(polynomial))
    assert all(abs(a - b) <= Fraction(1, 2**80) for a, b in zip(found, distinct, strict=True))


@given(st.lists(rationals(), min_size=1, max_size=6), st.sampled_from([[1], *COMPLEX]))
@settings(max_examples=60, deadline=None)
def test_positive_roots_are_found_to_111_bits_from_below(roots, without):
    distinct = sorted({root for root in roots if root > 0})
    found = polynomials.positive_roots(polynomials.product(with_roots(roots), without))
    assert len(found) == len(distinct)
    assert all(0 <= b - a <= a / 2**110 for a, b in zip(found, distinct, strict=True))


def test_positive_dyadic_roots_are_found_exactly():
    # On these the halved intervals end: each has to be counted once, and neither by its neighbour.
    roots = [Fraction(n, 8) for n in (-16, -3, 1, 2, 4, 8, 20)]
    assert polynomials.positive_roots(with_roots(roots)) == roots[2:]


@pytest.mark.parametrize("bits", [8, 60, 300])
def test_two_roots_are_told_apart_however_close_they_are(bits):
    apart = Fraction(1, 3 * 2**bits)
    roots = [Fraction(1, 3), Fraction(1, 3) + apart, Fraction(7, 3)]
    found = polynomials.real_roots(with_roots(roots), bits + 10)
    assert [abs(a - b) <= Fraction(1, 2 ** (bits + 10)) for a, b in zip(found, roots, strict=True)] == [True] * 3


def test_polynomial_without_roots_on_side_asked_for_has_none():
    assert (
        polynomials.positive_roots([7])
        == polynomials.positive_roots([0, 1])
        == polynomials.positive_roots(with_roots([Fraction(-2), Fraction(0)]))
        == []
    )
    assert all(polynomials.real_roots(p, 20) == [] == polynomials.positive_roots(p) for p in ([7], *COMPLEX))
    # Roots 10^-30 from the axis, at 1: Descartes' rule has to be asked again and again before the changes of sign go.
    assert polynomials.positive_roots([10**60 + 1, -2 * 10**60, 10**60]) == []


def test_irrational_roots_are_those_of_the_quadratic_formula():
    expected = [(7 - sqrt(mpf(17))) / 4, (7 + sqrt(mpf(17))) / 4]
    for root, value in zip(polynomials.positive_roots([4, -7, 2]), expected, strict=True):
        assert 0 <= value - mpf(root.numerator) / root.denominator < value * mpf(2) ** -109


def test_roots_of_a_polynomial_with_thousands_of_digits_are_found():
    # Chebyshev's T_15 has the roots cos((2k - 1) pi / 30); its multiple by 10^2000 + 1, moved by less than 10^-900.
    previous, polynomial = [1], [0, 1]
    for _ in range(14):
        doubled = [0, *(2 * c for c in polynomial)]
        previous, polynomial = polynomial, [a - b for a, b in zip(doubled, [*previous, 0, 0], strict=True)]
    moved = [c * (10**2000 + 1) + 10**1000 * (n % 3) for n, c in enumerate(polynomial)]
    expected = sorted(mp.cos((2 * k - 1) * mp.pi / 30) for k in range(1, 16))
    found = [mpf(root.numerator) / root.denominator for root in polynomials.real_roots(moved, 130)]
    assert max(abs(a - b) for a, b in zip(found, expected, strict=True)) < mpf(10) ** -38


def test_sturm_counts_and_isolates_the_roots_of_known_polynomials():
    p = np.polynomial.polynomial.polyfromroots([1, 2, -1.5, 1j, -1j]).real * 2
    roots = polynomials.real_roots([round(c) for c in p], 60)
    assert [float(r) for r in roots] == pytest.approx([-1.5, 1, 2], abs=2e-18)
    assert len(polynomials.sturm_chain([1, -2, 1])[-1]) == 2  # (x - 1)^2 shares a factor with its derivative


@given(st.lists(rationals(-9), min_size=1, max_size=4), st.lists(rationals(-9), max_size=3), st.booleans())
@settings(max_examples=60, deadline=None)
def test_greatest_common_divisor_has_common_roots_with_multiplicity(roots, others, negative):
    left, right = with_roots([*roots, *others]), with_roots(roots)
    divisor = polynomials.common_divisor(
        [-c for c in left] if negative else left, polynomials.product(right, [1, 0, 1])
    )
    content = np.gcd.reduce(np.array(right, dtype=object))
    assert divisor == [c // content for c in right]


def test_agreement_modulo_prime_does_not_prove_common_root():
    prime = 2**61 - 1
    assert polynomials.common_divisor([1, 1], [1 + prime, 1]) == [1]
    # Leading terms that vanish modulo the prime: there the first is 1, which has no root at all.
    assert polynomials.common_divisor(
        polynomials.product([1, prime], [1, prime]), polynomials.product([1, prime], [2, 1])
    ) == [1, prime]


@given(st.dictionaries(rationals(-9), st.integers(1, 4), min_size=1, max_size=4))
@settings(max_examples=60, deadline=None)
def test_roots_are_separated_by_whether_the_polynomial_changes_sign_there(multiplicities):
    polynomial = with_roots([root for root, times in multiplicities.items() for _ in range(times)])
    for parity, found in zip((1, 0), polynomials.by_parity(polynomial), strict=True):
        expected = sorted(root for root, times in multiplicities.items() if times % 2 == parity)
        assert len(found) - 1 == len(expected)
        assert all(sum(c * root**n for n, c in enumerate(found)) == 0 for root in expected)


def test_a_row_of_fractions_becomes_the_smallest_whole_multiple():
    assert polynomials.whole([Fraction(1, 2), Fraction(-2, 3), Fraction(0)]) == [3, -4]
    assert polynomials.whole([Fraction(4), Fraction(6)]) == [2, 3]
    assert polynomials.whole([Fraction(0)]) == []


def test_sturm_chain_changes_sign_once_at_each_root_only():
    roots = [Fraction(-3), Fraction(1, 2), Fraction(5)]
    chain = polynomials.sturm_chain(with_roots(roots))

    def changes(x):
        signs = [value > 0 for value in (sum(c * x**n for n, c in enumerate(link)) for link in chain) if value]
        return sum(a != b for a, b in pairwise(signs))

    assert [changes(Fraction(x)) for x in (-4, -2, 1, 6)] == [3, 2, 1, 0]


# --- zeros of functions with closed forms: found, counted by rank, and proved -----------------------------------------


def circle_and_line(x):
    """x^2 + y^2 = 4 and x = y: zeros at +-(sqrt 2, sqrt 2)."""
    return [x[0] ** 2 + x[1] ** 2 - 4, x[0] - x[1]]


def slopes(x):
    return [[2 * x[0], 2 * x[1]], [1 + 0 * x[0], -1 + 0 * x[0]]]


def sphere(x):
    return [sum(c * c for c in x) - 9]


def sphere_slopes(x):
    return [[2 * c for c in x]]


@pytest.mark.parametrize("digits", [20, 300])
def test_newton_comes_to_the_zero_to_the_digits_asked_for(digits):
    limit = polynomials.newton(circle_and_line, slopes, [1.5, Fraction(4, 3)], digits=digits)
    assert limit.converged
    with mp.workdps(digits + 10):
        assert max(abs(c - sqrt(mpf(2))) for c in limit.point) < mpf(10) ** -digits
    assert limit.residual < mpf(10) ** -digits
    # Each iteration doubles the digits: from one, 300 take nine, and the last one only confirms.
    assert limit.iterations <= 11


def test_newton_finds_nearest_surface_point_at_first_order():
    # Steps along the gradient of |x|^2 lead straight to the centre: the direction of the start is kept.
    limit = polynomials.newton(sphere, sphere_slopes, [2, 4, 4], digits=40)
    assert max(abs(a - b) for a, b in zip(limit.point, (1, 2, 2), strict=True)) < mpf(10) ** -40


def test_unknowns_that_are_fixed_stay_where_they_are():
    limit = polynomials.newton(sphere, sphere_slopes, [1, 2, mpf("1.9")], digits=40, fixed=(0, 1))
    assert limit.point[:2] == (1, 2)
    assert abs(limit.point[2] - 2) < mpf(10) ** -40
    off = polynomials.newton(sphere, sphere_slopes, [5, 0, 1], digits=40, fixed=(0,))
    assert not off.converged  # x = 5 meets no sphere of radius 3


def test_where_no_zero_is_newton_says_how_large_residual_is():
    limit = polynomials.newton(lambda x: [x[0] ** 2 + 1], lambda x: [[2 * x[0]]], [mpf("0.5")], digits=30)
    assert not limit.converged
    assert abs(limit.residual - (limit.point[0] ** 2 + 1)) < mpf(10) ** -10 * limit.residual
    assert limit.residual >= 1


def test_double_zero_is_not_distinguished_from_no_zero():
    # Each step halves the distance: 2^-16 after 15 of them.
    limit = polynomials.newton(lambda x: [x[0] ** 2], lambda x: [[2 * x[0]]], [mpf("0.5")], digits=10)
    assert (limit.converged, limit.iterations) == (False, 15)
    assert (limit.correction, limit.point[0]) == (mpf(2) ** -16, mpf(2) ** -16)


def test_a_singular_start_ends_at_once():
    limit = polynomials.newton(circle_and_line, lambda x: [[0 * x[0]] * 2] * 2, [1, 1], digits=30)
    assert (limit.converged, limit.iterations, limit.correction) == (False, 0, mp.inf)
    assert limit.residual == 2


def test_rank_counts_independent_values_and_pivots_have_largest_slopes():
    rows = [[1, 2, 100, 0], [2, 4, 200, 0], [0, 0, 1, 3]]
    rank, pivots = polynomials.rank_and_pivots(lambda _: [list(map(mpf, row)) for row in rows], [0] * 4)
    assert (rank, pivots) == (2, (2, 3))
    for digits, expected in ((24, 2), (16, 1)):  # a pivot of 1e-10 counts while it is above half of the digits
        nearly = [[mpf(1), mpf(1)], [mpf(1), 1 + mpf("1e-10")]]
        assert polynomials.rank_and_pivots(lambda _, rows=nearly: rows, [0, 0], digits=digits)[0] == expected
    assert polynomials.rank_and_pivots(slopes, [1, 1])[0] == 2
    # There circle and line are parallel.
    assert polynomials.rank_and_pivots(slopes, [Fraction(1, 2), Fraction(-1, 2)])[0] == 1


def test_zero_that_is_near_is_proved_and_its_distance_bounded():
    exact = sqrt(mpf(2))
    near = [exact + mpf("2e-21"), exact - mpf("1e-21")]
    proof = polynomials.prove(circle_and_line, slopes, near, radius="1e-20")
    assert proof.proved
    assert mpf("2e-21") <= proof.distance < mpf("2.001e-21")


@pytest.mark.parametrize(
    ("point", "radius"),
    [
        ([Fraction(14142, 10000)] * 2, "1e-5"),  # the zero is 1.4e-5 away
        ([Fraction(0)] * 2, "10"),  # two zeros in the box
        ([Fraction(1), Fraction(-1)], "1e-3"),  # the Jacobian is singular
    ],
)
def test_nothing_is_proved_without_exactly_one_zero_in_box(point, radius):
    assert not polynomials.prove(circle_and_line, slopes, point, radius=radius).proved


def test_a_proof_with_fixed_unknowns_is_about_the_others():
    point = [Fraction(1), Fraction(2), Fraction(2) + Fraction(1, 10**12)]
    proof = polynomials.prove(sphere, sphere_slopes, point, radius="1e-11", fixed=(0, 1))
    assert proof.proved
    assert mpf("0.999e-12") < proof.distance < mpf("1.001e-12")
    assert not polynomials.prove(sphere, sphere_slopes, point, radius="1e-13", fixed=(0, 1)).proved


# --- printed and rounded numbers against decimals written out by hand -------------------------------------------------


@pytest.mark.parametrize(
    ("number", "places", "text"),
    [
        ("1.23456", 3, "1.235"),
        ("-0.0004", 3, "0.000"),
        ("-0.0006", 3, "-0.001"),
        ("0.00049", 4, "0.0005"),
        ("12", 2, "12.00"),
        ("9.9996", 3, "10.000"),
        ("1e-3", 5, "0.00100"),
        (Fraction(-2, 3), 4, "-0.6667"),
        (Fraction(1, 8), 2, "0.12"),  # a tie goes to the even digit
        (Fraction(3, 8), 2, "0.38"),
        (0.5, 1, "0.5"),
        (inf, 3, "inf"),
    ],
)
def test_number_is_rounded_to_given_decimals_with_trailing_zeros(number, places, text):
    assert polynomials.fixed_point(number, places) == text


@given(st.integers(-(10**30), 10**30), st.integers(1, 40))
@settings(deadline=None)
def test_fixed_point_agrees_with_decimal_arithmetic(numerator, places):
    with localcontext(prec=120):
        number = Decimal(numerator).scaleb(-25)
        expected = number.quantize(Decimal(1).scaleb(-places), ROUND_HALF_EVEN)
    found = polynomials.fixed_point(Fraction(numerator, 10**25), places)
    assert Decimal(found) == expected
    assert len(found.partition(".")[2]) == places


def test_every_bit_of_number_is_written_whatever_current_precision():
    with mp.workdps(60):
        root = sqrt(mpf(2))
    with mp.workdps(5):
        assert polynomials.fixed_point(root, 50) == "1.41421356237309504880168872420969807856967187537695"
        assert polynomials.fixed_point(-root, 3) == "-1.414"


@pytest.mark.parametrize("value", ["0.1", "-123456789.0625", "3e-40"])
def test_a_number_becomes_the_fraction_that_its_bits_stand_for(value):
    with mp.workdps(25):
        number = mpf(value)
        assert abs(polynomials.as_fraction(number) / Fraction(value) - 1) < Fraction(1, 2**mp.prec)
        assert polynomials.as_mpf(polynomials.as_fraction(number)) == number
    assert polynomials.as_fraction(value) == Fraction(value)
    assert polynomials.as_fraction(0.1) == Fraction(*(0.1).as_integer_ratio())


def test_a_fraction_is_rounded_to_the_precision_at_hand():
    with mp.workdps(40):
        third = polynomials.as_mpf(Fraction(1, 3))
        assert abs(3 * third - 1) < mpf(10) ** -40
        assert polynomials.as_mpf(7) == 7
        assert polynomials.as_mpf("0.5") == polynomials.as_mpf(0.5) == mpf(1) / 2


@pytest.mark.parametrize(
    ("number", "text"),
    [(mpf("3.25"), "3.2500"), (mpf("0.5"), "0.50000"), (mpf("12.34567"), "12.346"), (inf, "inf"), (0, "0")],
)
def test_significant_digits_are_counted_from_first_that_is_not_zero(number, text):
    assert polynomials.significant(number, 5) == text


@pytest.mark.parametrize(
    ("printed", "derived", "digits"),
    [
        ("0.123456", "0.12345649", 6),
        ("0.123456", "0.1234551", 6),
        ("0.123456", "0.1234499", 5),
        ("0.123456", "0.1334560", 1),
        ("0.123456", "0.123457", 5),  # one unit of the last decimal is too much
        ("-0.5", "0.5", 0),
    ],
)
def test_decimals_agree_where_the_difference_is_less_than_one_unit(printed, derived, digits):
    assert polynomials.decimals_in_common(printed, derived) == digits


def test_no_more_decimals_agree_than_are_looked_at():
    assert polynomials.decimals_in_common("0.123456", "0.123456", 4) == 4
    assert polynomials.decimals_in_common("0.5", "0.50000001", 10) == 7
