"""Generated parts of Markdown pages: tables, numbers, and the marks between which a part stands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
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


_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def short(number: float, digits: int = 3) -> str:
    """Return the text of a number with ``digits`` significant digits, in words if it is not finite."""
    if not isfinite(number):
        return "beyond all bounds"
    mantissa, _, exponent = f"{number:.{digits}g}".partition("e")
    return f"{mantissa} × {power_of_ten(int(exponent))}" if exponent else mantissa


def power_of_ten(exponent: int) -> str:
    """Return the text of a power of ten, such as 10⁻³⁰."""
    return f"10{str(exponent).translate(_SUPERSCRIPTS)}"
