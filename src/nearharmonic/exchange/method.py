"""Steps of coefficients: kicks and drifts in double precision, compositions, rows for a file, names in programs."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from fractions import Fraction
from functools import cached_property
from itertools import groupby
from statistics import median_low
from textwrap import wrap
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from nearharmonic import __version__
from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.exact.words import Step, composed
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Composition, First, OneStepMethod, Row, Tableau

# --- The method of another library: kicks and drifts in double precision.

Flow = Literal["kick", "drift"]

#: Relative difference of two forces that rounding may cause, for a sum of a thousand terms.
ROUNDING = 1e-12
#: Sizes of the velocities at which a force is compared, relative to the largest velocity of the state.
SIZES = (1.0, 2.0**-10, 2.0**10)
#: Angle in radians: cosines of its multiples are spread evenly, without a period.
GOLDEN_ANGLE = np.pi * (3 - 5**0.5)


@dataclass(frozen=True)
class Move:
    """A kick, p -= coefficient tau dV/dq, or a drift, q += coefficient tau dT/dp."""

    flow: Flow
    coefficient: float


@dataclass(frozen=True)
class Method:
    """A splitting method of plain kicks and drifts, in double precision.

    A step has ``stages + 1`` moves of the outer operator and ``stages`` of the inner one in turns.
    """

    tableau: Tableau
    moves: tuple[Move, ...]

    @cached_property
    def flows(self) -> tuple[Move, ...]:
        """The moves except moves of length 0, which would waste a force or divide by zero."""
        return tuple(move for move in self.moves if move.coefficient)

    @property
    def first(self) -> First:
        """The operator that begins and ends a step."""
        return self.tableau.first

    @property
    def stages(self) -> int:
        """Forces of a step, if the last kick of a step and the first of the next share one."""
        return self.tableau.stages

    @property
    def joint(self) -> Move:
        """The last move of a step and the first of the next as one: a library that allows it shares their force."""
        return Move(self.moves[0].flow, self.moves[-1].coefficient + self.moves[0].coefficient)


def method_for(library: str, method: str | Tableau) -> Method:
    """Return a method for a library, named as it writes itself, that evaluates the forces of V and nothing else."""
    tableau = method if isinstance(method, OneStepMethod) else integrators[method]
    if tableau.implicit:
        raise SettingError(
            f"{tableau.name} cannot run in {library}: it is implicit, and no sequence of kicks and drifts"
        )
    if tableau.modified:
        reason = f"its modified potentials need the gradient of |grad V|^2, for which {library} has no hook"
        raise SettingError(f"{tableau.name} cannot run in {library}: {reason}")
    if tableau.processed:
        raise SettingError(
            f"{tableau.name} cannot run in {library}: its processor must be undone before each output, and {library} "
            f"does not say when it reads the state"
        )
    outer, inner = tableau.rows_double()
    names: tuple[Flow, Flow] = ("kick", "drift") if tableau.first == "kick" else ("drift", "kick")
    moves = [Move(names[0], outer[0])]
    for c_inner, c_outer in zip(inner, outer[1:], strict=True):
        moves += [Move(names[1], c_inner), Move(names[0], c_outer)]
    return Method(tableau, tuple(moves))


@dataclass
class VelocityCheck:
    """Comparisons of a force from outside at one position and several velocities, in a few steps of a run.

    The first comparison takes three further velocities, of all :data:`SIZES`, and each later one a single velocity.
    Components of a velocity differ, so that forces of velocity differences are found as well. ``compared`` counts the
    velocities, each of which costs a force; ``step`` is the number of steps before the last comparison.
    """

    compared: int = 0
    step: int = 0

    def due(self, step: int, *, last: bool = False) -> bool:
        """Return True before steps 1, 2, 3, 5, 9, ..., and the last step unless a comparison was in the last fifth."""
        return not self.compared or step >= 2 * max(self.step, 0.5) or (last and 4 * step > 5 * self.step)

    def direction(self, size: int) -> Any:
        """Return ``size`` different numbers from -1 to 1, which change with each comparison."""
        return np.cos(GOLDEN_ANGLE * (self.compared + 1) * np.arange(1, size + 1))

    def finds(self, force: Callable[[Any], Any], velocities: Any, step: int, known: Any = None) -> bool:
        """Return True if a force depends on velocities, after this number of steps.

        ``force`` maps velocities, or momenta, to forces or accelerations at the time and the positions of a state.
        ``known`` is the force at the ``velocities`` of the state; by default it is evaluated.
        """
        known = force(velocities) if known is None else known
        if not np.isfinite(known).all():
            return False
        scale, bound = float(np.abs(velocities).max()) or 1.0, ROUNDING * np.abs(known).max()
        self.step = step
        for _ in range(1 if self.compared else len(SIZES)):
            shift = SIZES[self.compared % len(SIZES)] * scale * self.direction(np.size(velocities))
            self.compared += 1
            other = shift.reshape(np.shape(velocities))
            there = force(other)
            if np.abs(there - known).max() > bound and self._differ(force, velocities, other, there, bound):
                return True
        return False

    @staticmethod
    def _differ(force: Callable[[Any], Any], velocities: Any, other: Any, there: Any, bound: float) -> bool:
        """Return True if forces at two velocities differ by more than repetitions of the one ``there`` do.

        A force may be a sum of threads in any order, or an iteration that stops early.
        """
        for _ in range(4):
            here, again = force(velocities), force(other)
            noise, there = np.abs(again - there).max(), again
            if np.abs(again - here).max() <= max(bound, 10 * noise):
                return False
        return True


# --- A step as a product of drifts and kicks, with the uncertainty of each coefficient due to its digits.

#: Numbers with at most this number of significant digits are considered exact: no source rounds a method to four
#: digits.
EXACT_DIGITS = 4
#: Decimals that represent doubles have 16 to 18 significant digits, and 16 of them are reliable.
DOUBLE_DIGITS, LONGEST_DOUBLE = 16, 18
#: Maximum error of a coefficient in units of its last digit. A truncated number has an error of up to one unit, and the
#: iterations for published coefficients ended with errors of one or two units.
LAST_DIGIT = 3


class Printed(Fraction):
    """A printed coefficient of a step: the exact value of its decimals, and the bound of their rounding error.

    ``place`` is its position in the file, such as "kick[2]"; several if adjacent flows of one operator were joined.
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
        """Number of digits, as text."""
        return f"{self.number} digits" if self.number else "exact coefficients"


