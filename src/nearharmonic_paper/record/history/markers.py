"""Markers of unfinished runs: ``logs/running/ID.json``, with the process of the run."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from nearharmonic.output.atomic import write_text
from nearharmonic_paper.record.history.lines import Run, append, lines_of, text_of
from nearharmonic_paper.tasks.receipts import MARKED, names_made_by

MARKERS = Path("logs", MARKED)


def running_in(folder: Path) -> list[Run]:
    """Return the unfinished runs, oldest first; the status is "killed" if the process has ended on this machine."""
    ended = {"status": "killed"}
    return [run | ended if run.get("process") and _is_dead(run) else run for run, _ in _marked(folder)]


def _marked(folder: Path) -> Iterator[tuple[Run, Path]]:
    """Yield each unfinished run with its marker; the id of a damaged marker is that in its name."""
    for place in sorted((folder / MARKERS).glob("*.json")):
        for line in lines_of(place)[:1]:
            yield (line.run | {"id": place.stem} if line.fault else line.run), place


def mark(folder: Path, run: Mapping[str, Any]) -> None:
    """Write the marker of a starting run: ``run`` and its process; it raises OSError if it cannot."""
    write_text(folder / MARKERS / f"{run['id']}.json", text_of({**run, "process": this_process()}))


def unmark(folder: Path, run: str) -> None:
    """Remove the marker of the run with this id."""
    (folder / MARKERS / f"{run}.json").unlink(missing_ok=True)


def close_killed(folder: Path) -> list[str]:
    """Append the runs of ``folder`` whose process has ended as "killed", with the files that they made.

    Their ids are returned. The marker of a run on another machine stays, because its process cannot be checked. A
    history that cannot be written is an OSError.
    """
    closed = []
    for run, place in dead_in(folder):
        claimed = place.with_name(f".{place.name}.{os.getpid()}")
        try:
            place.rename(claimed)  # if two runs start at once, only one closes it
        except FileNotFoundError:
            continue
        told = {key: value for key, value in run.items() if key != "process"}
        status = "damaged" if run.get("status") == "damaged" else "killed"  # nothing is known of the former
        append(folder, told | {"status": status, "made": names_made_by(folder, run["id"])})
        claimed.unlink()
        closed.append(str(run["id"]))
    return closed


def dead_in(folder: Path) -> list[tuple[Run, Path]]:
    """Return the unfinished runs whose process on this machine has ended, with their markers."""
    return [(run, place) for run, place in _marked(folder) if _is_dead(run)]


def _is_dead(run: Run) -> bool:
    process = run.get("process", {})
    return bool(process.get("host", platform.node()) == platform.node() and not is_alive(process))


def this_process() -> dict[str, Any]:
    """Return ``host``, ``number`` and time of creation of this process."""
    import psutil

    return {"host": platform.node(), "number": os.getpid(), "created": psutil.Process().create_time()}


def is_alive(process: Mapping[str, Any]) -> bool:
    """Return True if a process of this machine runs; another process with its number does not count."""
    import psutil

    try:
        return bool(abs(psutil.Process(process["number"]).create_time() - process["created"]) < 1)
    except (psutil.NoSuchProcess, LookupError, TypeError, ValueError):
        return False
