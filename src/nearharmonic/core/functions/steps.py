"""Operations that functions share: polynomials, scaling by powers of two, exponents and mantissas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nearharmonic.core.machine.values import LLVMBits, LLVMValue

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
