"""``nearharmonic history``: the runs of the workflow, newest first."""

from __future__ import annotations

import argparse
from typing import Any

from nearharmonic.output.table import Answer

HELP = "list the runs of the workflow, newest first"
HEADER = ("when", "id", "commit", "dirty", "targets", "duration", "status")
#: Number of digits that identify a commit in a repository of this size.
COMMIT = 10


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", nargs="?", help="folder of a result, or its name below results/; all if not given")
    parser.add_argument(
        "--full", nargs="?", const="", metavar="ID", help="all that is known of one run: the newest, or that of this id"
    )


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each run, or one for each field of the run that ``--full`` names."""
    from nearharmonic_paper.record.history import flattened, run_named, runs_newest_first
    from nearharmonic_paper.record.manifest import RESULTS, folder_of, result_names

    names = result_names() if chosen.result is None else [chosen.result]
    folders = [RESULTS / name if chosen.result is None else folder_of(name) for name in names]
    runs = runs_newest_first(folders)
    if chosen.full is not None:
        run = run_named(chosen.full, [run for _, run in runs])
        return Answer(header=("field", "value"), rows=list(flattened(run)), document=run)
    several = chosen.result is None
    rows = [(folder.name, *_row(run)) if several else _row(run) for folder, run in runs]
    places = ", ".join(map(str, folders)) or "any folder below results/"
    notes = ["when: start in UTC; duration in s"] if rows else [f"no run is recorded in {places}"]
    return Answer(header=("result", *HEADER) if several else HEADER, rows=rows, notes=notes)


def _row(run: dict[str, Any]) -> tuple[Any, ...]:
    when = str(run.get("start", "")).partition(".")[0].replace("T", " ").removesuffix("Z")
    commit = run.get("commit")
    return (
        when,
        run.get("id"),
        commit[:COMMIT] if commit else None,
        run.get("dirty"),
        " ".join(run.get("targets") or ()),
        run.get("duration"),
        run.get("status"),
    )
