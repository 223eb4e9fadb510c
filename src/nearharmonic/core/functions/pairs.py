"""Double-doubles in functions: series, constants, choices and scaling of pairs of carriers."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

from nearharmonic.core.arithmetic import dd_add, dd_mul, distilled, quick_two_sum, rounded_pair, two_product
from nearharmonic.core.functions.steps import polynomial, scaled
from nearharmonic.core.machine.values import LLVMBits, LLVMMask, LLVMValue

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


def finite(value: Pair) -> Pair:
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
