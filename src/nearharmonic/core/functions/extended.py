"""Functions of double-doubles, within 2^-100 of the exact value, for pairs of carriers.

Series have enough terms for 2^-110: the first terms in double-double, the small ones in double.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import factorial, inf, nan

from nearharmonic.core.arithmetic import (
    dd_add,
    dd_add_double,
    dd_div,
    dd_mul,
    dd_sqrt,
    distilled,
    quick_two_sum,
    rounded_pair,
    two_product,
    two_sum,
)
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions import double
from nearharmonic.core.functions.double import (
    ROUNDER,
    ROUNDER_BITS,
    Pair,
    called,
    clamped,
    cube_parts,
    cube_root,
    exponent_and_mantissa,
    is_large,
    large_lanes,
    nearest_whole,
    polynomial,
    power_of_two,
    scaled,
    unit_scale,
    where_needed,
)
from nearharmonic.core.values import LLVMBits, LLVMMask, LLVMValue

# --- Series, constants, choices and scaling of pairs.

Triple = tuple[LLVMValue, LLVMValue, LLVMValue]
Coefficients = Sequence[tuple[float, float]]


def inverses(numbers: Sequence[int]) -> Coefficients:
    return [rounded_pair(1 if n > 0 else -1, abs(n)) for n in numbers]


def series(x: Pair, coefficients: Coefficients, in_double: int, largest: float) -> Pair:
    """Return the sum of coefficients[k] x^k for |x| up to ``largest``.

    The terms from ``in_double`` on are small enough for double precision. A coefficient that is more than twice the
    next term is added by the shorter sum, whose operands must be in the order of their sizes and must not cancel.
    """
    high = polynomial(x[0], [c[0] for c in coefficients[in_double:]])
    result: Pair = (high, high.constant(0.0))
    for k in range(in_double - 1, -1, -1):
        product = _mul_double(x, result[0]) if k == in_double - 1 else dd_mul(x, result)
        c = constant_pair(high, coefficients[k])
        orderly = abs(coefficients[k][0]) > 2 * largest * abs(coefficients[k + 1][0])
        result = _orderly_sum(c, product) if orderly else dd_add(c, product)
    return result


def _orderly_sum(a: Pair, b: Pair) -> Pair:
    """Sum of a and the smaller b, relative error below 4 u^2 if they do not cancel."""
    high, low = quick_two_sum(a[0], b[0])
    return quick_two_sum(high, low + (a[1] + b[1]))


def _mul_double(a: Pair, b: LLVMValue) -> Pair:
    product, error = two_product(a[0], b)
    return quick_two_sum(product, a[1].fma(b, error))


def constant_pair(like: LLVMValue, pair: Sequence[float]) -> Pair:
    return like.constant(pair[0]), like.constant(pair[1])


def choose(where: LLVMMask, yes: Sequence[LLVMValue | float], no: Sequence[LLVMValue | float]) -> Pair:
    return where.choose(yes[0], no[0]), where.choose(yes[1], no[1])


def negative(a: Pair) -> Pair:
    return -a[0], -a[1]


def times(a: Pair, factor: LLVMValue | float) -> Pair:
    """Product with a power of two."""
    return a[0] * factor, a[1] * factor


def scaled_pair(a: Pair, n: LLVMBits) -> Pair:
    high = scaled(a[0], n)
    return quick_two_sum(high, high.absolute().less(inf).choose(scaled(a[1], n), 0.0))


def finite(value: Sequence[LLVMValue]) -> Pair:
    """The pair; if it is not finite its low half is 0, in place of the NaN that renormalisation gives."""
    regular = value[0].absolute().less(inf)
    return value[0], regular.choose(value[1], 0.0)


def as_pair(value: LLVMValue) -> Pair:
    return value, value.constant(0.0)


def quotient(a: Triple, b: Triple) -> Triple:
    """Return a / b in three parts, each a digit of long division."""
    rest: Sequence[LLVMValue] = a
    digits = []
    for _ in range(3):
        digit = rest[0] / b[0]
        digits.append(digit)
        first, second = two_product(-digit, b[0]), two_product(-digit, b[1])
        # the difference is exact: its terms agree in their leading digits
        rest = distilled([rest[0] + first[0], rest[1], first[1], second[0], rest[2], second[1], -digit * b[2]], 3)
    return distilled(digits, 3)


# --- Functions of pairs.

#: (sin(r) - r) / r^3 and (cos(r) - 1) / r^2 in powers of r^2, (exp(r) - 1 - r) / r^2 in powers of r,
#: (sinh(r) - r) / r^3, (artanh(s) - s) / s^3.
SIN = inverses([(-1) ** k * factorial(2 * k + 1) for k in range(1, 15)])
COS = inverses([(-1) ** k * factorial(2 * k) for k in range(1, 15)])
EXP = inverses([factorial(k) for k in range(2, 25)])
SINH = inverses([factorial(2 * k + 1) for k in range(1, 13)])
ARTANH = inverses([2 * k + 1 for k in range(1, 13)])


def _sine(r: Pair) -> Pair:
    square = dd_mul(r, r)
    return dd_add(r, dd_mul(dd_mul(r, square), series(square, SIN, 7, 0.62)))


def _cosine(r: Pair) -> Pair:
    square = dd_mul(r, r)
    return dd_add(constant_pair(r[0], (1.0, 0.0)), dd_mul(square, series(square, COS, 8, 0.62)))


def sincos(high: LLVMValue, low: LLVMValue) -> list[LLVMValue]:
    """Return sine and cosine, two parts each."""
    shifted, *rest = extended_quarter_turns(high, low)
    r = (rest[0], rest[1])
    sine, cosine = _sine(r), _cosine(r)
    bits = shifted.bits()
    odd = (bits & 1).nonzero()
    s, c = choose(odd, cosine, sine), choose(odd, sine, cosine)
    tiny = high.absolute().less(2.0**-60)
    s = _with_bit(s, (bits & 2) << 62)
    return [*choose(tiny, (high, low), s), *_with_bit(c, ((bits + 1) & 2) << 62)]


def extended_quarter_turns(x: LLVMValue, x_low: LLVMValue) -> list[LLVMValue]:
    """Return a number with the last bits of the number of quarter turns, and the rest as a pair."""
    shifted = x.fma(table.TWO_OVER_PI, ROUNDER)
    n = ROUNDER - shifted
    terms = [n.fma(table.HALF_PI[0], x), x_low]  # exact
    for part in table.HALF_PI[1:4]:
        terms += two_product(n, x.constant(part))
    terms.append(n * table.HALF_PI[4])
    for _ in range(3):
        terms = list(distilled(terms, len(terms)))
    high, low = distilled(terms, 2)
    high, low = quick_two_sum(high, low)
    return where_needed(is_large(x), (shifted, high, low), lambda: called("large_pairs", large_lanes, x, x_low))


def _with_bit(value: Pair, sign: LLVMBits) -> Pair:
    """The pair with its signs changed where the sign bit ``sign`` is set."""
    return (value[0].bits() ^ sign).number(), (value[1].bits() ^ sign).number()


def tan(high: LLVMValue, low: LLVMValue) -> Pair:
    values = sincos(high, low)
    quotient = dd_div((values[0], values[1]), (values[2], values[3]))
    return choose(high.absolute().less(2.0**-60), (high, low), quotient)


def _exponential(r: Pair) -> Pair:
    """Return exp(r) for r up to log(2)/2."""
    tail = dd_mul(dd_mul(r, r), series(r, EXP, 11, 0.35))
    return dd_add(constant_pair(r[0], (1.0, 0.0)), dd_add(r, tail))


def _reduced_exponential(parts: Sequence[LLVMValue]) -> tuple[Pair, LLVMBits]:
    """Return (a, n) with the exponential of the sum of ``parts``, the first below 800 in size, equal to a 2^n."""
    high, *rest = parts
    n, whole = nearest_whole(high, table.LOG2_E)
    r = (-n).fma(table.LN2[0], high)
    product = two_product(-n, r.constant(table.LN2[1]))
    pair = dd_add_double((product[0], product[1]), r)
    pair = dd_add(pair, quick_two_sum(*rest[:2]) if len(rest) > 1 else as_pair(rest[0]))
    pair = dd_add_double(pair, n * -table.LN2[2])
    return _exponential(pair), whole


def exp(high: LLVMValue, low: LLVMValue) -> Pair:
    limited = clamped(high, -800.0, 800.0)
    low = (limited - high).equals(0.0).choose(low, 0.0)
    value, n = _reduced_exponential((limited, low))
    return scaled_pair(value, n)


def _logarithm(high: LLVMValue, low: LLVMValue) -> Triple:
    """Return the logarithm of a positive finite number in three parts, relative error below 2^-110."""
    k, m = exponent_and_mantissa(high)
    low = scaled(low, ROUNDER_BITS - (k + ROUNDER).bits())
    one = m.constant(1.0)
    chosen = [one * x for x in table.LOG_FACTORS[-1][1:]]
    for bound, *row in table.LOG_FACTORS[-2::-1]:
        below = m.less(bound)
        chosen = [below.choose(x, y) for x, y in zip(row, chosen, strict=True)]
    factor, *logarithm = chosen
    product, error = two_product(m, factor)
    f = distilled([product - 1.0, *two_sum(error, low * factor), low.fma(factor, -(low * factor))], 3)
    s = quotient(f, distilled([one + one, *f], 3))
    pair = quick_two_sum(s[0], s[1])
    square = dd_mul(pair, pair)
    tail = dd_mul(dd_mul(pair, square), series(square, ARTANH, 6, 0.002))
    turns = [two_product(k, one * table.LN2[i]) for i in (0, 1)]
    terms = [turns[0][0], logarithm[0], 2.0 * s[0], 2.0 * tail[0], turns[0][1], turns[1][0], logarithm[1], 2.0 * s[1]]
    terms += [2.0 * tail[1], turns[1][1], k * table.LN2[2], logarithm[2], 2.0 * s[2]]
    return distilled(terms, 3)


def log(high: LLVMValue, low: LLVMValue) -> Pair:
    a, b, c = _logarithm(high, low)
    value = quick_two_sum(a, b + c)
    return double.special_logarithm(high, value[0]), value[1]


def pow(x: LLVMValue, x_low: LLVMValue, y: LLVMValue, y_low: LLVMValue) -> Pair:
    negative = (x.bits() >> 63).nonzero()
    size = x.absolute(), negative.choose(-x_low, x_low)
    exponent = _exponent_of_power(_logarithm(*size), (y, y_low))
    high = clamped(exponent[0], -800.0, 800.0)
    within = high.equals(exponent[0])
    value, n = _reduced_exponential((high, within.choose(exponent[1], 0.0), within.choose(exponent[2], 0.0)))
    value = scaled_pair(value, n)
    # a low half beside 1 decides if a power to infinity is 0 or infinite
    above = size[0].greater(1.0) | (size[0].equals(1.0) & size[1].greater(0.0))
    unity = size[0].equals(1.0) & size[1].equals(0.0)
    kind = _, odd = _whole_and_odd(y, y_low)
    special = double.special_power(x, y, above, unity, kind, value[0])
    regular = special.absolute().equals(value[0]) & y.absolute().less(inf)
    return special, regular.choose(odd.choose(negative.choose(-value[1], value[1]), value[1]), 0.0)


def _exponent_of_power(logarithm: Triple, y: Pair) -> Triple:
    """Return y times a logarithm in three parts.

    An exponent y above 2^900 is multiplied by 2^-100 and the logarithm by 2^100, up to a size at which the result is
    certainly out of range. Nothing overflows, and small logarithms, down to the logarithm of 1 and a low half, keep
    their digits.
    """
    huge = y[0].absolute().at_least(2.0**900)
    shrunk, grown = (huge.choose(factor, y[0].constant(1.0)) for factor in (2.0**-100, 2.0**100))
    head = logarithm[0] * grown
    bound = huge.choose(2.0**-600, y[0].constant(1024.0))
    beyond = head.absolute().greater(bound)
    head = beyond.choose(bound.with_sign_of(head), head)
    middle, last = (beyond.choose(0.0, part * grown) for part in logarithm[1:])
    high, low = times(y, shrunk)
    first, second, third = two_product(high, head), two_product(high, middle), two_product(low, head)
    terms = [first[0], second[0], third[0], first[1], second[1], third[1], high * last, low * middle]
    return distilled(terms, 3)


def _whole_and_odd(y: LLVMValue, low: LLVMValue) -> tuple[LLVMMask, LLVMMask]:
    first, second = double.whole_and_odd(y), double.whole_and_odd(low)
    odd = (first[1] & ~second[1]) | (second[1] & ~first[1])
    whole = first[0] & second[0]
    return whole, odd & whole


def _hyperbolic(x: Pair, sign: float) -> Pair:
    """Return (exp(|x|) + sign exp(-|x|)) / 2."""
    size = clamped(x[0].absolute(), 0.0, 800.0)
    value, n = _reduced_exponential((size, size.equals(x[0].absolute()).choose(x[1].times_sign(x[0]), 0.0)))
    ratio = power_of_two(n.at_most(60) * -2) * sign
    other = dd_div(constant_pair(size, (1.0, 0.0)), value)
    return scaled_pair(dd_add(value, times(other, ratio)), n - 1)


def _small_sinh(x: Pair) -> Pair:
    square = dd_mul(x, x)
    return dd_add(x, dd_mul(dd_mul(x, square), series(square, SINH, 6, 0.25)))


def sinh(high: LLVMValue, low: LLVMValue) -> Pair:
    large = _hyperbolic((high, low), -1.0)
    large = large[0].times_sign(high), large[1].times_sign(high)
    value = choose(high.absolute().less(0.5), _small_sinh((high, low)), large)
    return choose(high.absolute().less(2.0**-60), (high, low), value)


def cosh(high: LLVMValue, low: LLVMValue) -> Pair:
    return _hyperbolic((high, low), 1.0)


def tanh(high: LLVMValue, low: LLVMValue) -> Pair:
    small = _small_sinh((high, low))
    one = constant_pair(high, (1.0, 0.0))
    small = dd_div(small, dd_sqrt(dd_add(one, dd_mul(small, small))))
    size = clamped(high.absolute(), 0.0, 45.0)
    rest = size.equals(high.absolute()).choose(low.times_sign(high), 0.0)
    value, n = _reduced_exponential((size + size, rest + rest))
    bottom = dd_add(times(value, power_of_two(n)), one)
    large = dd_add(one, negative(dd_div(constant_pair(high, (2.0, 0.0)), bottom)))
    large = large[0].times_sign(high), large[1].times_sign(high)
    value = choose(high.absolute().less(0.5), small, large)
    return choose(high.absolute().less(2.0**-60), (high, low), value)


def atan2(y: LLVMValue, y_low: LLVMValue, x: LLVMValue, x_low: LLVMValue) -> Pair:
    """Angle of the point: the angle of the doubles, corrected by the angle that remains after a rotation by it."""
    endless = x.absolute().equals(inf) | y.absolute().equals(inf)
    special = endless | (x.equals(0.0) & y.equals(0.0))
    one = x.constant(1.0)
    unit_y = y.absolute().equals(inf).choose(1.0, one - one).with_sign_of(y)
    unit_x = (x.absolute().equals(inf) | ~endless).choose(1.0, one - one).with_sign_of(x)
    scale, _ = unit_scale(x.absolute().larger(y.absolute()))
    top = special.choose(unit_y, y * scale), special.choose(0.0, y_low * scale)
    bottom = special.choose(unit_x, x * scale), special.choose(0.0, x_low * scale)
    angle = double.atan2(top[0], bottom[0])
    values = called("sincos_extended", sincos, angle, one - one)
    sine, cosine = (values[0], values[1]), (values[2], values[3])
    across = dd_add(dd_mul(top, cosine), negative(dd_mul(bottom, sine)))
    along = bottom[0].fma(cosine[0], top[0] * sine[0])
    value = quick_two_sum(angle, across[0] / along)
    # an angle whose low half is near underflow equals the quotient, which is computed at a larger scale
    small = (top[0].absolute() * 2.0**400).less(bottom[0]) & ~special
    quotient = dd_div(times(times((y, y_low), 2.0**300), scale), bottom)
    value = choose(small, times(quotient, 2.0**-300), value)
    value = choose(angle.equals(0.0), (angle, one - one), value)
    return (x.undefined() | y.undefined()).choose(nan, value[0]), value[1]


def erf(high: LLVMValue, low: LLVMValue) -> Pair:
    x = (high, low)
    tiny = high.absolute().less(2.0**-400)  # low halves are near underflow
    grown = times(x, tiny.choose(2.0**300, high.constant(1.0)))
    small = dd_add(grown, dd_mul(grown, series(dd_mul(x, x), table.ERF_EXTENDED, 17, 1.0)))
    small = times(small, tiny.choose(2.0**-300, high.constant(1.0)))
    size = clamped(high.absolute(), 0.5, 9.0), low.times_sign(high)
    size = size[0], size[0].equals(high.absolute()).choose(size[1], 0.0)
    shift = high.constant(2.5)
    t = dd_div(dd_add_double(size, -shift), dd_add_double(size, shift))
    value, n = _reduced_exponential(negative(dd_mul(size, size)))
    tail = dd_mul(times(value, power_of_two(n)), series(t, table.ERFCX_EXTENDED, 20, 0.57))
    large = dd_add(constant_pair(high, (1.0, 0.0)), negative(tail))
    large = large[0].times_sign(high), large[1].times_sign(high)
    value = choose(high.absolute().less(1.0), small, large)
    return choose(high.equals(0.0), (high, low), value)


def cbrt(high: LLVMValue, low: LLVMValue) -> Pair:
    m, guess, k = cube_parts(high)
    rest = scaled(low.times_sign(high), k * -3)
    root = cube_root(m, guess)
    cube = dd_mul(two_product(root, root), as_pair(root))
    defect = (cube[0] - m) + (cube[1] - rest)
    value = quick_two_sum(root, defect / (root * root * -3.0))
    value = times(value, power_of_two(k))
    special = high.equals(0.0) | high.absolute().equals(inf) | high.undefined()
    return special.choose(high, value[0].times_sign(high)), special.choose(0.0, value[1].times_sign(high))


def hypot(x: LLVMValue, x_low: LLVMValue, y: LLVMValue, y_low: LLVMValue) -> Pair:
    scale, back = unit_scale(x.absolute().larger(y.absolute()))
    a, b = times((x, x_low), scale), times((y, y_low), scale)
    root = dd_sqrt(dd_add(dd_mul(a, a), dd_mul(b, b)))
    high, low = times(root, back)
    zero, endless = x.equals(0.0) & y.equals(0.0), x.absolute().equals(inf) | y.absolute().equals(inf)
    return endless.choose(inf, zero.choose(0.0, high)), (endless | zero).choose(0.0, low)


def _as_call(name: str, body: Callable[..., Pair]) -> Callable[..., Pair]:
    def function(*pairs: Pair) -> Pair:
        high, low = called(
            f"{name}_extended", lambda *parts: finite(body(*parts)), *(x for pair in pairs for x in pair)
        )
        return high, low

    return function


FUNCTIONS: dict[str, Callable[..., Pair]] = {
    "sin": lambda x: finite(called("sincos_extended", sincos, *x)[:2]),
    "cos": lambda x: finite(called("sincos_extended", sincos, *x)[2:]),
    **{f.__name__: _as_call(f.__name__, f) for f in (tan, exp, log, pow, sinh, cosh, tanh, atan2, erf, cbrt, hypot)},
}
