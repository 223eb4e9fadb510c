"""Objects in a notebook: one line of text, and an HTML table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

#: Largest number of characters of a cell.
LONGEST = 200


def line(kind: str, facts: Mapping[str, object]) -> str:
    """Return one line for an object of the class ``kind``.

    The first of ``facts`` is the name of the object, and the last, its source, is omitted.
    """
    (_, name), *others, _ = facts.items()
    return f"<{kind} {name}: {', '.join(f'{key} {value}' for key, value in others if value not in ('', None))}>"


def facts_table(kind: str, facts: Mapping[str, object]) -> str:
    """Return the facts of an object as an HTML table with a row for each fact."""
    rows = "".join(f"<tr><th>{_cell(key)}</th><td>{_cell(value)}</td></tr>" for key, value in facts.items())
    return f"<table><caption>{escape(kind)}</caption>{rows}</table>"


def entries_table(entries: Sequence[Mapping[str, object]]) -> str:
    """Return objects of one kind as an HTML table with a row for each object."""
    header = dict.fromkeys(key for entry in entries for key in entry)
    rows = "".join(_row("td", (entry.get(key, "") for key in header)) for entry in entries)
    return f"<table><thead>{_row('th', header)}</thead><tbody>{rows}</tbody></table>"


def _row(tag: str, cells: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{tag}>{_cell(cell)}</{tag}>' for cell in cells)}</tr>"


def _cell(value: object) -> str:
    text = str(value)
    return escape(text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}...")
