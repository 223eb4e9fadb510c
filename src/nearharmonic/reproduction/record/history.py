"""The history of a folder of results: one line of JSON for each run of the workflow with executed jobs.

A run writes a marker at its start and removes it at its end. The next start records runs without a live process as
"killed".
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, unknown_name
from nearharmonic.output.atomic import write_text

#: A line of the history.
Run = dict[str, Any]

HISTORY = "history.jsonl"
MARKERS = Path("logs", "running")


def runs_of(folder: Path) -> list[Run]:
    """Return the runs in the history of ``folder``, oldest first; lines that are no JSON objects are skipped."""
    return _runs_in(folder / HISTORY)


def running_in(folder: Path) -> list[Run]:
    """Return the unfinished runs, oldest first; some may have been killed."""
    return [run for place in sorted((folder / MARKERS).glob("*.json")) for run in _runs_in(place)]


def _runs_in(place: Path) -> list[Run]:
    """Return the runs in the lines of a file; none if there is no file, such as the marker of a run that just ended."""
    try:
        lines = place.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    return [run for run in map(_parsed, lines) if run]


def runs_newest_first(folders: Iterable[Path]) -> list[tuple[Path, Run]]:
    """Return each run of some folders of results with its folder, including unfinished runs.

    Returns
    -------
    list of (Path, dict)
        Sorted by start time, the newest first. An unfinished run has the status "running".
    """
    found = []
    for folder in folders:
        ended = {run["id"]: run for run in runs_of(folder)}
        under_way = [run for run in running_in(folder) if run["id"] not in ended]
        found += [(folder, run) for run in (*ended.values(), *under_way)]
    return sorted(found, key=lambda one: (str(one[1].get("start")), str(one[1]["id"]), str(one[0])), reverse=True)


def newest_finished(folder: Path) -> Run | None:
    """Return the newest successful run of a result, None if there is none."""
    return next((run for _, run in runs_newest_first([folder]) if run.get("status") == "ok"), None)


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


def _parsed(line: str) -> Run | None:
    try:
        run = json.loads(line)
    except (ValueError, RecursionError):
        return None
    known = isinstance(run, dict) and isinstance(run.get("id"), str) and isinstance(run.get("start"), str)
    return run if known and isinstance(run.get("config"), dict) else None


def append(folder: Path, run: Mapping[str, Any]) -> None:
    """Append ``run`` to the history of ``folder`` in one atomic write.

    An unfinished line of a previous writer, for example after a power failure, is ended first.

    Raises
    ------
    OSError
        The history cannot be written.
    """
    place = folder / HISTORY
    line = json.dumps(run, ensure_ascii=False, allow_nan=False) + "\n"
    unfinished = place.is_file() and place.stat().st_size and place.read_bytes()[-1:] != b"\n"
    file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        os.write(file, (("\n" if unfinished else "") + line).encode())
    finally:
        os.close(file)


def mark(folder: Path, run: Mapping[str, Any]) -> None:
    """Write the marker of a starting run: ``run`` and its process.

    Raises
    ------
    OSError
        The marker cannot be written.
    """
    write_text(folder / MARKERS / f"{run['id']}.json", json.dumps({**run, "process": _this_process()}) + "\n")


def unmark(folder: Path, run: str) -> None:
    """Remove the marker of the run with this id."""
    (folder / MARKERS / f"{run}.json").unlink(missing_ok=True)


def close_killed(folder: Path) -> list[str]:
    """Append the runs of ``folder`` whose process has ended as "killed".

    Returns
    -------
    list of str
        Ids of these runs. The marker of a run on another machine stays, because its process cannot be checked.

    Raises
    ------
    OSError
        The history cannot be written.
    """
    closed = []
    for run, place in _dead(folder):
        claimed = place.with_name(f".{place.name}.{os.getpid()}")
        try:
            place.rename(claimed)  # if two runs start at once, only one closes it
        except FileNotFoundError:
            continue
        append(folder, {key: value for key, value in run.items() if key != "process"} | {"status": "killed"})
        claimed.unlink()
        closed.append(str(run["id"]))
    return closed


def _dead(folder: Path) -> Iterator[tuple[Run, Path]]:
    for run in running_in(folder):
        process = run.get("process", {})
        if process.get("host") == platform.node() and not _alive(process):
            yield run, folder / MARKERS / f"{run['id']}.json"


def _this_process() -> dict[str, Any]:
    import psutil

    return {"host": platform.node(), "number": os.getpid(), "created": psutil.Process().create_time()}


def _alive(process: Mapping[str, Any]) -> bool:
    """Return True if a process runs; another process with its number does not count."""
    import psutil

    try:
        return bool(abs(psutil.Process(process["number"]).create_time() - process["created"]) < 1)
    except (psutil.NoSuchProcess, LookupError, TypeError, ValueError):
        return False


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
