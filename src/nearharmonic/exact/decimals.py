"""Numbers in and out of multiprecision, and every way in which they are written as decimals."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from typing import Any

from mpmath import inf, mpf, nstr
from mpmath.libmp import to_rational

#: A number of mpmath in its current precision, or what mixes with it: int, float, Fraction or an interval.
BigFloat = Any


def as_mpf(number: BigFloat) -> BigFloat:
    """``number`` rounded to mpmath's current precision: a Fraction has no other way there."""
    if isinstance(number, Fraction):
        return mpf(number.numerator) / number.denominator
    return mpf(number)


def as_fraction(number: BigFloat) -> Fraction:
    """The rational number that an mpf, a float or a decimal string stands for, without rounding."""
    if isinstance(number, mpf):
        return Fraction(*to_rational(number._mpf_))
    return Fraction(number)


def fixed_point(number: BigFloat, places: int) -> str:
    """``number`` rounded to ``places`` decimals, ties to even, all of them written; "inf" for infinity.

    Parameters
    ----------
    number : mpf, Fraction, int, float or decimal string
        What is written. Of an mpf every bit counts, whatever the current precision.
    places : int
        Decimals behind the point, at least 1.
    """
    if number == inf:
        return "inf"
    scaled = round(as_fraction(number) * 10**places)
    digits = f"{abs(scaled):0{places + 1}d}"
    return f"{'-' if scaled < 0 else ''}{digits[:-places]}.{digits[-places:]}"


def significant(number: BigFloat, digits: int) -> str:
    """``number`` with ``digits`` significant digits, all of them written; "0" and "inf" for these two."""
    if number == inf:
        return "inf"
    return str(nstr(number, digits, strip_zeros=False)) if number else "0"


def decimals_in_common(printed: str, other: str, most: int | None = None) -> int:
    """Decimals to which two numbers differ by less than one unit, however either is rounded.

    Parameters
    ----------
    printed, other : str
        Two decimal numbers.
    most : int, optional
        Decimals to look at; by default as many as ``printed`` has.
    """
    places = -int(Decimal(printed).as_tuple().exponent) if most is None else most
    difference = abs(Fraction(printed) - Fraction(other))
    return next((n for n in range(places, 0, -1) if difference < Fraction(1, 10**n)), 0)
