"""Cube roots and lengths, of doubles and of double-doubles."""

from __future__ import annotations

from math import inf, nan

from nearharmonic.core.arithmetic import dd_add, dd_mul, dd_sqrt, quick_two_sum, two_product
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions.pairs import Pair, as_pair, times
from nearharmonic.core.functions.steps import (
    MANTISSA,
    ONE_BITS,
    ROUNDER,
    ROUNDER_BITS,
    SMALLEST_NORMAL,
    polynomial,
    power_of_two,
    scaled,
    unit_scale,
)
from nearharmonic.core.machine.values import LLVMBits, LLVMValue


def cbrt(x: LLVMValue) -> LLVMValue:
    m, guess, k = cube_parts(x)
    value = (cube_root(m, guess) * power_of_two(k)).with_sign_of(x)
    return (x.equals(0.0) | x.absolute().equals(inf) | x.undefined()).choose(x, value)


def cube_parts(x: LLVMValue) -> tuple[LLVMValue, LLVMValue, LLVMBits]:
    """Return (m, guess of m^(-1/3), k) with |x| = m 2^(3k), m from 1 to 8, for finite x other than 0."""
    size = x.absolute()
    tiny = size.less(SMALLEST_NORMAL)
    bits = tiny.choose(size * 2.0**54, size).bits()
    exponent = ((bits >> 52) | 0x4330000000000000).number() - 2.0**52
    shifted = exponent.fma(1 / 3, -1 / 3) + ROUNDER  # a third, rounded down
    remainder = (shifted - ROUNDER).fma(-3.0, exponent)
    fraction = ((bits & MANTISSA) | ONE_BITS).number()
    guess = polynomial(fraction, table.CBRT)
    one, two = remainder.equals(1.0), remainder.equals(2.0)
    m = fraction * two.choose(4.0, one.choose(2.0, fraction.constant(1.0)))
    guess = guess * two.choose(table.CUBE_ROOTS[2], one.choose(table.CUBE_ROOTS[1], fraction.constant(1.0)))
    k = (shifted - tiny.choose(18.0 + 341.0, fraction.constant(341.0))).bits() - ROUNDER_BITS
    return m, guess, k


def cube_root(m: LLVMValue, guess: LLVMValue) -> LLVMValue:
    """Cube root of m from an approximation of its inverse with 14 correct bits."""
    defect = 1.0 - m * guess * guess * guess
    inverse = guess.fma(defect * defect.fma(2 / 9, 1 / 3), guess)
    root = m * inverse * inverse
    square, error = two_product(root, root)
    cube, cube_error = two_product(square, root)
    rest = (cube - m) + error.fma(root, cube_error)
    result: LLVMValue = root - rest * (inverse * inverse) * (1 / 3)
    return result


def hypot(x: LLVMValue, y: LLVMValue) -> LLVMValue:
    a, b = x.absolute(), y.absolute()
    larger, smaller = a.larger(b), b.greater(a).choose(a, b)
    scale, back = unit_scale(larger)
    a, b = larger * scale, smaller * scale
    square, error = two_product(a, a)
    other, other_error = two_product(b, b)
    total, rest = quick_two_sum(square, other)
    rest = rest + (error + other_error)
    root = total.sqrt()
    correction = ((-root).fma(root, total) + rest) / (root + root)
    value = (root + correction) * back
    value = (x.equals(0.0) & y.equals(0.0)).choose(0.0, value)
    value = (x.undefined() | y.undefined()).choose(nan, value)
    return (x.absolute().equals(inf) | y.absolute().equals(inf)).choose(inf, value)


def cbrt_extended(high: LLVMValue, low: LLVMValue) -> Pair:
    m, guess, k = cube_parts(high)
    rest = scaled(low.times_sign(high), k * -3)
    root = cube_root(m, guess)
    cube = dd_mul(two_product(root, root), as_pair(root))
    defect = (cube[0] - m) + (cube[1] - rest)
    value = quick_two_sum(root, defect / (root * root * -3.0))
    value = times(value, power_of_two(k))
    special = high.equals(0.0) | high.absolute().equals(inf) | high.undefined()
    return special.choose(high, value[0].times_sign(high)), special.choose(0.0, value[1].times_sign(high))


def hypot_extended(x: LLVMValue, x_low: LLVMValue, y: LLVMValue, y_low: LLVMValue) -> Pair:
    scale, back = unit_scale(x.absolute().larger(y.absolute()))
    a, b = times((x, x_low), scale), times((y, y_low), scale)
    root = dd_sqrt(dd_add(dd_mul(a, a), dd_mul(b, b)))
    high, low = times(root, back)
    zero, endless = x.equals(0.0) & y.equals(0.0), x.absolute().equals(inf) | y.absolute().equals(inf)
    return endless.choose(inf, zero.choose(0.0, high)), (endless | zero).choose(0.0, low)
