"""The coefficients of a tableau, rounded to the digits of a file."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Context, Decimal

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import First, Row, Tableau

#: Number of significant decimal digits that distinguishes any two doubles.
DOUBLE_DIGITS = 17


@dataclass(frozen=True, kw_only=True)
class Coefficients:
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
        The integrator has modified potentials.
    """

    tableau: Tableau
    kick: Row
    drift: Row
    digits: int
    rounding: str

    def __post_init__(self) -> None:
        if self.tableau.modified:
            allowed = "its kicks are of a modified potential, which no other program and no file format has"
            raise bad_setting("integrator", self.tableau.name, allowed)

    @property
    def operators(self) -> tuple[First, First]:
        """The operator that comes first and last in a step, and the one in between."""
        return ("kick", "drift") if self.tableau.first == "kick" else ("drift", "kick")

    @property
    def outer(self) -> Row:
        """The s + 1 coefficients of the operator that comes first and last in a step."""
        return self.kick if self.tableau.first == "kick" else self.drift

    @property
    def inner(self) -> Row:
        """The s coefficients of the operator in between."""
        return self.drift if self.tableau.first == "kick" else self.kick


def as_registered(tableau: Tableau) -> Coefficients:
    """Return the coefficients of ``tableau`` with all digits that it has; exponents are written out."""
    return Coefficients(
        tableau=tableau,
        kick=tuple(format(Decimal(text), "f") for text in tableau.kick),
        drift=tuple(format(Decimal(text), "f") for text in tableau.drift),
        digits=tableau.digits,
        rounding=f"not rounded; the source guarantees {tableau.digits} digits",
    )


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
    context = Context(prec=digits)
    return Coefficients(
        tableau=tableau,
        kick=tuple(_with_point(context.create_decimal(text)) for text in tableau.kick),
        drift=tuple(_with_point(context.create_decimal(text)) for text in tableau.drift),
        digits=digits,
        rounding=f"rounded to {digits} significant digits",
    )


def nearest_doubles(tableau: Tableau) -> Coefficients:
    """Return the shortest decimals that read as the doubles nearest to the coefficients of ``tableau``.

    Rounding to seventeen digits is not enough: a reader rounds the result to a double, and the second rounding may
    differ.
    """
    return Coefficients(
        tableau=tableau,
        kick=tuple(_with_point(Decimal(repr(float(text)))) for text in tableau.kick),
        drift=tuple(_with_point(Decimal(repr(float(text)))) for text in tableau.drift),
        digits=min(tableau.digits, DOUBLE_DIGITS),
        rounding="the nearest doubles, in the shortest decimals that read as them",
    )


def _with_point(number: Decimal) -> str:
    """Return ``number`` without an exponent and with a decimal point, which some languages need in a real number."""
    text = format(number, "f")
    return text if "." in text else f"{text}.0"
