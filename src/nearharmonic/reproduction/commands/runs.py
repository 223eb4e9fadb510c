"""``nearharmonic runs``: single runs of one or more results, selected by a condition and sorted."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from nearharmonic.output.answers import Answer

if TYPE_CHECKING:
    from nearharmonic.reproduction.record.query.run_table import RunTable

HELP = "list single runs: step, errors, status; chosen and sorted"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", nargs="+", help="folder of a result, or its name below results/")
    parser.add_argument(
        "--where", metavar="EXPR", help="a condition on columns, such as \"max_energy_error < 1e-9 and status == 'ok'\""
    )
    parser.add_argument("--sort", metavar="KEY", help="a column; with a minus before it, from the largest")
    parser.add_argument("--limit", metavar="N", help="rows to show at most")
    parser.add_argument("--columns", metavar="A,B,...", help="columns to show; all if not given")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each run that fulfils the condition."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.reproduction.record.files.folders import folder_of
    from nearharmonic.reproduction.record.query.expression import rows_where
    from nearharmonic.reproduction.record.query.run_table import column_of, order_by, run_table

    limit = None if chosen.limit is None else whole_number(chosen.limit, "limit")
    found = run_table({name: folder_of(name) for name in chosen.result})
    names = list(found.columns) if chosen.columns is None else [name.strip() for name in chosen.columns.split(",")]
    for name in names:
        column_of(name, found.columns)
    every = found.rows
    if chosen.where is not None:
        found = found.taken(rows_where(chosen.where, found.columns))
    matched = found.rows
    if chosen.sort is not None:
        found = found.taken(order_by(chosen.sort, found.columns))
    found = found.taken(slice(limit))
    columns = [found.columns[name].tolist() for name in names]
    shown = "" if found.rows == matched else f", of which {found.rows} are shown"
    notes = [f"{matched} of {every} runs{shown}", *_unit_notes(found, names)]
    return Answer(header=names, rows=list(zip(*columns, strict=True)), notes=notes)


def _unit_notes(found: RunTable, names: list[str]) -> list[str]:
    """Return a line for each system in the rows with units other than 1."""
    present = set(found.columns["system"].tolist())
    lines = []
    for system, units in sorted(found.units.items()):
        told = [f"{name} in {units[name]}" for name in names if name in units]
        if told and system in present:
            lines.append(f"{system}: {', '.join(told)}")
    return lines
