"""Parts that all pages share: the task that fills the marks of a page, tables, and cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import wraps
from math import isfinite, log10
from pathlib import Path
from typing import Any

from nearharmonic.integrators import integrators as registered
from nearharmonic.output.table import Cell, filled_page, from_csv, pipes, power_of_ten

#: A row of a table of the results, by column.
Row = dict[str, Any]
MINUS = "\N{MINUS SIGN}"


def fills(made: Callable[..., dict[str, Any]]) -> Callable[..., dict[str, Any]]:
    """Make a task of the function of a page: texts go between the marks of these names, other results are outputs.

    The task has the path of the page besides, and the names of the systems and integrators that the function looks up.
    """

    @wraps(made)
    def task(page: str, systems: Sequence[str] = (), integrators: Sequence[str] = (), **given: Any) -> dict[str, Any]:
        found = made(**given)
        parts = {name: part for name, part in found.items() if isinstance(part, str)}
        return {"page": filled_page(page, parts)} | {name: found[name] for name in found.keys() - parts.keys()}

    return task


def table(header: Sequence[str], rows: Iterable[Sequence[Cell]], left: int = 1) -> str:
    """A Markdown table whose first columns are aligned to the left."""
    return "\n".join(pipes(header, rows, align="l" * left + "r"))


def rows_of(path: str) -> list[Row]:
    """The rows of a table in CSV, numbers as numbers."""
    rows = from_csv(Path(path).read_text(encoding="utf-8")).records()
    return [{key: _number(cell) for key, cell in row.items()} for row in rows]


def _number(cell: str) -> int | float | str:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(cell)
    return cell


def tables_of(paths: Iterable[str], beginning: str = "") -> dict[str, list[Row]]:
    """Rows of tables by their names without a common beginning."""
    return {Path(path).stem.removeprefix(beginning): rows_of(path) for path in paths}


def label(name: str) -> str:
    """A method as pages call it: trained ones by the name under which they are registered."""
    return registered[name].label if name in registered and not name.startswith("trained_") else name


def signed(x: float, digits: int = 2) -> str:
    """A number with its sign, nothing if it is not finite."""
    return f"{x:+.{digits}f}".replace("-", MINUS) if isfinite(x) else ""


def shown(x: float, form: str, missing: str = "–") -> str:
    """A number in a format, and a word for one that is not finite."""
    return format(x, form) if isfinite(x) else missing


def digits(number: float, missing: str = "–") -> str:
    """A number with two significant digits, without an exponent."""
    return f"{float(f'{number:.2g}'):g}" if isfinite(number) else missing


def power(error: float) -> str:
    """A power of ten as pages have it, 10⁻³."""
    return power_of_ten(round(log10(error)))
