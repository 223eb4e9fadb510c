"""Tables of results: CSV files read as columns, and differences between two of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from math import inf, isfinite
from typing import Any

from nearharmonic.reproduction.record.compare.differences import Difference, missing
from nearharmonic.reproduction.record.files.texts import Texts

Rows = list[list[str]]


def table_differences(name: str, a: Texts, b: Texts, leave_out: Collection[str]) -> Iterator[Difference]:
    """Yield the differences of each column between the CSV files with one name in two results.

    Rows are matched by the first columns of text that identify them uniquely, or else by their position.

    Parameters
    ----------
    name : str
        Name of the file.
    a, b : Texts
        The results.
    leave_out : collection of str
        Columns that are not compared, ``"*"`` for all.

    Raises
    ------
    ResultFileError
        A file that is damaged, or no table.
    """
    tables = a.table(name), b.table(name)
    (header_a, rows_a), (header_b, rows_b) = ((table.header, table.rows) for table in tables)
    for column in [*header_a, *(column for column in header_b if column not in header_a)]:
        if column not in leave_out and (column not in header_a or column not in header_b):
            yield missing(f"{name}: {column}", in_a=column in header_a)
    columns = [c for c in header_a if c in header_b and c not in leave_out]
    one = [[row[header_a.index(c)] for c in columns] for row in rows_a]
    other = [[row[header_b.index(c)] for c in columns] for row in rows_b]
    texts = [i for i in range(len(columns)) if not all(_is_number(row[i]) for row in [*one, *other])]
    names = _naming(one, other, texts)
    pairs = _paired(one, other, names)
    if len(pairs) < max(len(one), len(other)):
        more = [f"{len(rows) - len(pairs) or 'no'} more" for rows in (one, other)]
        yield Difference(kind="missing", where=f"{name}: rows", a=more[0], b=more[1])
    at = [" ".join(one[j][i] for i in names) or str(j + 1) for j, _ in pairs]
    for i, column in enumerate(columns):
        found = _column_difference(f"{name}: {column}", [(one[j][i], other[k][i]) for j, k in pairs], at)
        if found:
            yield found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True


def _naming(one: Rows, other: Rows, texts: Sequence[int]) -> Sequence[int]:
    """Return the first columns of text that identify the rows of both tables uniquely, if there are any."""
    for end in range(1, len(texts) + 1):
        if all(len({tuple(row[i] for i in texts[:end]) for row in rows}) == len(rows) for rows in (one, other)):
            return texts[:end]
    return ()


def _paired(one: Rows, other: Rows, names: Sequence[int]) -> list[tuple[int, int]]:
    """Return the matching rows, by names, or else by position."""
    if not names:
        return [(j, j) for j in range(min(len(one), len(other)))]
    place = {tuple(row[i] for i in names): k for k, row in enumerate(other)}
    keys = [tuple(row[i] for i in names) for row in one]
    return [(j, place[key]) for j, key in enumerate(keys) if key in place]


def _column_difference(where: str, cells: Sequence[tuple[str, str]], at: Sequence[str]) -> Difference | None:
    """Return the difference of a column, None if it is equal."""
    numbers = all(_is_number(a) and _is_number(b) for a, b in cells)
    distances = [0.0 if a == b else _relative(a, b) if numbers else 1.0 for a, b in cells]
    differ = sum(distance > 0 for distance in distances)
    if not differ:
        return None
    i = max(range(len(cells)), key=distances.__getitem__)
    a, b = cells[i]
    return Difference(
        kind="number" if numbers else "text",
        where=where,
        a=_cell(a) if numbers else a,
        b=_cell(b) if numbers else b,
        relative=distances[i] if numbers else None,
        at={"row": at[i]},
        differ=differ,
        compared=len(cells),
    )


def _relative(a: str, b: str) -> float:
    """Return |a - b| / max(|a|, |b|) of two cells, with all their digits."""
    try:
        one, other = Decimal(a), Decimal(b)
    except InvalidOperation:  # one of them is empty
        return inf
    if not (one.is_finite() and other.is_finite()):
        return 0.0 if float(a) == float(b) or {one.is_nan(), other.is_nan()} == {True} else inf
    # Decimals are subtracted exactly; only the difference is rounded.
    scale = max(abs(one), abs(other))
    return float(abs(one - other) / scale) if scale else 0.0


def _cell(text: str) -> Any:
    """Return a number of a table, as a float if this loses no digit."""
    try:
        number = float(text)
    except ValueError:
        return text
    return number if not isfinite(number) or Decimal(repr(number)) == Decimal(text) else text
