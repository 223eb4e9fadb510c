"""Tables as CSV, Markdown and LaTeX, written atomically."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import write_text

#: Endings of the files of a table.
SUFFIXES = ("csv", "md", "tex")
#: Digits of a float in Markdown and LaTeX; CSV has all digits.
SHOWN = 4

Cell = Any


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table.

    Attributes
    ----------
    header : sequence of str
        Names of the columns.
    rows : sequence of sequences
        Cells (strings, integers and floats), one per name of the header in each row.
    caption : str
        One sentence above the table in Markdown, and a comment in LaTeX.
    volatile : sequence of str
        Names of the columns of measured times, which differ from run to run.

    Raises
    ------
    NearharmonicError
        A row and the header have different lengths.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str
    volatile: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_rows(self.header, self.rows)


def check_rows(header: Sequence[str], rows: Sequence[Sequence[Cell]]) -> None:
    """Raise NearharmonicError if a row and the header have different lengths."""
    for i, row in enumerate(rows):
        if len(row) != len(header):
            message = f"row {i} has {len(row)} cells under {len(header)} names: {list(row)}"
            raise NearharmonicError(message)


def save(table: Table, places: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Write ``table`` to each of ``places``, in the format of its ending.

    CSV has all digits; Markdown and LaTeX have four digits of a float.

    Returns
    -------
    list of Path
        The files, in the order of ``places``.

    Raises
    ------
    NearharmonicError
        An ending is not in :data:`SUFFIXES`.
    """
    texts = {".csv": _csv, ".md": _markdown, ".tex": _latex}
    paths = [Path(place) for place in places]
    for path in paths:
        if path.suffix not in texts:
            message = f"{path}: a table is written as {', '.join(SUFFIXES)}"
            raise NearharmonicError(message)
        write_text(path, texts[path.suffix](table))
    return paths


def save_document(document: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write nested numbers and strings to ``path`` as TOML."""
    import tomli_w

    write_text(path, tomli_w.dumps(document))


def _csv(table: Table) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([table.header, *table.rows])
    return text.getvalue()


def _shown(table: Table) -> list[list[str]]:
    return [[f"{cell:.{SHOWN}g}" if isinstance(cell, float) else str(cell) for cell in row] for row in table.rows]


def _tabulated(table: Table, form: str) -> str:
    from tabulate import tabulate

    return str(tabulate(_shown(table), list(table.header), tablefmt=form, disable_numparse=True))


def _markdown(table: Table) -> str:
    return f"{table.caption}\n\n{_tabulated(table, 'github')}\n"


def _latex(table: Table) -> str:
    return f"% {table.caption}\n{_tabulated(table, 'latex_booktabs')}\n"
