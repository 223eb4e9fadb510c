"""Functions of doubles with errors of at most one unit in the last place, without branches, which vectors lack.

Each function takes carriers (:class:`nearharmonic.core.machine.values.LLVMValue`) and returns one. Every operation is
rounded once, so scalars, lanes and all processors agree bitwise. The last operation of each function adds a correction
to a leading term that is exact or nearly exact. Reductions follow Cody & Waite (1980), Software Manual for the
Elementary Functions, with fused multiplications.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan

from nearharmonic.core.arithmetic import dd_mul, quick_two_sum, two_product, two_sum
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions.pairs import (
    called,
    cbrt,
    clamped,
    exponent_and_mantissa,
    for_all_angles,
    horner,
    hypot,
    nearest_whole,
    polynomial,
    power_of_two,
    scaled,
)
from nearharmonic.core.machine.values import LLVMBits, LLVMMask, LLVMValue

Pair = tuple[LLVMValue, LLVMValue]


def sin(x: LLVMValue) -> LLVMValue:
    value = for_all_angles("sin", x, lambda quarters, high, low: _turned(quarters, high, low, 0))
    return x.equals(0.0).choose(x, value)


def cos(x: LLVMValue) -> LLVMValue:
    return for_all_angles("cos", x, lambda quarters, high, low: _turned(quarters, high, low, 1))


def _turned(quarters: LLVMBits, high: LLVMValue, low: LLVMValue, more: int) -> LLVMValue:
    """Sine of high + low after ``quarters`` + ``more`` quarter turns."""
    sine, cosine = _sine(high, low), _cosine(high, low)
    odd = (quarters & 1).nonzero()
    sums = [cosine[0] + cosine[1], sine[0] + sine[1]]
    value = odd.choose(sums[more], sums[1 - more])
    return (value.bits() ^ (((quarters + more if more else quarters) & 2) << 62)).number()


def tan(x: LLVMValue) -> LLVMValue:
    return x.equals(0.0).choose(x, for_all_angles("tan", x, _tangent))


def _tangent(quarters: LLVMBits, high: LLVMValue, low: LLVMValue) -> LLVMValue:
    sine, cosine = quick_two_sum(*_sine(high, low)), quick_two_sum(*_cosine(high, low))
    odd = (quarters & 1).nonzero()
    top = [odd.choose(-c, s) for s, c in zip(sine, cosine, strict=True)]
    bottom = [odd.choose(s, c) for s, c in zip(sine, cosine, strict=True)]
    quotient = top[0] / bottom[0]
    rest = (-quotient).fma(bottom[0], top[0]) + (-quotient).fma(bottom[1], top[1])
    return quotient + rest / bottom[0]


def _sine(high: LLVMValue, low: LLVMValue) -> Pair:
    """Sine of high + low, up to pi/4, as a double and its correction."""
    square = high * high
    tail = polynomial(square, table.SIN)
    return high, (high * square).fma(tail, low * square.fma(-0.5, 1.0))


def _cosine(high: LLVMValue, low: LLVMValue) -> Pair:
    square, error = two_product(high, high)
    half = square * 0.5
    top = 1.0 - half
    rest = ((1.0 - top) - half) + error.fma(-0.5, (square * square).fma(polynomial(square, table.COS), -(high * low)))
    return top, rest


def _exponential(high: LLVMValue, low: LLVMValue) -> Pair:
    """Exponential of high + low, up to log(2)/2, as a double and its correction."""
    tail = high * high * polynomial(high, table.EXP)
    top = high + 1.0
    return top, (high - (top - 1.0)) + (top + tail).fma(low, tail)


def _exponential_parts(high: LLVMValue, low: LLVMValue | float) -> tuple[LLVMValue, LLVMValue, LLVMBits]:
    """Return (a, b, n) with exp(high + low) = (a + b) 2^n."""
    n, whole = nearest_whole(high, table.LOG2_E)
    reduced = (-n).fma(table.LN2[0], high)
    return *_exponential(reduced, (-n).fma(table.LN2[1], low)), whole


def exp(x: LLVMValue) -> LLVMValue:
    top, rest, n = _exponential_parts(clamped(x, -800.0, 800.0), 0.0)
    return scaled(top + rest, n)


def _log_quotient(m: LLVMValue) -> Pair:
    """Return (m - 1) / (m + 1) as a double and its correction, m within sqrt(1/2) and sqrt(2)."""
    bottom = m + 1.0
    missing = m - (bottom - 1.0)
    inverse = 1.0 / bottom
    s = (m - 1.0) * inverse
    return s, (-s).fma(missing, (-s).fma(bottom, m - 1.0)) * inverse


def log(x: LLVMValue) -> LLVMValue:
    k, m = exponent_and_mantissa(x)
    s, rest = _log_quotient(m)
    square = s * s
    # k LN2_SHORT is exact, and larger than 2 s unless k is 0
    top, error = two_sum(k * table.LN2_SHORT[0], s + s)
    tail = (s * square).fma(polynomial(square, table.LOG), rest)
    low = k.fma(table.LN2_SHORT[1], tail + tail) + error
    return special_logarithm(x, top + low)


def special_logarithm(x: LLVMValue, value: LLVMValue) -> LLVMValue:
    value = x.equals(inf).choose(inf, value)
    value = x.equals(0.0).choose(-inf, value)
    return (x.less(0.0) | x.undefined()).choose(nan, value)


def _precise_logarithm(x: LLVMValue) -> Pair:
    """Logarithm of a positive finite number as a double and its correction, relative error below 2^-64."""
    k, m = exponent_and_mantissa(x)
    s = quick_two_sum(*_log_quotient(m))
    square = dd_mul(s, s)
    third = x.constant(table.THIRD[0])
    tail = quick_two_sum(third, square[0].fma(polynomial(square[0], table.LOG_TAIL), table.THIRD[1]))
    tail = dd_mul(dd_mul(s, square), tail)
    top, error = two_sum(k * table.LN2_SHORT[0], s[0] + s[0])
    middle, rest = two_sum(top, tail[0] + tail[0])
    low = rest + (error + (k.fma(table.LN2_SHORT[1], (s[1] + tail[1]) * 2.0)))
    return quick_two_sum(middle, low)


def pow(x: LLVMValue, y: LLVMValue) -> LLVMValue:
    """x to the power y as C defines it: for negative x, whole y alone."""
    return called("pow", lambda a, b: [_pow(a, b)], x, y)[0]


def _pow(x: LLVMValue, y: LLVMValue) -> LLVMValue:
    size = x.absolute()
    log_high, log_low = _precise_logarithm(size)
    limited = clamped(y, -(2.0**80), 2.0**80)  # powers by larger y overflow, underflow or are 1
    high, error = two_product(limited, log_high)
    low = limited.fma(log_low, error)
    beyond = high.absolute().greater(800.0)
    low = beyond.choose(0.0, low)
    high = clamped(high, -800.0, 800.0)
    top, rest, n = _exponential_parts(high, low)
    value = scaled(top + rest, n)
    return special_power(x, y, size.greater(1.0), size.equals(1.0), whole_and_odd(y), value)


def special_power(
    x: LLVMValue, y: LLVMValue, above: LLVMMask, unity: LLVMMask, kind: tuple[LLVMMask, LLVMMask], value: LLVMValue
) -> LLVMValue:
    """Return x^y from ``value``, |x|^y for finite operands; ``kind`` is :func:`whole_and_odd` of y."""
    size = x.absolute()
    growing = above.choose(y, -y)
    value = (size.equals(0.0) | size.equals(inf) | y.absolute().equals(inf)).choose(
        growing.greater(0.0).choose(inf, growing.constant(0.0)), value
    )
    whole, odd = kind
    negative = (x.bits() >> 63).nonzero()
    value = (negative & odd).choose(-value, value)
    value = (x.less(0.0) & x.greater(-inf) & ~whole).choose(nan, value)
    value = (x.undefined() | y.undefined()).choose(nan, value)
    one = (unity & ~negative) | y.equals(0.0) | (unity & y.absolute().equals(inf))
    return one.choose(1.0, value)


def whole_and_odd(y: LLVMValue) -> tuple[LLVMMask, LLVMMask]:
    """Return two masks: y is an integer or infinite; y is odd."""
    size = y.absolute()
    large = size.at_least(2.0**52)
    fraction_free = clamped(size, 0.0, 2.0**52)
    shifted = fraction_free + 2.0**52
    whole = (shifted - 2.0**52).equals(fraction_free)
    odd_below = whole & (shifted.bits() & 1).nonzero() & ~large
    odd_above = large & size.less(2.0**53) & (size.bits() & 1).nonzero()
    return whole | large, odd_below | odd_above


def sinh(x: LLVMValue) -> LLVMValue:
    top, rest, n = _hyperbolic(x, -1.0)
    large = scaled(top + rest, n)
    square = x * x
    small = (x * square).fma(horner(square, table.SINH), x)
    return x.absolute().less(1.0).choose(small, large.with_sign_of(x))


def cosh(x: LLVMValue) -> LLVMValue:
    top, rest, n = _hyperbolic(x, 1.0)
    return scaled(top + rest, n)


def _hyperbolic(x: LLVMValue, sign: float) -> tuple[LLVMValue, LLVMValue, LLVMBits]:
    """Return (a, b, n) with (exp(|x|) + sign exp(-|x|)) / 2 = (a + b) 2^n."""
    size = clamped(x.absolute(), 0.0, 800.0)
    top, rest, n = _exponential_parts(size, 0.0)
    top, rest = quick_two_sum(top, rest)
    inverse = 1.0 / top
    inverse_rest = (-inverse).fma(rest, (-inverse).fma(top, 1.0)) * inverse
    # below 2^-80 the second exponential does not change the sum
    ratio = power_of_two(n.at_most(40) * -2) * sign
    other = inverse * ratio
    total, error = two_sum(top, other)
    return total, error + inverse_rest.fma(ratio, rest), n - 1


def tanh(x: LLVMValue) -> LLVMValue:
    square = x * x
    small = (x * square).fma(polynomial(square, table.TANH), x)
    size = clamped(x.absolute(), 0.0, 30.0)
    top, rest, n = _exponential_parts(size + size, 0.0)
    top, rest = quick_two_sum(top, rest)
    scale = power_of_two(n)
    bottom, error = two_sum((top * scale), x.constant(1.0))
    error = rest.fma(scale, error)
    quotient = 2.0 / bottom
    correction = (-quotient).fma(error, (-quotient).fma(bottom, 2.0)) / bottom
    large = 1.0 - quotient
    large = large + (((1.0 - large) - quotient) - correction)
    return x.absolute().less(0.55).choose(small, large).with_sign_of(x)


def atan2(y: LLVMValue, x: LLVMValue) -> LLVMValue:
    a, b = y.absolute(), x.absolute()
    steep = a.greater(b)
    top, bottom = steep.choose(b, a), steep.choose(a, b)
    endless = bottom.equals(inf)
    top = endless.choose(top.equals(inf).choose(1.0, top.constant(0.0)), top)
    bottom = (endless | bottom.equals(0.0)).choose(1.0, bottom)
    factor = bottom.less(2.0**-900).choose(2.0**200, bottom.greater(2.0**1000).choose(2.0**-100, bottom.constant(1.0)))
    top, bottom = top * factor, bottom * factor
    diagonal = top.greater(bottom * 0.4142135623730951)
    s, s_rest = two_sum(bottom, top)
    d, d_rest = two_sum(top, -bottom)
    numerator = diagonal.choose(d, top), diagonal.choose(d_rest, top.constant(0.0))
    denominator = diagonal.choose(s, bottom), diagonal.choose(s_rest, top.constant(0.0))
    q = numerator[0] / denominator[0]
    rest = (-q).fma(denominator[0], numerator[0]) + (-q).fma(denominator[1], numerator[1])
    square = q * q
    correction = (q * square).fma(polynomial(square, table.ATAN), rest / denominator[0] * (1.0 - square))
    # the angle is a multiple of pi/4 plus or minus the angle of the quotient
    eighths = diagonal.choose(1.0, q.constant(0.0))
    eighths = steep.choose(2.0 - eighths, eighths)
    left = (x.bits() >> 63).nonzero()
    eighths = left.choose(4.0 - eighths, eighths)
    sign = steep.choose(-1.0, q.constant(1.0))
    sign = left.choose(-sign, sign)
    base = eighths * table.QUARTER_PI[0]  # exact: the last two bits of pi/4 are 0
    q, correction = q * sign, correction * sign
    total, error = two_sum(base, q)
    value = (total + (error + eighths.fma(table.QUARTER_PI[1], correction))).with_sign_of(y)
    return (x.undefined() | y.undefined()).choose(nan, value)


def erf(x: LLVMValue) -> LLVMValue:
    square, error = two_product(x, x)
    curve = horner(square, table.ERF[2:])
    slope = curve.fma(square, table.ERF[1])
    slope_rest = curve.fma(square, table.ERF[1] - slope) + table.ERF_LOW[1]
    rest = square.fma(slope_rest, table.ERF_LOW[0]) + error * slope
    small = x + x.fma(square.fma(slope, table.ERF[0]), x * rest)
    size = clamped(x.absolute(), 0.5, 6.0)
    t = (size - 2.5) / (size + 2.5)
    high, low = two_product(size, size)
    top, rest, n = _exponential_parts(-high, -low)
    tail = (top + rest) * power_of_two(n) * horner(t, table.ERFCX)
    return x.absolute().less(1.0).choose(small, 1.0 - tail).with_sign_of(x)


FUNCTIONS: dict[str, Callable[..., LLVMValue]] = {
    f.__name__: f for f in (sin, cos, tan, exp, log, cbrt, pow, atan2, tanh, sinh, cosh, erf, hypot)
}
