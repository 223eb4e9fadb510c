"""``nearharmonic runs``: single runs of one or more results, selected by a condition and sorted."""

from __future__ import annotations

import argparse

from nearharmonic.output.table import Answer

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
    from nearharmonic_paper.record.manifest import folder_of
    from nearharmonic_paper.record.query import column_of, former_systems, rows_where, run_table

    limit = None if chosen.limit is None else whole_number(chosen.limit, "limit")
    folders = {name: folder_of(name) for name in chosen.result}
    every, units = run_table(folders)
    names = list(every) if chosen.columns is None else [name.strip() for name in chosen.columns.split(",")]
    for name in names:
        column_of(name, every)
    found = every if chosen.where is None else every[rows_where(chosen.where, every)]
    if chosen.sort is not None:
        key = column_of(chosen.sort.removeprefix("-"), found)
        found = found.sort_values(str(key.name), ascending=key.name == chosen.sort, kind="stable")
    shown = found[:limit]
    cut = "" if len(shown) == len(found) else f", of which {len(shown)} are shown"
    left_out = {name: ", ".join(former_systems(folder)) for name, folder in folders.items()}
    return Answer(
        header=names,
        rows=list(zip(*(shown[name].tolist() for name in names), strict=True)),
        notes=[
            f"{len(found)} of {len(every)} runs{cut}",
            *_unit_notes(set(shown["system"]), units, names),
            *(f"Left out: {left}, which the config of {name} no longer has" for name, left in left_out.items() if left),
        ],
    )


def _unit_notes(present: set[str], units: dict[str, dict[str, str]], names: list[str]) -> list[str]:
    """Return a line for each system in the rows with units other than 1."""
    lines = []
    for system in sorted(present):
        told = [f"{name} in {units[system][name]}" for name in names if name in units[system]]
        lines += [f"{system}: {', '.join(told)}"] if told else []
    return lines
