"""Common divisors, Sturm's chain and real roots against polynomials that are made from their roots."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf, sqrt

from nearharmonic.exact.polynomials import (
    by_parity,
    common_divisor,
    positive_roots,
    product,
    real_root_count,
    real_roots,
    sturm_chain,
    whole,
)

#: No real root: x^2 + x + 1, and one with roots as close to the axis as 0.01.
COMPLEX = ([1, 1, 1], [10001, -20000, 10000])


def multiplied(factors):
    result = [1]
    for factor in factors:
        result = product(result, factor)
    return result


def with_roots(roots):
    """The polynomial with these roots, as often as they are named."""
    return multiplied([-root.numerator, root.denominator] for root in roots)


def rationals(lowest=-50):
    return st.builds(Fraction, st.integers(lowest, 50), st.integers(1, 12))


@given(st.lists(rationals(), min_size=1, max_size=6), st.sampled_from([[1], *COMPLEX]))
@settings(max_examples=60, deadline=None)
def test_real_roots_are_factors_of_polynomial_once_each(roots, without):
    polynomial, distinct = product(with_roots(roots), without), sorted(set(roots))
    found = real_roots(polynomial, 80)
    assert len(found) == len(distinct) == real_root_count(sturm_chain(polynomial))
    assert all(abs(a - b) <= Fraction(1, 2**80) for a, b in zip(found, distinct, strict=True))


@given(st.lists(rationals(), min_size=1, max_size=6), st.sampled_from([[1], *COMPLEX]))
@settings(max_examples=60, deadline=None)
def test_positive_roots_are_found_to_111_bits_from_below(roots, without):
    distinct = sorted({root for root in roots if root > 0})
    found = positive_roots(product(with_roots(roots), without))
    assert len(found) == len(distinct)
    assert all(0 <= b - a <= a / 2**110 for a, b in zip(found, distinct, strict=True))


def test_positive_dyadic_roots_are_found_exactly():
    # On these the halved intervals end: each has to be counted once, and neither by its neighbour.
    roots = [Fraction(n, 8) for n in (-16, -3, 1, 2, 4, 8, 20)]
    assert positive_roots(with_roots(roots)) == roots[2:]


@pytest.mark.parametrize("bits", [8, 60, 300])
def test_two_roots_are_told_apart_however_close_they_are(bits):
    apart = Fraction(1, 3 * 2**bits)
    roots = [Fraction(1, 3), Fraction(1, 3) + apart, Fraction(7, 3)]
    found = real_roots(with_roots(roots), bits + 10)
    assert [abs(a - b) <= Fraction(1, 2 ** (bits + 10)) for a, b in zip(found, roots, strict=True)] == [True] * 3


def test_polynomial_without_roots_on_side_asked_for_has_none():
    assert (
        positive_roots([7]) == positive_roots([0, 1]) == positive_roots(with_roots([Fraction(-2), Fraction(0)])) == []
    )
    assert all(real_roots(p, 20) == [] == positive_roots(p) for p in ([7], *COMPLEX))
    # Roots 10^-30 from the axis, at 1: Descartes' rule has to be asked again and again before the changes of sign go.
    assert positive_roots([10**60 + 1, -2 * 10**60, 10**60]) == []


def test_irrational_roots_are_those_of_the_quadratic_formula():
    expected = [(7 - sqrt(mpf(17))) / 4, (7 + sqrt(mpf(17))) / 4]
    for root, value in zip(positive_roots([4, -7, 2]), expected, strict=True):
        assert 0 <= value - mpf(root.numerator) / root.denominator < value * mpf(2) ** -109


def test_roots_of_a_polynomial_with_thousands_of_digits_are_found():
    # Chebyshev's T_15 has the roots cos((2k - 1) pi / 30); its multiple by 10^2000 + 1, moved by less than 10^-900.
    previous, polynomial = [1], [0, 1]
    for _ in range(14):
        doubled = [0, *(2 * c for c in polynomial)]
        previous, polynomial = polynomial, [a - b for a, b in zip(doubled, [*previous, 0, 0], strict=True)]
    moved = [c * (10**2000 + 1) + 10**1000 * (n % 3) for n, c in enumerate(polynomial)]
    expected = sorted(mp.cos((2 * k - 1) * mp.pi / 30) for k in range(1, 16))
    found = [mpf(root.numerator) / root.denominator for root in real_roots(moved, 130)]
    assert max(abs(a - b) for a, b in zip(found, expected, strict=True)) < mpf(10) ** -38


def test_sturm_counts_and_isolates_the_roots_of_known_polynomials():
    p = np.polynomial.polynomial.polyfromroots([1, 2, -1.5, 1j, -1j]).real * 2
    roots = real_roots([round(c) for c in p], 60)
    assert [float(r) for r in roots] == pytest.approx([-1.5, 1, 2], abs=2e-18)
    assert len(sturm_chain([1, -2, 1])[-1]) == 2  # (x - 1)^2 shares a factor with its derivative


@given(st.lists(rationals(-9), min_size=1, max_size=4), st.lists(rationals(-9), max_size=3), st.booleans())
@settings(max_examples=60, deadline=None)
def test_greatest_common_divisor_has_common_roots_with_multiplicity(roots, others, negative):
    left, right = with_roots([*roots, *others]), with_roots(roots)
    divisor = common_divisor([-c for c in left] if negative else left, product(right, [1, 0, 1]))
    content = np.gcd.reduce(np.array(right, dtype=object))
    assert divisor == [c // content for c in right]


def test_agreement_modulo_prime_does_not_prove_common_root():
    prime = 2**61 - 1
    assert common_divisor([1, 1], [1 + prime, 1]) == [1]
    # Leading terms that vanish modulo the prime: there the first is 1, which has no root at all.
    assert common_divisor(product([1, prime], [1, prime]), product([1, prime], [2, 1])) == [1, prime]


@given(st.dictionaries(rationals(-9), st.integers(1, 4), min_size=1, max_size=4))
@settings(max_examples=60, deadline=None)
def test_roots_are_separated_by_whether_the_polynomial_changes_sign_there(multiplicities):
    polynomial = with_roots([root for root, times in multiplicities.items() for _ in range(times)])
    for parity, found in zip((1, 0), by_parity(polynomial), strict=True):
        expected = sorted(root for root, times in multiplicities.items() if times % 2 == parity)
        assert len(found) - 1 == len(expected)
        assert all(sum(c * root**n for n, c in enumerate(found)) == 0 for root in expected)


def test_a_row_of_fractions_becomes_the_smallest_whole_multiple():
    assert whole([Fraction(1, 2), Fraction(-2, 3), Fraction(0)]) == [3, -4]
    assert whole([Fraction(4), Fraction(6)]) == [2, 3]
    assert whole([Fraction(0)]) == []


def test_sturm_chain_changes_sign_once_at_each_root_only():
    roots = [Fraction(-3), Fraction(1, 2), Fraction(5)]
    chain = sturm_chain(with_roots(roots))

    def changes(x):
        signs = [value > 0 for value in (sum(c * x**n for n, c in enumerate(link)) for link in chain) if value]
        return sum(a != b for a, b in pairwise(signs))

    assert [changes(Fraction(x)) for x in (-4, -2, 1, 6)] == [3, 2, 1, 0]
