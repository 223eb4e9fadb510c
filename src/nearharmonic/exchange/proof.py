"""Proofs about the coefficients of a file: the nearest registered method, residuals, and suspected digits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache
from itertools import combinations, islice, pairwise, product
from math import comb, factorial
from typing import NamedTuple

import numpy as np

from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.words import LETTERS, Step, composed, logarithm, logarithm_slopes
from nearharmonic.exchange.files import LONGEST_NUMBER, CoefficientFile
from nearharmonic.exchange.method import is_palindrome, size_of, step_of, uncertainty_of, with_roles_exchanged
from nearharmonic.integrators import plain_integrators
from nearharmonic.integrators.tableau import First, Row, Tableau
from nearharmonic.theory.order_conditions import errors_on_words, weighted

# --- Search for the registered method nearest to given coefficients, for any roles, direction and scale.
#
# A step and its reversed step have the same distance to a palindrome. A registered method that is no palindrome is
# compared in both directions.

#: Fraction of the coefficients that must agree so that the others count as wrong digits of the method.
MOST = Fraction(1, 2)


@dataclass(frozen=True, kw_only=True)
class Likeness:
    """Comparison of a registered method with a step.

    Before it the roles of the method may be exchanged, its direction reversed, and its rows multiplied by the sums of
    the rows of the step. ``differing`` has position, value, and value in the method (in the scale of the step) of each
    coefficient that differs by more than the digits of both allow. ``distance`` is the largest difference of two of the
    ``compared`` coefficients.
    """

    tableau: Tableau
    exchanged: bool
    reversed: bool
    rescaled: bool
    differing: tuple[tuple[str, Fraction, Fraction], ...]
    distance: Fraction
    compared: int

    @property
    def is_same(self) -> bool:
        """True if all coefficients agree with the method, to the digits of both."""
        return not self.differing

    @property
    def is_recognised(self) -> bool:
        """True if enough coefficients agree, so that the differing ones look wrong."""
        return len(self.differing) <= MOST * self.compared


def nearest(step: Step) -> Likeness | None:
    """Return the registered splitting method with the most equal coefficients and the smallest difference.

    It is None if no method has as many flows.
    """
    found = [likeness for tableau in plain_integrators.values() for likeness in _likenesses(step, tableau)]
    # Candidates with fewer changes come first, and min returns the first of equal candidates.
    return min(found, key=lambda one: (len(one.differing), one.distance), default=None)


def _likenesses(step: Step, tableau: Tableau) -> Iterator[Likeness]:
    registered = step_of(tableau.kick, tableau.drift, tableau.first, tableau.digits)
    if len(registered) != len(step):
        return
    directions = (False,) if tableau.symmetric else (False, True)
    for (scale, rescaled), backwards, exchanged in product(_scales(step), directions, (False, True)):
        other = with_roles_exchanged(registered) if exchanged else registered
        other = other[::-1] if backwards else other
        if other[0][0] == step[0][0]:
            differing, distance = _difference(step, other, scale)
            yield Likeness(
                tableau=tableau, exchanged=exchanged, reversed=backwards, rescaled=rescaled,
                differing=differing, distance=distance, compared=len(step),
            )  # fmt: skip


def _scales(step: Step) -> Iterator[tuple[dict[str, Fraction], bool]]:
    """Return factors of drifts and kicks: 1, and the sums of the rows of the step if these clearly differ from 1."""
    yield dict.fromkeys(LETTERS, Fraction(1)), False
    sums = {letter: sum((c for x, c in step if x == letter), Fraction(0)) for letter in LETTERS}
    if all(sums.values()) and any(abs(x - 1) > Fraction(1, 10**6) for x in sums.values()):
        yield sums, True


def _difference(
    step: Step, other: Step, scale: dict[str, Fraction]
) -> tuple[tuple[tuple[str, Fraction, Fraction], ...], Fraction]:
    differing, largest = [], Fraction(0)
    for (letter, a), (_, b) in zip(step, other, strict=True):
        expected = b * scale[letter]
        distance = abs(a - expected)
        largest = max(largest, distance)
        if distance > a.uncertainty + b.uncertainty * abs(scale[letter]):
            differing.append((a.place, a, expected))
    return tuple(differing), largest


# --- Exact residuals of the order conditions of a step, and their bounds due to the digits of its coefficients.
#
# Let c be the coefficients of a file. Each differs by at most u_i, a few units of its last digit, from the number that
# its author rounded. One coefficient of each row may in addition have been changed to make the sum of the row exact, by
# at most the sum of the u_i of the row. A condition of degree n is a polynomial r(c) of degree n, and with g_i =
# dr/dc_i
#
#     |r(c) - r(true c)|  <=  sum_i |g_i| u_i  +  sum_rows max |g_i| sum u_i  +  2 U^2 d^2/dM^2 [f_n M^n]  at M + 2 U,
#
# with M the sum of all |c_i| and U the sum of all u_i. This is Taylor's formula. The second derivative is bounded by
# replacing every term of log(product of exponentials) by its absolute value; f_n = [x^n] (-log(2 - e^x)). The true
# coefficients fulfil a condition only if |r(c)| is within this bound. A larger residual therefore proves that no
# coefficients that round to the given ones fulfil the condition. A residual within the bound is zero to the given
# digits; more cannot be concluded from them.

#: Addition to the bound for the rounding errors of derivatives in double precision, relative to the bound of the
#: derivatives.
ROUNDING = Fraction(1, 10**9)


class Residual(NamedTuple):
    """The value of a condition of ``degree`` in tau, and its bound by the digits of the coefficients; both exact."""

    degree: int
    value: Fraction
    allowed: Fraction

    @property
    def vanishes(self) -> bool:
        """True if the value is zero to the digits given."""
        return abs(self.value) <= self.allowed


class Order(NamedTuple):
    """An order, the first residual that fails (None if all examined conditions hold), and the largest that vanishes.

    The largest residual is in units of its bound.
    """

    order: int
    failing: Residual | None
    largest: Residual


def proved_order(step: Step, highest: int, *, quadratic: bool, potential_degree: int | None = None) -> Order:
    """Return the order of a step for every separable H, or for every H with quadratic T; at most ``highest``.

    ``potential_degree`` is the degree of V, for T = p.p/2; None is for every V.
    """
    largest = Residual(1, Fraction(0), Fraction(0))
    for degree in range(1, highest + 1):
        found = residuals(step, degree, quadratic=quadratic, potential_degree=potential_degree)
        failing = [one for one in found if not one.vanishes]
        if failing:
            return Order(degree - 1, max(failing, key=lambda one: abs(one.value)), largest)
        largest = max([largest, *found], key=lambda one: abs(one.value) / one.allowed if one.allowed else 0)
    return Order(highest, None, largest)


def residuals(step: Step, degree: int, *, quadratic: bool, potential_degree: int | None = None) -> list[Residual]:
    """Return the residual of each condition of ``degree``.

    A palindrome with step -tau is the inverse of the step with tau, so that its conditions of even degree hold.
    """
    rows = conditions(degree, quadratic=quadratic, potential_degree=potential_degree)
    if degree % 2 == 0 and is_palindrome(step, exactly=True):
        return [Residual(degree, Fraction(0), Fraction(0)) for _ in rows]
    errors = errors_on_words(step, degree)
    allowed = allowances(step, degree, [row.weights for row in rows])
    return [Residual(degree, weighted(row, errors), most) for row, most in zip(rows, allowed, strict=True)]


def allowances(step: Step, degree: int, weights: Sequence[Sequence[Fraction]]) -> list[Fraction]:
    """Return the bound, due to the digits, of the error of each weighted sum of coefficients on Lyndon words."""
    total = uncertainty_of(step)
    if total == 0:
        return [Fraction(0)] * len(weights)
    size = size_of(step)
    slack = ROUNDING * total * degree * majorant(degree) * size ** (degree - 1)
    slack += 2 * total**2 * degree * (degree - 1) * majorant(degree) * (size + 2 * total) ** max(degree - 2, 0)
    return [linear_allowance(step, row) + slack for row in _gradients(step, degree, weights)]


def linear_allowance(step: Step, gradient: Iterable[float]) -> Fraction:
    """Return the bound, due to the digits, of the first-order error of a function with this ``gradient``."""
    slopes = [abs(Fraction(float(g))) for g in gradient]
    single = sum((g * c.uncertainty for g, (_, c) in zip(slopes, step, strict=True)), Fraction(0))
    for letter in LETTERS:
        row = [(g, c.uncertainty) for g, (x, c) in zip(slopes, step, strict=True) if x == letter]
        single += max((g for g, _ in row), default=Fraction(0)) * sum((u for _, u in row), Fraction(0))
    return single


def _gradients(step: Step, degree: int, weights: Sequence[Sequence[Fraction]]) -> np.ndarray:
    """Return the derivatives (weights, flows) of the weighted sums by the coefficients, in double precision."""
    slopes = logarithm_slopes([(letter, float(c)) for letter, c in step], lyndon_words(degree))
    result: np.ndarray = np.array(weights, dtype=float) @ np.stack(list(slopes.values()))
    return result


@cache
def majorant(degree: int) -> Fraction:
    """Return f_n, the coefficient of x^n in -log(2 - e^x), n >= 1."""
    # Its derivative is e^x / (2 - e^x) = 2 / (2 - e^x) - 1, and 1 / (2 - e^x) generates the Fubini numbers.
    return Fraction((2 if degree > 1 else 1) * _fubini(degree - 1), factorial(degree))


@cache
def _fubini(n: int) -> int:
    return 1 if n == 0 else sum(comb(n, k) * _fubini(n - k) for k in range(1, n + 1))


# --- Search for a single transcription error that explains the failed claims of a file.
#
# All single changes are tried: another digit, another sign, and exchanged adjacent digits, coefficients, lines or
# roles. The sum of the row or a check in double precision excludes most changes. For the remaining ones all claims
# have to be proved.

#: Maximum numbers of changes for which the claims are proved, and of changes that are reported.
MOST_PROVED, MOST_REPORTED = 40, 3
#: Highest degree of the conditions that are checked in double precision, and the tolerance there.
FILTER_DEGREE, FILTER_TOLERANCE = 3, 1e-10
#: Number of digits of a coefficient that are changed one by one together with the middle coefficient of its row.
LEADING_DIGITS = 12


class Rows(NamedTuple):
    """The rows of a file, and the operator that is applied first."""

    kick: Row
    drift: Row
    first: First


class Suspect(NamedTuple):
    """An error that explains the failed claims: in words, with the corrected rows."""

    says: str
    rows: Rows


def suspects(file: CoefficientFile, digits: int, proves: Callable[[Rows], bool], degree: int) -> list[Suspect]:
    """Return the single changes of a file for which ``proves`` says that all its claims hold.

    The coefficients have so many significant digits, 0 if they are exact. The claims imply an order ``degree``;
    conditions up to it are checked in double precision.
    """
    rows = Rows(file.kick, file.drift, file.first)
    tolerance = max(FILTER_TOLERANCE, 10.0 ** (3 - digits)) if digits else FILTER_TOLERANCE
    seen, proved = {rows}, 0
    found: list[Suspect] = []
    balanced = all(abs(sum(map(float, row)) - 1) <= tolerance for row in (rows.kick, rows.drift))
    # Changes that keep the sums cannot correct wrong sums.
    keeping = (_exchanges, _closed_edits) if balanced else ()
    for group in (_roles, _mirrors, _single_edits, *keeping):
        candidates = list({one.rows: one for one in group(rows) if one.rows not in seen}.values())
        seen.update(one.rows for one in candidates)
        for one in _plausible(candidates, min(degree, FILTER_DEGREE), tolerance):
            if proved == MOST_PROVED or len(found) == MOST_REPORTED:
                return found
            proved += 1
            if proves(one.rows):
                found.append(one)
        if found:  # a simpler error explains the failure
            break
    return found


def _plausible(candidates: Sequence[Suspect], degree: int, tolerance: float) -> Iterator[Suspect]:
    """Return the ``candidates`` whose conditions up to ``degree`` hold in double precision."""
    for start in range(0, len(candidates), 4096):
        by_first: dict[First, list[Suspect]] = {}
        for one in candidates[start : start + 4096]:
            by_first.setdefault(one.rows.first, []).append(one)
        for first, members in by_first.items():
            kicks, drifts = (
                np.array([list(map(float, row)) for row in rows]).T
                for rows in zip(*((one.rows.kick, one.rows.drift) for one in members), strict=True)
            )
            found = logarithm(
                composed(first, kicks, drifts), [w for n in range(1, degree + 1) for w in lyndon_words(n)]
            )
            worst = np.max([abs(error - (len(word) == 1)) for word, error in found.items()], axis=0)
            yield from (one for one, error in zip(members, worst, strict=True) if error <= tolerance)


def _roles(rows: Rows) -> Iterator[Suspect]:
    other: First = "drift" if rows.first == "kick" else "kick"
    if len(rows.kick) == len(rows.drift):
        yield Suspect(f"the first operator: with the {other} first, the rows as they are, every claim holds",
                      rows._replace(first=other))  # fmt: skip
        yield Suspect("the rows kick and drift: exchanged, with the same operator first, every claim holds",
                      rows._replace(kick=rows.drift, drift=rows.kick))  # fmt: skip
    yield Suspect(f"the roles: with the drifts as kicks and the kicks as drifts, the {other} first, every claim holds",
                  Rows(rows.drift, rows.kick, other))  # fmt: skip


def _mirrors(rows: Rows) -> Iterator[Suspect]:
    """Replace a coefficient by its mirror image, where the two differ."""
    for key in ("kick", "drift"):
        row: Row = getattr(rows, key)
        for i, text in enumerate(row):
            mirror = row[-1 - i]
            if Fraction(text) != Fraction(mirror):
                image = f"its mirror image {key}[{len(row) - 1 - i}]"
                says = f"{key}[{i}] = {text}: with {mirror}, as {image}, every claim holds"
                yield Suspect(says, _changed(rows, key, {i: mirror}))


def _single_edits(rows: Rows) -> Iterator[Suspect]:
    """Change one coefficient, or one and its mirror image, if this makes the sum of the row 1."""
    for key in ("kick", "drift"):
        row: Row = getattr(rows, key)
        excess, palindrome = sum(map(Fraction, row), Fraction(-1)), _is_palindrome(row)
        if not excess:
            continue
        nearly = abs(excess) / 10**6
        for i, new, what in _edits_of(row):
            changes = {i: new, len(row) - 1 - i: new} if palindrome else {i: new}
            change = len(changes) * (Fraction(new) - Fraction(row[i]))
            if abs(excess + change) <= nearly:
                yield Suspect(_edit_says(key, row, changes, what), _changed(rows, key, changes))


def _exchanges(rows: Rows) -> Iterator[Suspect]:
    """Exchange two coefficients of a row, with their mirror images in a palindrome, or two lines of both rows."""
    for key in ("kick", "drift"):
        row: Row = getattr(rows, key)
        palindrome = _is_palindrome(row)
        for i, j in combinations(range(len(row)), 2):
            changes = {i: row[j], j: row[i]}
            says = f"{key}[{i}] and {key}[{j}]: exchanged, every claim holds"
            if palindrome:
                if 2 * j > len(row) - 1:  # its mirror image is in the first half
                    continue
                changes |= {len(row) - 1 - k: text for k, text in changes.items()}
                says = f"{key}[{i}] and {key}[{j}]: exchanged, as their mirror images, every claim holds"
            yield Suspect(says, _changed(rows, key, changes))
    for i, j in combinations(range(min(len(rows.kick), len(rows.drift))), 2):
        changed = _changed(rows, "kick", {i: rows.kick[j], j: rows.kick[i]})
        changed = _changed(changed, "drift", {i: rows.drift[j], j: rows.drift[i]})
        yield Suspect(f"lines {i} and {j} of kick and drift: exchanged, every claim holds", changed)


def _closed_edits(rows: Rows) -> Iterator[Suspect]:
    """Change a coefficient and its mirror image, and the middle coefficient so that the sum of the row is 1."""
    for key in ("kick", "drift"):
        row: Row = getattr(rows, key)
        middle = sorted({(len(row) - 1) // 2, len(row) // 2})
        if not _is_palindrome(row) or len(row) < 3:
            continue
        for i, new, what in _edits_of(row, LEADING_DIGITS):
            if i in middle:
                continue
            changes = {i: new, len(row) - 1 - i: new}
            with localcontext(prec=3 * LONGEST_NUMBER):
                change = 2 * (Decimal(new) - Decimal(row[i])) / len(middle)
                closing = {k: format(Decimal(row[k]) - change, "f") for k in middle}
            says = f"{_edit_says(key, row, changes, what)}, {key}[{middle[0]}] closing the sum"
            yield Suspect(says, _changed(rows, key, changes | closing))


def _edits_of(row: Row, digits: int | None = None) -> Iterator[tuple[int, str, str]]:
    """Yield (index, new text, kind) for each change of the sign, of a digit, or of two adjacent digits.

    Only the first half of a palindrome and the first ``digits`` digits of a number are changed.
    """
    last = (len(row) + 1) // 2 if _is_palindrome(row) else len(row)
    for i, text in enumerate(row[:last]):
        if Fraction(text):
            yield i, text[1:] if text[0] == "-" else f"-{text.lstrip('+')}", "the other sign"
        mantissa = text.lower().partition("e")[0]
        places = list(islice((k for k, letter in enumerate(mantissa) if letter.isdigit()), digits))
        for k in places:
            for digit in "0123456789".replace(text[k], ""):
                what = f"{digit} for {text[k]} as {_decimal_place(text, k)}"
                yield i, f"{text[:k]}{digit}{text[k + 1 :]}", what
        for k, n in pairwise(places):
            if text[k] != text[n]:
                swapped = f"{text[:k]}{text[n]}{text[k + 1 : n]}{text[k]}{text[n + 1 :]}"
                yield i, swapped, "two neighbouring digits exchanged"


def _decimal_place(text: str, k: int) -> str:
    point = text.find(".")
    return f"decimal {k - point}" if 0 <= point < k else "digit before the point"


def _edit_says(key: str, row: Row, changes: dict[int, str], what: str) -> str:
    (i, new), *others = changes.items()
    image = f" and its mirror image {key}[{others[0][0]}]" if others else ""
    return f"{key}[{i}]{image} = {row[i]}: with {what}, {new}, every claim holds"


def _is_palindrome(row: Row) -> bool:
    numbers = [Fraction(text) for text in row]
    return numbers == numbers[::-1]


def _changed(rows: Rows, key: str, changes: dict[int, str]) -> Rows:
    row = list(getattr(rows, key))
    for i, text in changes.items():
        row[i] = text
    return rows._replace(kick=tuple(row)) if key == "kick" else rows._replace(drift=tuple(row))
