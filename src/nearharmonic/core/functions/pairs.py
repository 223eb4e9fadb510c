"""Parts that functions of doubles and double-doubles share: polynomials, reductions of angles, and roots."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan
from typing import Any

from llvmlite import ir

from nearharmonic.core.arithmetic import (
    dd_add,
    dd_mul,
    dd_sqrt,
    distilled,
    quick_two_sum,
    rounded_pair,
    two_product,
    whole_pi,
)
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.machine.values import LLVMBits, LLVMMask, LLVMValue

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


# --- Double-doubles in functions: series, constants, choices and scaling of pairs of carriers.

Pair = tuple[LLVMValue, LLVMValue]
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
        shifted, high, low = called("large_angles", _large_lanes, x)
        return [body(shifted.bits(), high, low)]

    return where_needed(is_large(x), [body(*quarter_turns(x))], lambda: called(f"large_{name}", of_large, x))[0]


def is_large(x: LLVMValue) -> LLVMMask:
    """Return the mask of the finite angles beyond :data:`MODERATE`."""
    size = x.absolute()
    return size.at_least(MODERATE) & size.less(inf)


def extended_quarter_turns(x: LLVMValue, x_low: LLVMValue) -> list[LLVMValue]:
    """Return a number whose last bits are those of the number of quarter turns, and the rest as a pair."""
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
    return where_needed(is_large(x), (shifted, high, low), lambda: called("large_pairs", _large_lanes, x, x_low))


def _large_lanes(*parts: LLVMValue) -> list[LLVMValue]:
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


# --- Cube roots and lengths, of doubles and of double-doubles.
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
