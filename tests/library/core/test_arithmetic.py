"""Error-free transforms and double-double arithmetic against exact rational arithmetic."""

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
def test_error_free_transforms_lose_nothing(a, b):
    assert exact(arithmetic.two_sum(a, b)) == Fraction(a) + Fraction(b)
    assert exact(arithmetic.two_product(a, b)) == Fraction(a) * Fraction(b)
    large, small = sorted((a, b), key=abs, reverse=True)
    assert exact(arithmetic.quick_two_sum(large, small)) == Fraction(a) + Fraction(b)


def within(pair, true, units):
    """True if the relative error of a double-double is at most a multiple of u^2."""
    return abs(exact(pair) - true) <= units * U**2 * abs(true)


@given(pairs(), pairs(), doubles)
def test_double_double_operations_keep_their_published_bounds(a, b, c):
    """3u^2/(1-4u), 2u^2, 5u^2 (the variant without the product of the low halves), 15u^2 (one Newton correction).

    Joldes, Muller & Popescu (2017), doi:10.1145/3121432, Theorems 3.1, 2.2, 5.4, 6.2.
    """
    assert within(arithmetic.dd_add(a, b), exact(a) + exact(b), Fraction(31, 10))
    # What a variant of the sum with one step less loses shows only where the high halves cancel.
    opposite = arithmetic.two_sum(-a[0], c * 2.0**-60 if abs(c) < abs(a[0]) else a[0] * 2.0**-57)
    assert within(arithmetic.dd_add(a, opposite), exact(a) + exact(opposite), Fraction(31, 10))
    assert within(arithmetic.dd_add_double(a, c), exact(a) + Fraction(c), 2)
    assert within(arithmetic.dd_mul(a, b), exact(a) * exact(b), 5)
    assert exact(arithmetic.dd_abs(a)) == abs(exact(a))
    assume(b[0] != 0)
    # The root's own error is at most 4u^2 (half of the square's); twice that is allowed.
    root, square = exact(arithmetic.dd_sqrt(arithmetic.dd_abs(b))), abs(exact(b))
    assert abs(root * root - square) <= 8 * U**2 * square
    assert within(arithmetic.dd_div(a, b), exact(a) / exact(b), 15)


def test_a_compensated_update_keeps_what_a_plain_one_drops():
    """Increments of 1e-10 on 1e6, where half an ulp is 6e-11: plain rounds each up to 1.2e-10, the carry keeps all."""
    state, plain = (1e6, 0.0), (1e6, 0.0)
    for _ in range(10_000):
        state = step.compensated(*state, 0.1, 1e-9)
        plain = step.plain(*plain, 0.1, 1e-9)
    wanted = Fraction(1e6) + 10_000 * Fraction(0.1) * Fraction(1e-9)
    assert state[1] != 0.0
    assert abs(exact(state) - wanted) < Fraction(1, 10**15)
    assert abs(exact(plain) - wanted) > Fraction(1, 10**7)


def test_a_move_makes_up_for_the_rounding_of_its_product():
    """From rest by a force of 1; a second move, without a kick or a drift, adds what the first one lacks."""
    move = step.ahead_compensated(lambda p, parameters: p, lambda f, parameters: f)
    q, kick, drift = 0.3, 0.1, 0.6
    rest = Fraction(kick) * Fraction(drift) - Fraction(kick * drift)
    assert Fraction(float(rest)) == rest != 0
    state = move((q, 0.0, 0.0, 0.0, 0.0), (kick, drift, kick * drift, float(rest)), 1.0, None)
    state = move(state, (0.0, 0.0, 0.0, 0.0), 0.0, None)
    off = exact(state[:2]) - Fraction(q) - Fraction(kick) * Fraction(drift)
    assert abs(off) < U**2, f"position is off by {float(off / rest)} of the rest"


@pytest.mark.parametrize("value", [float("inf"), float("nan")])
def test_fma_passes_on_what_is_not_finite(value):
    assert not arithmetic.fma(value, 1.0, 1.0) < float("inf")
