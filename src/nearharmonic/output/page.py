"""Generated parts of Markdown pages: tables, and the marks between which a part stands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.table import Cell


def pipes(header: Sequence[str], rows: Iterable[Sequence[Cell]], align: str = "l") -> list[str]:
    """Return the lines of a table in Markdown without padding, with cells written by ``str``.

    ``align`` has a letter, ``l`` or ``r``, for each column; the last letter holds for all further columns.
    """
    marks = ["---:" if align[min(i, len(align) - 1)] == "r" else "---" for i in range(len(header))]
    return [
        f"| {' | '.join(header)} |",
        f"|{'|'.join(marks)}|",
        *(f"| {' | '.join(map(_cell, row))} |" for row in rows),
    ]


def _cell(cell: Cell) -> str:
    return re.sub(r"(?<!\\)\|", r"\|", str(cell))


def filled(page: str, parts: Mapping[str, str]) -> str:
    """Return a page with each text of ``parts`` between the lines ``<!-- name -->`` and ``<!-- end -->``.

    A NearharmonicError says that the page has not exactly one place for a name.
    """
    for name, text in parts.items():
        before, *rest = page.split(f"<!-- {name} -->\n")
        if len(rest) != 1 or "<!-- end -->" not in rest[0]:
            message = f"the page has {len(rest)} places for {name}, each from <!-- {name} --> to <!-- end -->"
            raise NearharmonicError(message)
        _, end, after = rest[0].partition("<!-- end -->")
        page = f"{before}<!-- {name} -->\n{text}\n{end}{after}"
    return page


def filled_page(place: str, parts: Mapping[str, str]) -> str:
    """Return the page of a file, filled as :func:`filled` does."""
    return filled(Path(place).read_text(encoding="utf-8"), parts)
