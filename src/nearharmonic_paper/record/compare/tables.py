"""Tables of results: CSV files read as columns, and differences between two of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal, InvalidOperation
from math import inf, isfinite
from typing import Any

import pandas as pd

from nearharmonic_paper.record.compare.differences import Difference, missing
from nearharmonic_paper.record.files.texts import Texts


def table_differences(name: str, a: Texts, b: Texts, leave_out: Collection[str]) -> Iterator[Difference]:
    """Yield the differences of each column between the CSV files with one name in two results.

    Rows are matched by the first columns of text that identify them uniquely, or else by their position.

    Columns in ``leave_out`` are not compared.

    Raises
    ------
    ResultFileError
        A file that is damaged, or no table.
    """
    tables = a.table(name), b.table(name)
    one, other = (pd.DataFrame(table.rows, columns=list(table.header), dtype=object) for table in tables)
    for column in dict.fromkeys([*one, *other]):
        if column not in leave_out and (column not in one or column not in other):
            yield missing(f"{name}: {column}", in_a=column in one)
    columns = [column for column in one if column in other and column not in leave_out]
    names = _naming(one[columns], other[columns])
    if names:
        one, other = (table.set_index(names, drop=False) for table in (one, other))
    common = one.index[one.index.isin(other.index)]
    if len(common) < max(len(one), len(other)):
        more = [f"{len(rows) - len(common) or 'no'} more" for rows in (one, other)]
        yield Difference(kind="missing", where=f"{name}: rows", a=more[0], b=more[1])
    at = [" ".join(key) if len(names) > 1 else key if names else str(key + 1) for key in common]
    one, other = one.loc[common], other.loc[common]
    for column in columns:
        found = _column_difference(f"{name}: {column}", list(zip(one[column], other[column], strict=True)), at)
        if found:
            yield found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True


def _naming(one: pd.DataFrame, other: pd.DataFrame) -> list[str]:
    """Return the first columns of text that identify the rows of both tables uniquely, if there are any."""
    texts = [column for column in one if not all(map(_is_number, [*one[column], *other[column]]))]
    firsts = (texts[:end] for end in range(1, len(texts) + 1))
    return next(
        (names for names in firsts if not one.duplicated(names).any() and not other.duplicated(names).any()), []
    )


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
