"""The coefficients of a tableau, rounded to the digits of a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Context, Decimal

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.composition import Composition, First, Row
from nearharmonic.integrators.tableau import Tableau

#: Number of significant decimal digits that distinguishes any two doubles.
DOUBLE_DIGITS = 17


@dataclass(frozen=True, kw_only=True)
class Coefficients(Composition):
    """The rows of a tableau as they are written to a file.

    Attributes
    ----------
    tableau : Tableau
        The integrator.
    kick, drift : tuple of str
        Decimal numbers without exponents, in the order in which they are applied.
    digits : int
        Significant digits: those to which the rows are rounded, or those that the source guarantees.
    rounding : str
        How the rows are rounded, in one sentence.

    Raises
    ------
    SettingError
        The integrator is implicit, or has modified potentials.
    """

    tableau: Tableau
    kick: Row
    drift: Row
    digits: int
    rounding: str

    def __post_init__(self) -> None:
        if self.tableau.implicit:
            raise bad_setting("integrator", self.tableau.name, "it is implicit, and no sequence of kicks and drifts")
        if self.tableau.modified:
            allowed = "its kicks are of a modified potential, which no other program and no file format has"
            raise bad_setting("integrator", self.tableau.name, allowed)

    @property
    def first(self) -> First:  # type: ignore[override]
        """The operator that comes first and last in a step."""
        return self.tableau.first

    @property
    def operators(self) -> tuple[First, First]:
        """The operator that comes first and last in a step, and the one in between."""
        return ("kick", "drift") if self.first == "kick" else ("drift", "kick")


def as_registered(tableau: Tableau) -> Coefficients:
    """Return the coefficients of ``tableau`` with all digits that it has; exponents are written out."""
    rounding = f"not rounded; the source guarantees {tableau.digits} digits"
    return _written(tableau, lambda text: format(Decimal(text), "f"), tableau.digits, rounding)


def rounded(tableau: Tableau, digits: int) -> Coefficients:
    """Return the coefficients of ``tableau`` rounded to ``digits`` significant digits, ties to even.

    Raises
    ------
    SettingError
        ``digits`` is below 1 or above the number of digits to which the coefficients are known.
    """
    if not 1 <= digits <= tableau.digits:
        allowed = f"an integer from 1 to {tableau.digits}, the digits to which {tableau.name} is known"
        raise bad_setting("digits", digits, allowed)
    read = Context(prec=digits).create_decimal
    return _written(tableau, lambda text: _with_point(read(text)), digits, f"rounded to {digits} significant digits")


def nearest_doubles(tableau: Tableau) -> Coefficients:
    """Return the shortest decimals that read as the doubles nearest to the coefficients of ``tableau``.

    Rounding to seventeen digits is not enough: a reader rounds the result to a double, and the second rounding may
    differ.
    """
    rounding = "the nearest doubles, in the shortest decimals that read as them"
    digits = min(tableau.digits, DOUBLE_DIGITS)
    return _written(tableau, lambda text: _with_point(Decimal(repr(float(text)))), digits, rounding)


def _written(tableau: Tableau, form: Callable[[str], str], digits: int, rounding: str) -> Coefficients:
    kick, drift = (tuple(map(form, row)) for row in (tableau.kick, tableau.drift))
    return Coefficients(tableau=tableau, kick=kick, drift=drift, digits=digits, rounding=rounding)


def _with_point(number: Decimal) -> str:
    """Return ``number`` without an exponent and with a decimal point, which some languages need in a real number."""
    text = format(number, "f")
    return text if "." in text else f"{text}.0"
