"""Angles modulo pi/2, to full accuracy for every double and double-double.

Up to :data:`MODERATE` the multiple of pi/2 is subtracted by fused multiplications. For larger angles the fraction of x
/ (2 pi) is an integer product with the relevant bits of 1 / (2 pi) (Payne & Hanek 1983, doi:10.1145/1057600.1057602).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from llvmlite import ir

from nearharmonic.core.arithmetic import dd_mul, distilled, quick_two_sum, two_product, whole_pi
from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions.emit import called, where_needed
from nearharmonic.core.functions.steps import ROUNDER
from nearharmonic.core.machine.values import LLVMBits, LLVMMask, LLVMValue

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
