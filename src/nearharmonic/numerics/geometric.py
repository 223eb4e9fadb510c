"""Geometric progressions in decimal arithmetic, bitwise identical on every processor, without numpy.

A double means the shortest decimal that it prints as.
"""

from __future__ import annotations

from decimal import Decimal, localcontext

#: Digits of the arithmetic: a double rounded from them is correctly rounded, except for one in 10^20.
DIGITS = 40


def geometric(lowest: float, highest: float, count: int) -> list[float]:
    """Return ``count`` numbers from ``lowest`` to ``highest``, evenly in the logarithm; ``lowest`` if one."""
    with localcontext(prec=DIGITS):
        first, last = _decimal(lowest), _decimal(highest)
        inner = [float(first * (last / first) ** (Decimal(i) / (count - 1))) for i in range(1, count - 1)]
    return [float(lowest), *inner, float(highest)][:count]


def decades(lowest: float, count: int, per_decade: float) -> list[Decimal]:
    """Return ``lowest`` * 10^(i / ``per_decade``) for i below ``count``, not rounded to doubles."""
    with localcontext(prec=DIGITS):
        return [_decimal(lowest) * Decimal(10) ** (Decimal(i) / _decimal(per_decade)) for i in range(count)]


def _decimal(x: float) -> Decimal:
    return Decimal(repr(float(x)))
