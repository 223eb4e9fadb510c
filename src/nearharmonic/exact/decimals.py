"""Conversion of numbers to and from multiprecision, and their decimal formats."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

from mpmath import inf, mpf, nstr
from mpmath.libmp import to_rational

#: A number of mpmath in its current precision, or an operand that mpmath accepts: int, float, Fraction or interval.
BigFloat = Any


def as_mpf(number: BigFloat) -> BigFloat:
    """``number`` rounded to the current precision of mpmath, also for a Fraction."""
    if isinstance(number, Fraction):
        return mpf(number.numerator) / number.denominator
    return mpf(number)


def as_fraction(number: BigFloat) -> Fraction:
    """The exact rational value of an mpf, a float or a decimal string."""
    if isinstance(number, mpf):
        return Fraction(*to_rational(number._mpf_))
    return Fraction(number)


def fixed_point(number: BigFloat, places: int) -> str:
    """``number`` rounded to ``places`` >= 1 decimals, ties to even, with trailing zeros; "inf" for infinity.

    All bits of an mpf are used, for any current precision of mpmath.
    """
    if number == inf:
        return "inf"
    scaled = round(as_fraction(number) * 10**places)
    digits = f"{abs(scaled):0{places + 1}d}"
    return f"{'-' if scaled < 0 else ''}{digits[:-places]}.{digits[-places:]}"


def significant(number: BigFloat, digits: int) -> str:
    """``number`` with ``digits`` significant digits, with trailing zeros; "0" for 0 and "inf" for infinity."""
    if number == inf:
        return "inf"
    return str(nstr(number, digits, strip_zeros=False)) if number else "0"


def decimals_in_common(printed: str, other: str, most: int | None = None) -> int:
    """Number of decimals, at most ``most`` or those ``printed``, to which two numbers differ by less than one unit."""
    places = -int(Decimal(printed).as_tuple().exponent) if most is None else most
    difference = abs(Fraction(printed) - Fraction(other))
    return next((n for n in range(places, 0, -1) if difference < Fraction(1, 10**n)), 0)
