"""Tables as CSV, Markdown, LaTeX and text, written atomically, and tables read from CSV."""

from __future__ import annotations

import csv
import io
import os
import re
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.atomic import write_text

# --- Text for a terminal: escape sequences in names from files never reach it.

#: Control characters except tab and line feed; marks of direction and of no width; separators; halves of surrogates.
_UNSAFE = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u00ad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e007f]"
)


def progress(line: str) -> None:
    """Write a line on the progress of a long computation to the terminal, past the log of a job."""
    print(line, file=sys.__stderr__, flush=True)


def printable(text: str) -> str:
    r"""Return ``text`` with an escape such as ``\u001b`` in place of each character that controls a terminal.

    Inside a string of JSON the escape means the same character. Tabs and line feeds stay.
    """
    return _UNSAFE.sub(_escaped, text)


def in_one_line(text: str) -> str:
    """Return ``text`` as :func:`printable` does, with its tabs and line feeds escaped too."""
    return printable(text).replace("\n", "\\n").replace("\t", "\\t")


def _escaped(found: re.Match[str]) -> str:
    units = struct.iter_unpack(">H", found[0].encode("utf-16-be", "surrogatepass"))
    return "".join(f"\\u{unit:04x}" for (unit,) in units)


#: Endings of the files of a table.
SUFFIXES = ("csv", "md", "tex")
#: Digits of a float in Markdown and LaTeX; CSV has all digits.
SHOWN = 4

#: Text, integer, float, truth value, or None for an empty cell.
Cell = Any


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table: names of columns, rows of as many cells, and a sentence above it, which is a comment in LaTeX.

    ``volatile`` are the names of the columns of measured times, which differ from run to run. Rows of another length
    than the header raise a NearharmonicError.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str = ""
    volatile: Sequence[str] = ()

    def __post_init__(self) -> None:
        for i, row in enumerate(self.rows):
            if len(row) != len(self.header):
                raise NearharmonicError(f"row {i} has {len(row)} cells under {len(self.header)} names: {list(row)}")

    def records(self) -> list[dict[str, Cell]]:
        """Return each row as the cells by the names of their columns."""
        return [dict(zip(self.header, row, strict=True)) for row in self.rows]

    def csv(self) -> str:
        """Return the header and the rows as CSV, with every digit."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([self.header, *self.rows])
        return text.getvalue()

    def markdown(self) -> str:
        """Return the caption and the table in Markdown, floats to four digits."""
        cells = [[in_markdown(_shortened(cell)) for cell in row] for row in self.rows]
        table = _tabulate(list(map(in_markdown, self.header)), cells, "github")
        return f"{_one_line(self.caption)}\n\n{table}\n"

    def latex(self) -> str:
        """Return the caption and the table in LaTeX, floats to four digits."""
        cells = [[_shortened(cell) for cell in row] for row in self.rows]
        return f"% {_one_line(self.caption)}\n{_tabulate(self.header, cells, 'latex_booktabs')}\n"

    def lines(self, digits: int | None = None) -> list[str]:
        """Return the caption and the rows as lines of aligned columns for a terminal, floats to ``digits``.

        There is no header above no rows.
        """
        caption = [in_one_line(self.caption)] if self.caption else []
        if not self.rows:
            return caption
        cells = [[_in_words(cell, digits) for cell in row] for row in self.rows]
        sides = ["right" if all(map(_is_number, column)) else "left" for column in zip(*self.rows, strict=True)]
        aligned = _tabulate(self.header, cells, "plain", colalign=sides)
        return [*caption, *(line.rstrip() for line in aligned.splitlines())]


def _tabulate(header: Sequence[str], cells: Sequence[Sequence[str]], form: str, **options: Any) -> str:
    import tabulate

    # Otherwise the widths, and with them the bytes of a file, depend on whether the package wcwidth is installed.
    before, tabulate.WIDE_CHARS_MODE = tabulate.WIDE_CHARS_MODE, False
    try:
        return str(tabulate.tabulate(cells, list(header), tablefmt=form, disable_numparse=True, **options))
    finally:
        tabulate.WIDE_CHARS_MODE = before


def _shortened(cell: Cell) -> str:
    return f"{cell:.{SHOWN}g}" if isinstance(cell, float) else str(cell)


def _is_number(cell: Cell) -> bool:
    return cell is None or (isinstance(cell, int | float) and not isinstance(cell, bool))


def _in_words(cell: Cell, digits: int | None) -> str:
    """Return the text of a cell: floats are shortened, truth values are words, None and NaN are a dash."""
    if cell is None or cell == "" or (isinstance(cell, float) and isnan(cell)):
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.{digits}g}" if isinstance(cell, float) and digits else in_one_line(str(cell))


def in_markdown(text: str) -> str:
    """Return ``text`` for a cell in Markdown: bars, tags and links of labels are escaped, line feeds are spaces."""
    text = re.sub(r"(?<!\\)\|", r"\|", _one_line(text))
    return re.sub(r"<(?=[A-Za-z/!?])", "&lt;", text).replace("](", "]\\(")


def _one_line(text: str) -> str:
    return re.sub(r"\s*[\n\r]\s*", " ", text)


def from_csv(text: str) -> Table:
    """Return the table whose CSV is ``text``, every cell a text; a NearharmonicError says that it is no table."""
    try:
        header, *rows = csv.reader(io.StringIO(text))
    except (ValueError, csv.Error) as error:
        raise NearharmonicError("there is no table") from error
    return Table(header=header, rows=rows)


def save(table: Table, places: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Write ``table`` to each of ``places``, in the format of its ending, one of :data:`SUFFIXES`; return the paths."""
    texts = {".csv": table.csv, ".md": table.markdown, ".tex": table.latex}
    paths = [Path(place) for place in places]
    for path in paths:
        if path.suffix not in texts:
            raise NearharmonicError(f"{path}: a table is written as {', '.join(SUFFIXES)}")
        write_text(path, texts[path.suffix]())
    return paths


def save_document(document: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write nested numbers and strings to ``path`` as TOML."""
    import tomli_w

    write_text(path, tomli_w.dumps(document))
