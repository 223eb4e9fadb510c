"""Exact values of numbers of any type, and of numbers written as text: decimals, quotients and integers.

``Fraction("1e999999999")`` would fill the memory, and digits of other scripts are digits for Python. Text of a user is
therefore read here alone.
"""

from __future__ import annotations

import re
from decimal import Context, Decimal
from fractions import Fraction
from math import isfinite
from numbers import Integral, Rational, Real
from typing import Any

#: Most characters of a number. The exact sum of two doubles has at most 1100 digits.
LONGEST = 2000
#: Numbers with larger exponents are outside the range of doubles, and their conversion to fractions is slow.
LARGEST_EXPONENT = 400
#: Digits of a fraction that is not a finite decimal: three times as many as in double-double.
DIGITS = 100
#: Arithmetic that keeps all digits of a decimal: Python's default rounds to 28, in ``normalize`` too.
ALL_DIGITS = Context(prec=LONGEST)

_DECIMAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d{1,9})?", re.ASCII | re.IGNORECASE)
_INTEGER = re.compile(r"[+-]?\d{1,400}", re.ASCII)


def any_decimal_of(text: str) -> Decimal:
    """Return the value of a decimal of any exponent: to be compared only, since its fraction may fill the memory."""
    if len(text) > LONGEST or _DECIMAL.fullmatch(text.strip()) is None:
        raise ValueError
    return Decimal(text.strip()) or Decimal(0)  # 0e999999999 becomes a fraction as slowly as 1e999999999


def decimal_of(text: str) -> Decimal:
    """Return the value of a decimal such as "0.1" or "-1e-3", with spaces around it or without.

    Others, of more than :data:`LONGEST` characters or of exponents beyond :data:`LARGEST_EXPONENT`, are a ValueError.
    """
    number = any_decimal_of(text)
    if is_extreme(number):
        raise ValueError
    return number


def fraction_of(text: str) -> Fraction:
    """Return the exact value of a decimal, or of a quotient of two such as "1/3", with the errors of decimals."""
    top, slash, bottom = text.partition("/")
    number = Fraction(decimal_of(top))
    if not slash:
        return number
    divisor = Fraction(decimal_of(bottom))
    if not divisor:
        raise ValueError
    return number / divisor


def is_real(value: Any) -> bool:
    """Return True for a real number of any type: no truth value, and no difference of times, an integer for numpy."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    return not isinstance(value, bool) and isinstance(value, Real) and kind != "m"


def exact_value(value: object) -> Fraction:
    """Return the exact value of a number of any type, or of text such as "0.1", "1e-3" or "1/3".

    It raises a TypeError for no real number, a ValueError for text or a decimal outside the limits of decimals and for
    a number that is no finite double.
    """
    if isinstance(value, str | Decimal):
        return fraction_of(str(value))
    if not is_real(value):
        raise TypeError
    number: Any = value
    if isinstance(number, Rational):
        return Fraction(int(number.numerator), int(number.denominator))
    try:
        rounded = float(number)
    except OverflowError:
        raise ValueError from None
    if not isfinite(rounded) or (number and not rounded):  # its fraction may fill the memory
        raise ValueError
    if hasattr(number, "man_exp"):  # of mpmath, which is loaded
        from nearharmonic.exact.polynomials import as_fraction

        return Fraction(*map(int, as_fraction(number).as_integer_ratio()))
    if not hasattr(number, "as_integer_ratio"):
        if number != rounded:  # digits below a double that cannot be asked for
            raise ValueError
        number = rounded
    return Fraction(*map(int, number.as_integer_ratio()))


def decimal(value: Any) -> Any:
    """Return the shortest decimal that a double prints as; return anything but a finite number unchanged.

    Another number has all its digits, at most :data:`DIGITS`.
    """
    if not is_real(value):
        return value
    try:
        number = exact_value(value)
        if isinstance(value, Integral):
            return str(number)
        if not isinstance(value, Rational) and number == (rounded := float(value)):
            return repr(rounded)
    except ValueError:  # infinite, NaN, or an integer of more digits than Python writes
        return value
    return str(Context(prec=DIGITS).divide(Decimal(number.numerator), Decimal(number.denominator)))


def exact_number(value: object) -> Fraction:
    """Return the exact value of text, an integer, a decimal or a fraction, with the errors of :func:`exact_value`.

    A float is a TypeError too: it is exact in its binary digits only.
    """
    if not isinstance(value, str | Decimal | Rational):
        raise TypeError
    return exact_value(value)


def integer_of(value: object) -> int:
    """Return the integer of 10, 10.0, "10", "10.0" or "1e1", with the errors of :func:`exact_value`."""
    number = exact_value(value)
    if number.denominator != 1:
        raise ValueError
    return number.numerator


def is_integer(text: str) -> bool:
    """Return True if ``text`` is an integer in ASCII digits, with at most 400 of them."""
    return _INTEGER.fullmatch(text) is not None


def is_extreme(number: Decimal) -> bool:
    """Return True if a decimal is far outside the range of doubles: its fraction then has very many digits."""
    return number.is_finite() and number != 0 and abs(number.adjusted()) > LARGEST_EXPONENT
