"""Answers of commands, and their output as a table, as JSON, or as CSV."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from nearharmonic.output.table import Table, in_one_line

FORMATS = ("table", "json", "csv")
#: Significant digits of a float in a table: as many as the step sizes of a grid have.
SHOWN = 6


@dataclass(frozen=True, kw_only=True)
class Answer(Table):
    """Answer of a command: a table, with an exit status and notes."""

    #: Content of the JSON output: nested mappings, sequences and cells. If None, a list with an object for each row.
    document: Any = None
    #: Exit status: 0 for yes, which includes an empty answer; 1 for no.
    status: int = 0
    #: Lines below the table. JSON and CSV have no caption and notes.
    notes: Sequence[str] = ()
    #: Significant digits of the floats of the table, None for all digits, which JSON and CSV have.
    digits: int | None = SHOWN
    #: Text that is printed in place of a table.
    text: str | None = None


def printed(answer: Answer, form: str) -> str:
    """Return the text of ``answer`` in one of :data:`FORMATS`, with a final line feed unless it is empty."""
    if form == "csv":
        text = answer.csv()
    elif form == "json":
        document = answer.records() if answer.document is None else answer.document
        text = json.dumps(_without_infinities(document), indent=1, ensure_ascii=False, allow_nan=False)
    else:
        table = [*answer.lines(answer.digits), *map(in_one_line, answer.notes)]
        text = "\n".join(table) if answer.text is None else answer.text
    return text if text.endswith("\n") or not text else f"{text}\n"


def _without_infinities(value: Any) -> Any:
    """``value`` with null for every float that JSON cannot express."""
    if isinstance(value, float):
        return value if isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _without_infinities(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_without_infinities(member) for member in value]
    return value
