"""Functions of doubles, without branches, which vectors lack.

Each takes carriers (:class:`nearharmonic.core.values.LLVMValue`) and returns one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan
from typing import Any

from llvmlite import ir

from nearharmonic.core.arithmetic import (
    dd_mul,
    quick_two_sum,
    two_product,
    two_sum,
    whole_pi,
)
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.values import LLVMBits, LLVMMask, LLVMValue

Pair = tuple[LLVMValue, LLVMValue]

# --- Operations that functions share: polynomials, scaling by powers of two, exponents and mantissas.

#: The sum with this number is rounded to an integer, which is in the low bits of the sum.
ROUNDER = 1.5 * 2.0**52
ROUNDER_BITS = 0x4338000000000000
ONE_BITS = 0x3FF0000000000000
MANTISSA = 0x000FFFFFFFFFFFFF
#: Bit pattern of sqrt(1/2) without its low half.
ROOT_HALF_BITS = 0x3FE6A09E00000000
SMALLEST_NORMAL = 2.0**-1022


def polynomial(x: LLVMValue, coefficients: Sequence[float]) -> LLVMValue:
    """Return the sum of coefficients[k] x^k by Estrin's scheme: half the latency of Horner's rule."""
    terms: list[Any] = list(coefficients)
    power = x
    while len(terms) > 1:
        pairs = zip(terms[::2], terms[1::2], strict=False)
        terms = [power.fma(odd, even) for even, odd in pairs] + terms[len(terms) - len(terms) % 2 :]
        if len(terms) > 1:
            power = power * power
    (result,) = terms
    return result if isinstance(result, LLVMValue) else x.constant(result)


def horner(x: LLVMValue, coefficients: Sequence[float]) -> LLVMValue:
    """Return the sum of coefficients[k] x^k by Horner's rule, which rounds less where the polynomial is not small."""
    result = x.constant(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        result = result.fma(x, coefficient)
    return result


def power_of_two(n: LLVMBits) -> LLVMValue:
    """Return 2^n for integers -1022 <= n <= 1023."""
    return ((n + 1023) << 52).number()


def scaled(x: LLVMValue, n: LLVMBits) -> LLVMValue:
    """Return x 2^n for integers -2000 < n < 2000, rounded once, by two multiplications."""
    half = ((n + 4096) >> 1) - 2048
    return x * power_of_two(half) * power_of_two(n - half)


def nearest_whole(x: LLVMValue, factor: float) -> tuple[LLVMValue, LLVMBits]:
    """Return the integer nearest to x * factor, below 2^51 in size, as a double and as an integer."""
    shifted = x.fma(factor, ROUNDER)
    return shifted - ROUNDER, shifted.bits() - ROUNDER_BITS


def exponent_and_mantissa(x: LLVMValue) -> tuple[LLVMValue, LLVMValue]:
    """Return k and m with x = 2^k m and m within sqrt(1/2) and sqrt(2), for positive finite x."""
    tiny = x.less(SMALLEST_NORMAL)
    bits = tiny.choose(x * 2.0**54, x).bits() + (ONE_BITS - ROOT_HALF_BITS)
    exponent = ((bits >> 52) | 0x4330000000000000).number() - tiny.choose(2.0**52 + 1023 + 54, 2.0**52 + 1023)
    return exponent, ((bits & MANTISSA) + ROOT_HALF_BITS).number()


def clamped(x: LLVMValue, least: float, most: float) -> LLVMValue:
    """x, or the bound that it exceeds; a NaN stays a NaN."""
    x = x.less(least).choose(least, x)
    return x.greater(most).choose(most, x)


def unit_scale(size: LLVMValue) -> tuple[LLVMValue, LLVMValue]:
    """Return a power of two that brings ``size``, positive and finite, near 1, and its inverse.

    For numbers near underflow and overflow the power is 2^1000 and 2^-1000, which is sufficient.
    """
    exponent = size.bits() >> 52
    forth, back = ((2046 - exponent) << 52).number(), (exponent << 52).number()
    low, high = size.less(2.0**-1000), size.greater(2.0**1000)
    forth = low.choose(2.0**1000, high.choose(2.0**-1000, forth))
    return forth, low.choose(2.0**-1000, high.choose(2.0**1000, back))


# --- Functions of the module that is being built: long code is emitted once for each number of lanes, and called.

Body = Callable[..., Sequence[LLVMValue]]


def called(name: str, body: Body, *arguments: LLVMValue) -> list[LLVMValue]:
    """Return the results of ``body`` by a call of a function of the module, which is written at its first use.

    The name and the number of lanes must identify the body. All values have the type of the arguments.
    """
    builder, kind = arguments[0].builder, arguments[0].value.type
    symbol = f"nearharmonic.{name}.{arguments[0].width}"
    function = builder.module.globals.get(symbol) or _written(builder.module, symbol, body, kind, len(arguments))
    result = builder.call(function, [x.value for x in arguments])
    count = len(function.function_type.return_type.elements)
    return [LLVMValue(builder, builder.extract_value(result, i)) for i in range(count)]


def _written(module: ir.Module, symbol: str, body: Body, kind: ir.Type, count: int) -> ir.Function:
    # The type of a function is fixed when it is created, but the number of results is known after the body is written.
    draft = ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), [kind] * count), symbol)
    results = len(_run(body, draft))
    returned = ir.LiteralStructType([kind] * results)
    function = ir.Function(module, ir.FunctionType(returned, [kind] * count), symbol)
    function.linkage = "internal"
    function.attributes.add("noinline")
    function.attributes.add("nounwind")
    values = _run(body, function)
    builder = values[0].builder
    packed = ir.Constant(returned, ir.Undefined)
    for i, value in enumerate(values):
        packed = builder.insert_value(packed, value.value, i)
    builder.ret(packed)
    return function


