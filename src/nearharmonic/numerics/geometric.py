"""Geometric progressions in decimal arithmetic, bitwise identical on every processor, without numpy.

A double means the shortest decimal that it prints as.
"""

from __future__ import annotations

from decimal import Decimal, localcontext
from math import isqrt

#: Digits of the arithmetic: a double rounded from them is correctly rounded, except for one in 10^20.
DIGITS = 40


def geometric(lowest: float, highest: float, count: int) -> list[float]:
    """Return ``count`` numbers from ``lowest`` to ``highest``, evenly in the logarithm; ``lowest`` if one."""
    with localcontext(prec=DIGITS):
        first, last = _decimal(lowest), _decimal(highest)
        inner = [float(first * (last / first) ** (Decimal(i) / (count - 1))) for i in range(1, count - 1)]
    return [float(lowest), *inner, float(highest)][:count]


def decades(lowest: float, per_decade: float, begin: int, end: int) -> list[Decimal]:
    """Return ``lowest`` * 10^(i / ``per_decade``) for ``begin`` <= i < ``end``, not rounded to doubles."""
    count = max(end - begin, 0)
    stride = isqrt(count) + 1
    # Each is the product of two of about 2 sqrt(count) powers: a power takes a hundred times as long as a product. Four
    # more digits make the whole powers of ten exact again.
    with localcontext(prec=DIGITS + 4):
        first, each = _decimal(lowest), _decimal(per_decade)
        coarse = [first * Decimal(10) ** (Decimal(i) / each) for i in range(begin, end, stride)]
        fine = [Decimal(10) ** (Decimal(i) / each) for i in range(min(stride, count))]
    with localcontext(prec=DIGITS):
        return [one * other for one in coarse for other in fine][:count]


def _decimal(x: float) -> Decimal:
    return Decimal(repr(float(x)))
