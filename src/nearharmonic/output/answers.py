"""Answers of commands, and their output as a table, as JSON, or as CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from typing import Any

from nearharmonic.output.table import check_rows

FORMATS = ("table", "json", "csv")
#: Significant digits of a float in a table: as many as the step sizes of a grid have.
SHOWN = 6

#: Text, integer, float, truth value, or None for an empty cell.
Cell = Any


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Answer of a command.

    Attributes
    ----------
    header : sequence of str
        Names of the columns.
    rows : sequence of sequences
        Cells (text, integers, floats, truth values, None), one per name of the header in each row.
    document : object
        Content of the JSON output: nested mappings, sequences and cells. If None, a list with an object for each row.
    status : int
        Exit status: 0 for yes, which includes an empty answer; 1 for no.
    title : str
        Line above the table, if any.
    notes : sequence of str
        Lines below the table. JSON and CSV have no title and notes.
    digits : int or None
        Significant digits of the floats of the table, None for all digits; JSON and CSV have all digits.
    text : str, optional
        Text that is printed in place of a table.

    Raises
    ------
    NearharmonicError
        A row and the header have different lengths.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    document: Any = None
    status: int = 0
    title: str = ""
    notes: Sequence[str] = ()
    digits: int | None = SHOWN
    text: str | None = None

    def __post_init__(self) -> None:
        check_rows(self.header, self.rows)


def printed(answer: Answer, form: str) -> str:
    """Return the text of ``answer`` in one of :data:`FORMATS`, with a final line feed unless it is empty."""
    text = {"table": _table, "json": _json, "csv": _csv}[form](answer)
    return text if text.endswith("\n") or not text else f"{text}\n"


def _table(answer: Answer) -> str:
    if answer.text is not None:
        return answer.text
    lines = [answer.title] if answer.title else []
    if answer.rows:
        from tabulate import tabulate

        cells = [[_shown(cell, answer.digits) for cell in row] for row in answer.rows]
        right = [all(_is_number(row[i]) for row in answer.rows) for i in range(len(answer.header))]
        aligned = tabulate(
            cells,
            list(answer.header),
            tablefmt="plain",
            disable_numparse=True,
            colalign=["right" if numbers else "left" for numbers in right],
        )
        lines += [line.rstrip() for line in aligned.splitlines()]
    return "\n".join([*lines, *answer.notes])


def _is_number(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


def _shown(cell: Cell, digits: int | None) -> str:
    """Text of a cell: floats are shortened, truth values are words, None and NaN are a dash."""
    if cell is None or cell == "" or (isinstance(cell, float) and isnan(cell)):
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.{digits}g}" if isinstance(cell, float) and digits else str(cell)


def _csv(answer: Answer) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([answer.header, *answer.rows])
    return text.getvalue()


def _json(answer: Answer) -> str:
    document = answer.document
    if document is None:
        document = [dict(zip(answer.header, row, strict=True)) for row in answer.rows]
    return json.dumps(_without_infinities(document), indent=1, ensure_ascii=False, allow_nan=False)


def _without_infinities(value: Any) -> Any:
    """``value`` with null for every float that JSON cannot express."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _without_infinities(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(member) for member in value]
    return value