def _run(body: Body, function: ir.Function) -> Sequence[LLVMValue]:
    builder = ir.IRBuilder(function.append_basic_block())
    return body(*(LLVMValue(builder, argument) for argument in function.args))


def where_needed(
    needed: LLVMMask, usual: Sequence[LLVMValue], rare: Callable[[], Sequence[LLVMValue]]
) -> list[LLVMValue]:
    """``usual``, replaced by the values of ``rare`` in the lanes ``needed``; ``rare`` runs only if a lane needs it."""
    builder = needed.builder
    before = builder.block
    with builder.if_then(needed.anywhere().value, likely=False):
        chosen = [needed.choose(new, old) for new, old in zip(rare(), usual, strict=True)]
        inside = builder.block
    results = []
    for new, old in zip(chosen, usual, strict=True):
        phi = builder.phi(old.value.type)
        phi.add_incoming(old.value, before)
        phi.add_incoming(new.value, inside)
        results.append(LLVMValue(builder, phi))
    return results


# --- Angles modulo pi/2, to full accuracy for every double and double-double.
#
# Up to :data:`MODERATE` the multiple of pi/2 is subtracted by fused multiplications. For larger angles the fraction
# of x / (2 pi) is an integer product with the relevant bits of 1 / (2 pi) (Payne & Hanek 1983,
# doi:10.1145/1057600.1057602).

#: Largest angle whose multiple of pi/2 is subtracted in floating point.
MODERATE = 2.0**20
#: Bits of the fraction of x / (2 pi): 53 are lost in the product, and the distance of a double-double from a multiple
#: of pi/2 may be as small as 2^-130.
FRACTION = 384
#: Weight of the last bit of :data:`INVERSE`: the exponent of the largest double's last bit is 971.
PLACES = 971 + FRACTION + 53


def quarter_turns(x: LLVMValue) -> tuple[LLVMBits, LLVMValue, LLVMValue]:
    """Return the integer number of quarter turns (its last two bits) and the rest, at most pi/4 in size, as a pair.

    For moderate angles. All operations but the last are exact: the second part of pi/2 has 33 bits, so that its
    multiple has at most 53; if the rest is small, the difference has at most 53 bits too.
    """
    shifted = x.fma(table.TWO_OVER_PI, ROUNDER)
    n = ROUNDER - shifted
    rest = n.fma(table.HALF_PI_SHORT[0], x)
    high = n.fma(table.HALF_PI_SHORT[1], rest)
    low = n.fma(table.HALF_PI_SHORT[1], rest - high)
    return shifted.bits(), high, n.fma(table.HALF_PI_SHORT[2], low)


def for_all_angles(name: str, x: LLVMValue, body: Callable[[LLVMBits, LLVMValue, LLVMValue], LLVMValue]) -> LLVMValue:
    """Return ``body`` of the quarter turns of x and the rest.

    For large angles ``body`` is called as a function of the module with this ``name``. The code after the reduction
    then has no branch, and values stay in their registers.
    """

    def of_large(x: LLVMValue) -> list[LLVMValue]:
        shifted, high, low = called("large_angles", large_lanes, x)
        return [body(shifted.bits(), high, low)]

    return where_needed(is_large(x), [body(*quarter_turns(x))], lambda: called(f"large_{name}", of_large, x))[0]


def is_large(x: LLVMValue) -> LLVMMask:
    """Return the mask of the finite angles beyond :data:`MODERATE`."""
    size = x.absolute()
    return size.at_least(MODERATE) & size.less(inf)


def large_lanes(*parts: LLVMValue) -> list[LLVMValue]:
    name, lanes = f"large_angle_{len(parts)}", zip(*(part.lanes() for part in parts), strict=True)
    rows = [called(name, _reduced, *lane) for lane in lanes]
    return [parts[0].from_lanes(column) for column in zip(*rows, strict=True)]


