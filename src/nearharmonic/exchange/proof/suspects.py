"""Search for a single transcription error that explains the failed claims of a file.

All single changes are tried: another digit, another sign, and exchanged adjacent digits, coefficients, lines or roles.
The sum of the row or a check in double precision excludes most changes. For the remaining ones all claims have to be
proved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import combinations, islice, pairwise
from typing import NamedTuple

import numpy as np

from nearharmonic.exact.lie.conditions import lyndon_words
from nearharmonic.exact.step import composed
from nearharmonic.exact.words import logarithm
from nearharmonic.exchange.coefficient_file import LONGEST_NUMBER, CoefficientFile
from nearharmonic.integrators.tableau import First, Row

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
    """Return the single changes of a file for which all its claims hold.

    Parameters
    ----------
    file : CoefficientFile
        The coefficients.
    digits : int
        Significant digits that they have, 0 if they are exact.
    proves : function
        Returns True if all claims hold for the given rows.
    degree : int
        Order that the claims imply; conditions up to it are checked in double precision.
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
