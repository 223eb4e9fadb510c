"""The history of a folder of results: one sealed line of JSON for each run of the workflow with executed jobs.

A run writes a marker at its start and removes it at its end. The next start records runs without a live process as
"killed".
"""

from __future__ import annotations

import fcntl
import json
import os
import platform
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, unknown_name
from nearharmonic.output.atomic import digest_of, read_bytes, sealed, write_text
from nearharmonic_paper.tasks.provenance import MARKED, names_made_by, receipts_in

# --- Lines of a history: each one is sealed and holds the digest of the line before.
#
# A changed, lost or added line is therefore found, and named by its number. A damaged line never hides a run: it is
# read as a run with the status "damaged", of which only id and start are shown. Lines of older versions have no
# seals.

#: A line of the history.
Run = dict[str, Any]

HISTORY = "history.jsonl"
#: Start of the text of every run, which separates lines whose line end is damaged.
FIRST = b'{"id": "'
DAMAGED = "is damaged: its seal does not match"
_BETWEEN = re.compile(rb"\n|(?<=\}).?(?=" + re.escape(FIRST) + rb")", re.DOTALL)
_ID = re.compile(r"(\d{4})(\d\d)(\d\d)T(\d\d)(\d\d)(\d\d)Z-[0-9a-f]{8}", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line of a history: its number from 1, the SHA-256 of its bytes, and its run without ``before`` and seal.

    ``is_sealed`` is True if it has a seal that matches. ``fault`` says what is wrong with it, if anything. ``known``
    are the digests of earlier lines whose faults it records.
    """

    number: int
    digest: str
    run: Run
    is_sealed: bool = False
    fault: str = ""
    known: tuple[str, ...] = ()


def lines_of(place: Path) -> list[Line]:
    """Return the lines of a history or a marker, oldest first; none if there is no file."""
    try:
        texts = filter(None, _BETWEEN.split(read_bytes(place)))
    except OSError:
        return []
    lines: list[Line] = []
    for number, text in enumerate(texts, start=1):
        lines.append(_line(number, text, lines[-1] if lines else None))
    return lines


def faulty_lines(lines: Sequence[Line]) -> list[Line]:
    """Return the lines with a fault that no later line records."""
    known = {digest for line in lines for digest in line.known}
    return [line for line in lines if line.fault and line.digest not in known]


def append(folder: Path, run: Mapping[str, Any], lost: str | None = None) -> None:
    """Append ``run`` to the history of ``folder``, sealed, in one atomic write.

    The line records the faults of earlier lines. An unfinished line of a previous writer, for example after a power
    failure, is ended first. ``lost`` is the digest of a last line that is no longer in the history, which this line
    records too. A history that cannot be written is an OSError; a number that is not finite is a ValueError.
    """
    place = folder / HISTORY
    json.dumps(run, allow_nan=False)  # before a file is created
    file = os.open(place, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK, 0o666)  # a pipe must not block
    try:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        unfinished = place.read_bytes()[-1:] not in {b"", b"\n"}
        os.write(file, (("\n" if unfinished else "") + text_of(run, lines_of(place), lost)).encode())
        os.fsync(file)
    finally:
        os.close(file)


def text_of(run: Mapping[str, Any], before: Sequence[Line] = (), lost: str | None = None) -> str:
    """Return the text of the line of ``run`` after the lines ``before``, of which the last one may be lost."""
    chain = {"before": before[-1].digest if before else None}
    faults = [line.digest for line in faulty_lines(before)] + ([lost] if lost else [])
    document = {"id": run["id"], **run, **({"faults": faults} if faults else {}), **chain}
    return json.dumps(sealed(document), ensure_ascii=False, allow_nan=False) + "\n"


def _line(number: int, text: bytes, previous: Line | None) -> Line:
    digest = sha256(text).hexdigest()
    document, fault = _document(text)
    if document is None:
        return Line(number=number, digest=digest, run=_damaged_run(number, text), fault=fault)
    given = {key: document.pop(key, None) for key in ("sha256", "before", "faults")}
    is_sealed = given["sha256"] is not None
    follows = given["before"] == (previous and previous.digest) or bool(previous and previous.fault)
    if is_sealed and not follows:
        fault = "does not follow the line before: a line was lost, added or changed there"
    elif not is_sealed and previous is not None and previous.is_sealed:
        fault = "has no seal, while the line before has one"
    known = tuple(given["faults"] or ())
    return Line(number=number, digest=digest, run=document, is_sealed=is_sealed, fault=fault, known=known)


def _document(text: bytes) -> tuple[Run | None, str]:
    """Return a run with its seal; None and the fault if the text is no run or has a seal that does not match."""
    from nearharmonic_paper.tasks.schema import complaint

    try:
        run: Any = json.loads(text)
        rest = {key: value for key, value in run.items() if key != "sha256"}
        if digest_of(rest) != run.get("sha256") and ("sha256" in run or "before" in run):
            return None, DAMAGED
    except (AttributeError, ValueError, RecursionError):
        return None, DAMAGED
    fault = complaint("run", run)
    return (None, f"is no run: it {fault}") if fault else (run, "")


def _damaged_run(number: int, text: bytes) -> Run:
    """Return the legible part of a run whose line is damaged: its id and its start."""
    name = _ID.search(text[:60].decode(errors="replace"))
    legible = {"id": name[0], "start": name.expand(r"\1-\2-\3T\4:\5:\6.000Z")} if name else {}
    return {"id": f"line-{number}", "start": "", "config": {}, "status": "damaged", **legible}


# --- Markers of unfinished runs: ``logs/running/ID.json``, with the process of the run.

MARKERS = Path("logs", MARKED)


def running_in(folder: Path) -> list[Run]:
    """Return the unfinished runs, oldest first; the status is "killed" if the process has ended on this machine."""
    return [run | {"status": "killed"} if run.get("process") and _is_dead(run) else run for run, _ in _marked(folder)]


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
        append(folder, told | {"status": status, "made": names_made_by(receipts_in(folder), run["id"])})
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


# --- Queries of the history: the runs of one folder of results or of several.


def runs_of(folder: Path) -> list[Run]:
    """Return the runs in the history of ``folder``, oldest first; a damaged line is a run with the status "damaged"."""
    return [line.run for line in lines_of(folder / HISTORY)]


def runs_newest_first(folders: Iterable[Path]) -> list[tuple[Path, Run]]:
    """Return each run of some folders with its folder, by start time; an unfinished run has the status "running"."""
    placed = []
    for folder in folders:
        ended = runs_of(folder)
        ids = {run["id"] for run in ended}
        placed += [(folder, run) for run in (*ended, *(run for run in running_in(folder) if run["id"] not in ids))]
    return sorted(placed, key=lambda pair: (str(pair[1].get("start")), str(pair[1]["id"]), str(pair[0])), reverse=True)


def newest_finished(folder: Path) -> Run | None:
    """Return the newest successful run of a result, None if there is none."""
    return next((run for _, run in runs_newest_first([folder]) if run.get("status") == "ok"), None)


def makers_in(folder: Path) -> dict[str, str]:
    """Return the id of the newest run that made each file, by the name of the file."""
    return {name: run["id"] for run in runs_of(folder) for name in run.get("made") or ()}


def doubts_in(folder: Path) -> list[str]:
    """Return a sentence for each line of the history that cannot be read."""
    lines = (line for line in lines_of(folder / HISTORY) if line.run.get("status") == "damaged")
    says = "its record of files, configs and code is lost"
    return [f"{folder / HISTORY}: line {line.number} {line.fault}, and {says}" for line in lines]


def run_named(prefix: str, runs: Sequence[Run]) -> Run:
    """Return the run whose id begins with ``prefix``, the first of ``runs`` if that is empty."""
    if not runs:
        raise SettingError("no run is recorded: snakemake -j2 makes results and records the run")
    alike = {str(run.get("id")): run for run in runs if str(run.get("id")).startswith(prefix)}
    ids = list(alike)
    if not ids:
        raise unknown_name("run", prefix, [str(run.get("id")) for run in runs])
    if prefix and len(ids) > 1:
        listed = ", ".join([*ids[:5], *(["..."] if len(ids) > 5 else [])])
        raise SettingError(f"id = {prefix!r} is not allowed: {len(ids)} runs begin with it, {listed}")
    return alike[ids[0]]


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
