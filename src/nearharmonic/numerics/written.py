"""Numbers written as text: decimals, quotients and integers, with limits on their length and size.

``Fraction("1e999999999")`` would fill the memory, and digits of other scripts are digits for Python. Text of a user is
therefore read here alone.
"""

from __future__ import annotations

import re
from decimal import Decimal
from fractions import Fraction
from numbers import Rational, Real

#: Most characters of a number. The exact sum of two doubles has at most 1100 digits.
LONGEST = 2000
#: Numbers with larger exponents are outside the range of doubles, and their conversion to fractions is slow.
LARGEST_EXPONENT = 400

_DECIMAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d{1,9})?", re.ASCII | re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?\d{1,400}", re.ASCII)


def any_decimal_of(text: str) -> Decimal:
    """Return the value of a decimal of any exponent: to be compared only, since its fraction may fill the memory.

    Raises
    ------
    ValueError
        No finite decimal, or one of more than :data:`LONGEST` characters.
    """
    if len(text) > LONGEST or _DECIMAL.fullmatch(text.strip()) is None:
        raise ValueError
    return Decimal(text.strip()) or Decimal(0)  # the fraction of 0e999999999 is as slow as that of 1e999999999


def decimal_of(text: str) -> Decimal:
    """Return the value of a decimal such as "0.1" or "-1e-3", with spaces around it or without.

    Raises
    ------
    ValueError
        No finite decimal, one of more than :data:`LONGEST` characters, or one with an exponent above
        :data:`LARGEST_EXPONENT` or below its negative.
    """
    number = any_decimal_of(text)
    if is_extreme(number):
        raise ValueError
    return number


def fraction_of(text: str) -> Fraction:
    """Return the exact value of a decimal, or of a quotient of two such as "1/3"; errors are those of decimals."""
    top, slash, bottom = text.partition("/")
    number = Fraction(decimal_of(top))
    if not slash:
        return number
    divisor = Fraction(decimal_of(bottom))
    if not divisor:
        raise ValueError
    return number / divisor


def exact_number(value: object) -> Fraction:
    """Return the exact value of text, an integer, a decimal or a fraction; a double is exact in its binary digits only.

    Raises
    ------
    TypeError
        A float, a truth value, or no number.
    ValueError
        Text or a decimal outside the limits of decimals.
    """
    if isinstance(value, str | Decimal):
        return fraction_of(str(value))
    if isinstance(value, bool) or not isinstance(value, Rational):
        raise TypeError
    return Fraction(value)


def integer_of(value: object) -> int:
    """Return the integer of 10, 10.0, "10", "10.0" or "1e1".

    Raises
    ------
    TypeError
        Neither a number nor text, or a truth value.
    ValueError
        No integer, or text outside the limits of decimals.
    """
    if isinstance(value, float) and value - value != 0:  # the fraction of an infinity is an OverflowError
        raise ValueError
    if isinstance(value, bool) or not isinstance(value, Real | Decimal | str):
        raise TypeError
    number = fraction_of(str(value)) if isinstance(value, str | Decimal) else Fraction(value)  # type: ignore[call-overload]
    if number.denominator != 1:
        raise ValueError
    return number.numerator


def is_integer(text: str) -> bool:
    """Return True if ``text`` is an integer in ASCII digits, with at most 400 of them."""
    return _INTEGER.fullmatch(text) is not None


def is_extreme(number: Decimal) -> bool:
    """Return True if a decimal is far outside the range of doubles: its fraction then has very many digits."""
    return number.is_finite() and number != 0 and abs(number.adjusted()) > LARGEST_EXPONENT
