"""A table (header, rows) as CSV, Markdown and LaTeX; like a figure, it appears whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tabulate import tabulate

SUFFIXES = ("csv", "md", "tex")
#: Digits that readers of Markdown and LaTeX see of a float; CSV keeps them all.
SHOWN = 4


def save(header: Sequence[str], rows: Sequence[Sequence[Any]], stem: str | os.PathLike[str], note: str) -> list[Path]:
    """Write ``stem``.csv (every digit), .md and .tex (floats to four digits, under ``note``)."""
    texts = {"csv": _csv(header, rows), "md": _markdown(header, rows, note), "tex": _latex(header, rows, note)}
    places = {suffix: Path(f"{os.fspath(stem)}.{suffix}") for suffix in texts}
    for suffix, place in places.items():
        _write(place, texts[suffix])
    return list(places.values())


def save_document(document: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Write nested numbers and texts as TOML."""
    import tomli_w

    _write(Path(path), tomli_w.dumps(document))


def _write(place: Path, text: str) -> None:
    place.parent.mkdir(parents=True, exist_ok=True)
    part = place.with_name(f".{place.name}.part")
    part.write_text(text, encoding="utf-8")
    part.replace(place)


def _csv(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([header, *rows])
    return text.getvalue()


def _shown(rows: Sequence[Sequence[Any]]) -> list[list[str]]:
    return [[f"{cell:.{SHOWN}g}" if isinstance(cell, float) else str(cell) for cell in row] for row in rows]


def _markdown(header: Sequence[str], rows: Sequence[Sequence[Any]], note: str) -> str:
    return f"{note}\n\n{tabulate(_shown(rows), header, tablefmt='github', disable_numparse=True)}\n"


def _latex(header: Sequence[str], rows: Sequence[Sequence[Any]], note: str) -> str:
    body = tabulate(_shown(rows), header, tablefmt="latex_booktabs", disable_numparse=True)
    return f"% {note}\n{body}\n"