def digits_of(file: Any) -> Digits:
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


#: Number of significant decimal digits that distinguishes any two doubles.
DISTINGUISHING_DIGITS = 17


# --- The coefficients of a tableau, rounded to the digits of a file.
@dataclass(frozen=True, kw_only=True)
class Coefficients(Composition):
    """The rows of a tableau as they are written to a file, decimal numbers without exponents.

    ``digits`` are the significant digits to which the rows are rounded, or those that the source guarantees;
    ``rounding`` says in one sentence how the rows are rounded.
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
    """Return the coefficients of ``tableau`` rounded to ``digits`` significant digits, ties to even."""
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
    digits = min(tableau.digits, DISTINGUISHING_DIGITS)
    return _written(tableau, lambda text: _with_point(Decimal(repr(float(text)))), digits, rounding)


def _written(tableau: Tableau, form: Callable[[str], str], digits: int, rounding: str) -> Coefficients:
    kick, drift = (tuple(map(form, row)) for row in (tableau.kick, tableau.drift))
    return Coefficients(tableau=tableau, kick=kick, drift=drift, digits=digits, rounding=rounding)


def _with_point(number: Decimal) -> str:
    """Return ``number`` without an exponent and with a decimal point, which some languages need in a real number."""
    text = format(number, "f")
    return text if "." in text else f"{text}.0"


# --- Description of an integrator at the head of an exported program, and its names in the program.

#: Columns of a comment.
WIDTH = 96
#: Maximum length of an identifier in all languages: Fortran allows 63 characters, and some names get a suffix.
LONGEST_IDENTIFIER = 40


def head(coefficients: Coefficients, mark: str, *remarks: str) -> str:
    """Return the comment at the head of a program: the integrator, its first operator, its source, and ``remarks``.

    ``mark`` begins a comment line in the language. Each remark about the target is a paragraph.
    """
    return comment([*_description(coefficients), *remarks], mark)


def _description(coefficients: Coefficients) -> Iterator[str]:
    tableau = coefficients.tableau
    yield f"{tableau.label}: symplectic integrator for H(q, p) = T(p) + V(q), written by nearharmonic {__version__}."
    yield f"Name: {tableau.name}. {_orders(tableau)}"
    sequence = _sequence(*coefficients.operators, tableau.stages)
    yield (
        f"First: {tableau.first}. A step of length tau is {sequence}. A kick with coefficient c is p -= c tau dV/dq, a "
        "drift with coefficient c is q += c tau dT/dp."
    )
    if tableau.requires is not None:
        yield (
            f"Requires: a {tableau.requires}, T = p.p/2 or p.A p/2 with a constant matrix A. For any other T, or "
            f"if the two rows exchange their roles, only order {1 + tableau.symmetric} is certain."
        )
    elif tableau.harmonic_order is not None:
        yield "The harmonic order is lost if the two rows exchange their roles."
    if not tableau.symmetric:
        yield "Not symmetric: a step of -tau does not undo a step of tau."
    yield f"Coefficients: {coefficients.rounding}."
    yield f"Source: {tableau.source}"


def _orders(tableau: Tableau) -> str:
    harmonic = "" if tableau.harmonic_order is None else f" Harmonic order: {tableau.harmonic_order}."
    return f"Order: {tableau.order}.{harmonic} Stages (force evaluations per step): {tableau.stages}."


def _sequence(outer: str, inner: str, stages: int) -> str:
    """Return the substeps of a step in order, such as kick[0], drift[0], kick[1]."""
    if stages == 1:
        return f"{outer}[0], {inner}[0], {outer}[1]"
    between = ", ..., " if stages > 2 else ", "
    return f"{outer}[0], {inner}[0], {outer}[1]{between}{inner}[{stages - 1}], {outer}[{stages}]"


def comment(paragraphs: list[str], mark: str) -> str:
    """Return ``paragraphs`` as comment lines that begin with ``mark``.

    Line ends in a user's label or source become spaces. A backslash at the end of a line would continue the comment.
    """
    lines = []
    for paragraph in paragraphs:
        lines += wrap(paragraph, WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return "\n".join(f"{mark} {line}." if line.endswith("\\") else f"{mark} {line}" for line in lines)


def identifier(tableau: Tableau) -> str:
    """Return the name of ``tableau`` as an identifier of C, Fortran, Julia and Python."""
    name = re.sub(r"\W+", "_", tableau.name, flags=re.ASCII).strip("_").lower()[:LONGEST_IDENTIFIER]
    return name if name[:1].isalpha() else f"method_{name}".rstrip("_")


def elements(row: Row, form: str = "{}", separator: str = ",") -> str:
    """Return the numbers of ``row``, one per line.

    ``form`` is the format of a number in the language. ``separator`` ends each line; the last line has it only if it is
    a comma.
    """
    lines = [f"    {form.format(text)}" for text in row]
    return f"{separator}\n".join(lines) + ("," if separator == "," else "")


def names(coefficients: Coefficients, form: str = "{}", separator: str = ",") -> dict[str, str]:
    """Return the names of the integrator and its operators, and its rows as :func:`elements`, for a template."""
    outer, inner = coefficients.operators
    rows = {row: elements(getattr(coefficients, row), form, separator) for row in ("kick", "drift")}
    return {
        "name": identifier(coefficients.tableau),
        "stages": str(coefficients.stages),
        **rows,
        "outer": outer,
        "OUTER": outer.upper(),
        "outer_rows": rows[outer],
        "inner": inner,
        "INNER": inner.upper(),
        "inner_rows": rows[inner],
    }


def remarks_of_python(coefficients: Coefficients, own_force: str, doubles: str) -> list[str]:
    """Return the remarks that apply to the integrator in a Python library.

    ``own_force`` is the reason for ``{count}`` force evaluations per step of a method with kicks at both ends.
    ``doubles`` is the treatment of more digits than doubles have.
    """
    remarks = []
    if coefficients.first_same_as_last:
        remarks.append(own_force.format(count=coefficients.stages + 1))
    if coefficients.digits > DISTINGUISHING_DIGITS:
        remarks.append(doubles)
    return remarks
