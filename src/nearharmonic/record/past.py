"""Runs of the workflow as they are asked for: those of several results together, those under way among them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, unknown_name
from nearharmonic.record.history import runs_of

#: Start markers of the runs under way, below the folder of a result.
RUNNING = Path("logs/running")

Run = dict[str, Any]


def runs_newest_first(folders: Iterable[Path]) -> list[tuple[Path, Run]]:
    """Return each run of some results with the folder of its result, those under way included.

    Parameters
    ----------
    folders : iterable of Path
        Folders of results.

    Returns
    -------
    list of (Path, dict)
        By the time of the start, the newest first. A run under way has status "running".
    """
    found = [(folder, run) for folder in folders for run in [*runs_of(folder), *_under_way(folder)]]
    return sorted(found, key=lambda one: (str(one[1].get("start")), str(one[1].get("id")), str(one[0])), reverse=True)


def _under_way(folder: Path) -> Iterator[Run]:
    """Runs with a start marker that the history does not hold yet."""
    ended = {run.get("id") for run in runs_of(folder)}
    for path in sorted((folder / RUNNING).glob("*.json")):
        try:
            run = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):  # it is being written, or the run has just ended
            continue
        if isinstance(run, dict) and run.get("id") not in ended:
            yield run


def newest_finished(folder: Path) -> Run | None:
    """Return the newest run of a result that ended well, None if there is none."""
    return next((run for _, run in runs_newest_first([folder]) if run.get("status") == "ok"), None)


def run_named(prefix: str, runs: Sequence[Run]) -> Run:
    """Return the run whose id begins with ``prefix``, the first of ``runs`` if that is empty.

    Raises
    ------
    UnknownNameError
        No id begins so; it says the nearest match.
    SettingError
        More than one id begins so, or there is no run at all.
    """
    if not runs:
        raise SettingError("no run is recorded: snakemake -j2 makes results and records the run")
    found = list({str(run.get("id")): run for run in runs if str(run.get("id")).startswith(prefix)}.values())
    if not found:
        raise unknown_name("run", prefix, [str(run.get("id")) for run in runs])
    if prefix and len(found) > 1:
        raise SettingError(f"id = {prefix!r} is not allowed: {len(found)} runs begin so, {_listed(found)}")
    return found[0]


def _listed(runs: Sequence[Run], most: int = 5) -> str:
    names = [str(run["id"]) for run in runs[:most]]
    return ", ".join(names) + (", ..." if len(runs) > most else "")


def flattened(value: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, cell) of nested mappings; a list of numbers and texts is one cell."""
    if isinstance(value, Mapping) and value:
        for key, member in value.items():
            yield from flattened(member, f"{above}.{key}" if above else str(key))
    elif isinstance(value, list) and any(isinstance(member, Mapping | list) for member in value):
        for i, member in enumerate(value):
            yield from flattened(member, f"{above}.{i}")
    else:
        yield above, " ".join(map(str, value)) if isinstance(value, list | Mapping) else value
