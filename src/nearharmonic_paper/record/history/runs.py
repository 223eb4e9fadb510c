"""Queries of the history: the runs of one folder of results or of several."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, unknown_name
from nearharmonic_paper.record.history.lines import HISTORY, Run, lines_of
from nearharmonic_paper.record.history.markers import running_in


def runs_of(folder: Path) -> list[Run]:
    """Return the runs in the history of ``folder``, oldest first; a damaged line is a run with the status "damaged"."""
    return [line.run for line in lines_of(folder / HISTORY)]


def runs_newest_first(folders: Iterable[Path]) -> list[tuple[Path, Run]]:
    """Return each run of some folders with its folder, by start time; an unfinished run has the status "running"."""
    found = []
    for folder in folders:
        ended = runs_of(folder)
        ids = {run["id"] for run in ended}
        found += [(folder, run) for run in (*ended, *(run for run in running_in(folder) if run["id"] not in ids))]
    return sorted(found, key=lambda one: (str(one[1].get("start")), str(one[1]["id"]), str(one[0])), reverse=True)


def newest_finished(folder: Path) -> Run | None:
    """Return the newest successful run of a result, None if there is none."""
    return next((run for _, run in runs_newest_first([folder]) if run.get("status") == "ok"), None)


def makers_in(folder: Path) -> dict[str, str]:
    """Return the id of the newest run that made each file, by the name of the file."""
    return {name: run["id"] for run in runs_of(folder) for name in run.get("made") or ()}


def doubts_in(folder: Path) -> list[str]:
    """Return a sentence for each line of the history that cannot be read."""
    lines = (line for line in lines_of(folder / HISTORY) if line.run.get("status") == "damaged")
    says = "what it recorded of files, configs and code is not known"
    return [f"{folder / HISTORY}: line {line.number} {line.fault}, and {says}" for line in lines]


def run_named(prefix: str, runs: Sequence[Run]) -> Run:
    """Return the run whose id begins with ``prefix``, the first of ``runs`` if that is empty.

    Raises
    ------
    UnknownNameError
        No id begins with it; the message has the nearest match.
    SettingError
        Several ids begin with it, or there are no runs.
    """
    if not runs:
        raise SettingError("no run is recorded: snakemake -j2 makes results and records the run")
    found = list({str(run.get("id")): run for run in runs if str(run.get("id")).startswith(prefix)}.values())
    if not found:
        raise unknown_name("run", prefix, [str(run.get("id")) for run in runs])
    if prefix and len(found) > 1:
        listed = ", ".join([*(str(run["id"]) for run in found[:5]), *(["..."] if len(found) > 5 else [])])
        raise SettingError(f"id = {prefix!r} is not allowed: {len(found)} runs begin with it, {listed}")
    return found[0]


def flattened(value: Any, above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield (dotted key, cell) of nested mappings; a list of scalars is one cell."""
    if isinstance(value, Mapping) and value:
        for key, member in value.items():
            yield from flattened(member, f"{above}.{key}" if above else str(key))
    elif isinstance(value, list) and any(isinstance(member, Mapping | list) for member in value):
        for i, member in enumerate(value):
            yield from flattened(member, f"{above}.{i}")
    else:
        yield above, " ".join(map(str, value)) if isinstance(value, list | Mapping) else value
