"""Tables of the page, from CSV files of the results, or from Markdown files with headings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from nearharmonic.output.table import Table
from nearharmonic_paper.record.files.texts import Texts
from nearharmonic_paper.report.shown import wording


@dataclass(frozen=True, kw_only=True)
class ShownTable(Table):
    """A table of the page, with formatted cells, the id of its element, and the file with all digits.

    The id of the paper's Table 4 is "table-4"; the name of the file is relative to the folder of results.
    """

    anchor: str
    file: str


def tables_of(texts: Texts, stem: str, *, has_markdown: bool) -> list[ShownTable]:
    """Read the table ``tables/<stem>.csv``, with the caption above its Markdown.

    Markdown with headings is a summary of a long table; its tables are then returned. A ResultFileError says that a
    file is missing, damaged or no table.
    """
    file, anchor = f"tables/{stem}.csv", _anchor_of(stem)
    said = texts.read(f"tables/{stem}.md").splitlines() if has_markdown else []
    if said and said[0].startswith("# "):
        return [
            ShownTable(anchor=anchor, caption=f"{said[0][2:]}; {caption}", header=header, rows=rows, file=file)
            for caption, header, rows in _digests(said)
        ]
    table = texts.table(file)
    caption = said[0] if said else stem.replace("_", " ").capitalize()
    shown = [[wording.cell(text) for text in row] for row in table.rows]
    return [ShownTable(anchor=anchor, caption=caption, header=table.header, rows=shown, file=file)]


def _digests(lines: Iterable[str]) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Yield the tables of a Markdown text, each with its heading."""
    heading, rows = "", []
    for line in [*lines, ""]:
        if line.startswith("|"):
            rows.append([cell.strip().strip("*`") for cell in line.strip("| ").split("|")])
            continue
        if rows:
            yield heading, rows[0], rows[2:]
            rows = []
        if line.startswith("## "):
            heading = line[3:].strip()


def _anchor_of(stem: str) -> str:
    name, _, rest = stem.partition("_")
    digits = name.removeprefix("table")
    return f"table-{digits}" if digits.isdigit() and rest != "derived" else f"table-{stem}"
