"""A step as a product of drifts and kicks, with the uncertainty of each coefficient due to its digits."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from itertools import groupby
from statistics import median_low
from typing import NamedTuple, Self

from nearharmonic.exact.step import Step, composed
from nearharmonic.exchange.coefficient_file import CoefficientFile
from nearharmonic.integrators.tableau import First, Row

#: Numbers with at most this number of significant digits are considered exact: no source rounds a method to four
#: digits.
EXACT_DIGITS = 4
#: Decimals that represent doubles have 16 to 18 significant digits, and 16 of them are reliable.
DOUBLE_DIGITS, LONGEST_DOUBLE = 16, 18
#: Maximum error of a coefficient in units of its last digit. A truncated number has an error of up to one unit, and the
#: iterations for published coefficients ended with errors of one or two units.
LAST_DIGIT = 3


class Printed(Fraction):
    """A printed coefficient of a step: the exact value of its decimals.

    Attributes
    ----------
    uncertainty : Fraction
        Bound of the rounding error of the decimals.
    place : str
        Its position in the file, such as "kick[2]"; several positions if adjacent flows of one operator were joined.
    """

    uncertainty: Fraction
    place: str

    def __new__(cls, value: str | Fraction, uncertainty: Fraction, place: str) -> Self:
        """Return ``value`` with its uncertainty and its place."""
        self = super().__new__(cls, value)
        self.uncertainty, self.place = uncertainty, place
        return self


class Digits(NamedTuple):
    """Number of significant digits of the coefficients, 0 if they are exact, and the source of this number."""

    number: int
    basis: str

    @property
    def words(self) -> str:
        """The digits in words."""
        return f"{self.number} digits" if self.number else "exact coefficients"


def digits_of(file: CoefficientFile) -> Digits:
    """Return the number of significant digits of the coefficients, as claimed or as counted in the file.

    The counted number is the median over the coefficients with more than :data:`EXACT_DIGITS` digits. If no coefficient
    has more, all are exact. Numbers of 16 to 18 digits are printed doubles with 16 reliable digits. Longer numbers are
    treated in this way too if they are exact decimal expansions of doubles.
    """
    if file.digits is not None:
        return Digits(file.digits, "as the file claims")
    counts = [n for n in map(significant_digits, (*file.kick, *file.drift)) if n > EXACT_DIGITS]
    if not counts:
        return Digits(0, f"as none has more than {EXACT_DIGITS} digits")
    shown = median_low(counts)
    written_out = shown > LONGEST_DOUBLE and all(map(_is_double_written_out, (*file.kick, *file.drift)))
    if DOUBLE_DIGITS <= shown <= LONGEST_DOUBLE or written_out:
        return Digits(DOUBLE_DIGITS, "which hold of doubles")
    return Digits(shown, "as the file shows")


def _is_double_written_out(text: str) -> bool:
    """Return True if a number is exactly its nearest double; by chance in one of 10^(digits - 16) cases."""
    exponent = Decimal(text).as_tuple().exponent
    return abs(Fraction(text) - Fraction(float(text))) <= Fraction(10) ** int(exponent) / 2


def significant_digits(text: str) -> int:
    """Return the number of digits of a decimal number from the first to the last that is not 0."""
    return len("".join(map(str, Decimal(text).as_tuple().digits)).strip("0"))


def uncertainty(text: str, digits: int) -> Fraction:
    """Return :data:`LAST_DIGIT` units of the last of ``digits`` digits of a coefficient; 0 for exact ones.

    ``digits`` are counted from the first digit of the number, but from the decimal point for numbers below 1. Sources
    use either way of counting; this choice gives the larger uncertainty.
    """
    if digits == 0:
        return Fraction(0)
    return LAST_DIGIT * Fraction(10) ** (max(Decimal(text).adjusted(), -1) + 1 - digits)


def step_of(kick: Row, drift: Row, first: First, digits: int) -> Step:
    """Return the step of printed rows, without zero flows, and with adjacent flows of one operator joined."""
    kicks, drifts = (
        [Printed(text, uncertainty(text, digits), f"{name}[{i}]") for i, text in enumerate(row)]
        for name, row in (("kick", kick), ("drift", drift))
    )
    moving = [factor for factor in composed(first, kicks, drifts) if factor[1]]
    return tuple((letter, _joined([c for _, c in same])) for letter, same in groupby(moving, key=lambda x: x[0]))


def _joined(same: Sequence[Printed]) -> Printed:
    uncertain = sum((c.uncertainty for c in same), Fraction(0))
    return Printed(sum(same, Fraction(0)), uncertain, " + ".join(c.place for c in same))


def with_roles_exchanged(step: Step) -> Step:
    """Return the step whose drifts are kicks and whose kicks are drifts."""
    return tuple(("B" if letter == "A" else "A", c) for letter, c in step)


def size_of(step: Step) -> Fraction:
    """Return the sum of the absolute values of all coefficients."""
    return sum((abs(c) for _, c in step), Fraction(0))


def uncertainty_of(step: Step) -> Fraction:
    """Return the sum of the uncertainties of all coefficients."""
    return sum((c.uncertainty for _, c in step), Fraction(0))


def is_palindrome(step: Step, *, exactly: bool = False) -> bool:
    """Return True if a step is a palindrome, to the digits of its coefficients or exactly."""
    return all(
        x == y and abs(a - b) <= (0 if exactly else a.uncertainty + b.uncertainty)
        for (x, a), (y, b) in zip(step, reversed(step), strict=True)
    )


def symmetrised(step: Step) -> Step:
    """Return the palindrome whose coefficients are the means of each coefficient and its mirror image."""
    return tuple((letter, (a + b) / 2) for (letter, a), (_, b) in zip(step, reversed(step), strict=True))
