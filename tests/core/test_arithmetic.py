"""Error-free transforms and double-double arithmetic against exact rational arithmetic."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from nearharmonic.core import arithmetic, step

U = Fraction(1, 2**53)
doubles = st.floats(min_value=-1e60, max_value=1e60, allow_subnormal=False).filter(lambda x: x == 0 or abs(x) > 1e-60)


def pairs(elements=doubles):
    """Normalised double-doubles: the low half at most half an ulp of the high one."""
    return st.tuples(elements, elements).map(lambda t: arithmetic.two_sum(t[0], t[1] * 2.0**-53))


def exact(pair):
    return Fraction(pair[0]) + Fraction(pair[1])


@given(doubles, doubles)
def test_two_sum_loses_nothing(a, b):
    assert exact(arithmetic.two_sum(a, b)) == Fraction(a) + Fraction(b)


@given(doubles, doubles)
def test_quick_two_sum_loses_nothing_when_the_first_is_larger(a, b):
    large, small = sorted((a, b), key=abs, reverse=True)
    assert exact(arithmetic.quick_two_sum(large, small)) == Fraction(a) + Fraction(b)


@given(doubles, doubles)
def test_two_product_loses_nothing(a, b):
    assert exact(arithmetic.two_product(a, b)) == Fraction(a) * Fraction(b)


@given(pairs(), pairs())
def test_a_double_double_sum_is_good_to_three_squared_units(a, b):
    """Bound 3u^2/(1-4u): Joldes, Muller & Popescu (2017), doi:10.1145/3121432, Theorem 3.1."""
    total = exact(a) + exact(b)
    assert abs(exact(arithmetic.dd_add(a, b)) - total) <= Fraction(31, 10) * U**2 * abs(total)


@given(pairs(), doubles)
def test_a_double_double_sum_survives_the_cancellation_of_its_high_halves(a, low):
    """The same bound: what a variant with one step less loses shows only here."""
    b = arithmetic.two_sum(-a[0], low * 2.0**-60 if abs(low) < abs(a[0]) else a[0] * 2.0**-57)
    total = exact(a) + exact(b)
    assert abs(exact(arithmetic.dd_add(a, b)) - total) <= Fraction(31, 10) * U**2 * abs(total)


@given(pairs(), doubles)
def test_adding_a_double_is_good_to_two_squared_units(a, b):
    """Bound 2u^2: the same source, Theorem 2.2."""
    total = exact(a) + Fraction(b)
    assert abs(exact(arithmetic.dd_add_double(a, b)) - total) <= 2 * U**2 * abs(total)


@given(pairs(), pairs())
def test_a_double_double_product_is_good_to_five_squared_units(a, b):
    """Bound 5u^2: the same source, Theorem 5.4 (the variant that drops the product of the low halves)."""
    product = exact(a) * exact(b)
    assert abs(exact(arithmetic.dd_mul(a, b)) - product) <= 5 * U**2 * abs(product)


@given(pairs(), pairs())
def test_a_double_double_quotient_is_good_to_fifteen_squared_units(a, b):
    """Bound 15u^2 for one Newton correction: the same source, Theorem 6.2."""
    assume(b[0] != 0)
    quotient = exact(a) / exact(b)
    assert abs(exact(arithmetic.dd_div(a, b)) - quotient) <= 15 * U**2 * abs(quotient)


@given(pairs(st.floats(min_value=1e-30, max_value=1e30)))
def test_a_double_double_root_squares_back(a):
    """The root's own error is at most 4u^2 (half of the square's); twice that is allowed."""
    root = exact(arithmetic.dd_sqrt(a))
    assert abs(root * root - exact(a)) <= 8 * U**2 * exact(a)


@given(pairs())
def test_a_double_doubles_modulus_is_exact(a):
    assert exact(arithmetic.dd_abs(a)) == abs(exact(a))
    assert arithmetic.dd_abs(a)[0] >= 0


def test_a_compensated_update_keeps_what_a_plain_one_drops():
    """Increments of 1e-10 on 1e6, where half an ulp is 6e-11: plain rounds each up to 1.2e-10, the carry keeps all."""
    state, plain = (1e6, 0.0), (1e6, 0.0)
    for _ in range(10_000):
        state = step.compensated.py_func(*state, 0.1, 1e-9)
        plain = step.plain.py_func(*plain, 0.1, 1e-9)
    wanted = Fraction(1e6) + 10_000 * Fraction(0.1) * Fraction(1e-9)
    assert state[1] != 0.0
    assert abs(exact(state) - wanted) < Fraction(1, 10**15)
    assert abs(exact(plain) - wanted) > Fraction(1, 10**7)


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_fma_passes_on_what_is_not_finite(value):
    assert not arithmetic.fma(value, 1.0, 1.0) < float("inf")