def _reduced(*parts: LLVMValue) -> list[LLVMValue]:
    """Return ROUNDER + quarter turns and the rest as a pair, for the sum of ``parts``, scalars."""
    builder = parts[0].builder
    wide = ir.IntType(FRACTION)
    fraction = ir.Constant(wide, 0)
    for part in parts:
        fraction = builder.add(fraction, _fraction(builder, part))
    # the nearest quarter turn: its number is in the two highest bits
    top = builder.lshr(builder.add(fraction, ir.Constant(wide, 1 << FRACTION - 3)), ir.Constant(wide, FRACTION - 2))
    rest = builder.sub(fraction, builder.shl(top, ir.Constant(wide, FRACTION - 2)))
    negative = builder.icmp_signed("<", rest, ir.Constant(wide, 0))
    size = builder.select(negative, builder.neg(rest), rest)
    high, middle = _leading(builder, size)
    high, low = quick_two_sum(high, middle)
    scale = high.constant(1.0)
    turn = (scale.constant(table.TWO_PI[0]), scale.constant(table.TWO_PI[1]))
    high, low = dd_mul((high, low), turn)
    signed = [LLVMValue(builder, builder.select(negative, (-v).value, v.value)) for v in (high, low)]
    quarters = LLVMValue(builder, builder.uitofp(builder.trunc(top, ir.IntType(64)), ir.DoubleType()))
    return [quarters + ROUNDER, *signed]


def _fraction(builder: ir.IRBuilder, x: LLVMValue) -> ir.Value:
    """Return the fraction of x / (2 pi) in units of 2^-FRACTION, modulo 1."""
    word, wide, wider = ir.IntType(64), ir.IntType(FRACTION), ir.IntType(FRACTION + 64)

    def w(n: int) -> ir.Constant:
        return ir.Constant(word, n)

    bits = x.bits().value
    biased = builder.and_(builder.lshr(bits, w(52)), w(0x7FF))
    mantissa = builder.and_(bits, w((1 << 52) - 1))
    normal = builder.icmp_unsigned("!=", biased, w(0))
    mantissa = builder.or_(mantissa, builder.select(normal, w(1 << 52), w(0)))
    exponent = builder.sub(builder.select(normal, biased, w(1)), w(1075))
    # bits of the inverse from 2^-(exponent + FRACTION) upwards
    shift = builder.sub(w(PLACES - FRACTION), exponent)
    most = w(PLACES)
    shift = builder.select(builder.icmp_signed(">", shift, most), most, shift)
    words = _inverse_table(builder.module)
    place = builder.gep(words, [w(0), builder.lshr(shift, w(6))])
    window = builder.load(builder.bitcast(place, wider.as_pointer()))
    window.align = 8
    shifted = builder.lshr(window, builder.zext(builder.and_(shift, w(63)), wider))
    product = builder.mul(builder.trunc(shifted, wide), builder.zext(mantissa, wide))
    negative = builder.icmp_signed("<", bits, w(0))
    return builder.select(negative, builder.neg(product), product)


def _inverse_table(module: ir.Module) -> ir.Value:
    """1 / (2 pi) in words of 64 bits, the lowest first, with zeros above."""
    name = "nearharmonic.inverse_turn"
    if name in module.globals:
        return module.globals[name]
    count = PLACES // 64 + FRACTION // 64 + 3
    number = (1 << 2 * PLACES + 64) // (2 * whole_pi(PLACES + 64))
    kind = ir.ArrayType(ir.IntType(64), count)
    variable = ir.GlobalVariable(module, kind, name)
    variable.linkage, variable.global_constant = "internal", True
    variable.align = 8
    variable.initializer = ir.Constant(kind, [(number >> 64 * i) & (2**64 - 1) for i in range(count)])
    return variable


def _leading(builder: ir.IRBuilder, size: ir.Value) -> list[LLVMValue]:
    """Return the leading 106 bits of size / 2^FRACTION as two doubles."""
    wide, word, double = size.type, ir.IntType(64), ir.DoubleType()
    signature = ir.FunctionType(wide, [wide, ir.IntType(1)])
    symbol = f"llvm.ctlz.i{FRACTION}"
    count_zeros = builder.module.globals.get(symbol) or ir.Function(builder.module, signature, symbol)
    zeros = builder.call(count_zeros, [size, ir.Constant(ir.IntType(1), 1)])
    normalised = builder.shl(size, zeros)
    zeros = builder.trunc(zeros, word)
    parts = []
    for i in range(2):
        piece = builder.trunc(builder.lshr(normalised, ir.Constant(wide, FRACTION - 53 * (i + 1))), word)
        piece = builder.and_(piece, ir.Constant(word, (1 << 53) - 1))
        number = LLVMValue(builder, builder.uitofp(piece, double))
        exponent = LLVMBits(builder, builder.sub(ir.Constant(word, 1023 - 53 * (i + 1)), zeros))
        parts.append(number * (exponent << 52).number())
    return parts


# --- Cube roots and lengths.
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


# --- Functions of doubles with errors of at most one unit in the last place.
#
# Every operation is rounded once, so scalars, lanes and all processors agree bitwise. The last operation of each
# function adds a correction to a leading term that is exact or nearly exact. Reductions follow Cody & Waite (1980),
# Software Manual for the Elementary Functions, with fused multiplications.


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
