"""State of a folder of results between runs: its files, damage set aside, and a lock."""

from __future__ import annotations

import atexit
import fcntl
import json
import os
import platform
import shutil
import sys
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError
from nearharmonic.output.atomic import read_bytes, sealed, write_text
from nearharmonic.output.atomic import unsealed as opened
from nearharmonic_paper.record import history, manifest
from nearharmonic_paper.tasks.receipts import receipts_in

# --- State of a folder of results at the end of a run: sizes and times of all its files, and the end of its history.
#
# A start compares it with the present state, which takes milliseconds, and computes digests only of what differs.

STATE = Path("logs", "state")
#: Files of the record, which are compared too.
RECORD = (history.HISTORY, manifest.MANIFEST)

Observed = list[int] | None


def save(folder: Path, makeable: Iterable[str]) -> None:
    """Write the state of ``folder`` after a run; files that are not as their job wrote them count as unknown."""
    told = manifest.read(folder)
    unknown = {*told["changed"], *told["unrecorded"]}
    receipts = (place.relative_to(folder).as_posix() for place, _ in receipts_in(folder))
    names = sorted({*makeable, *told["files"], *RECORD, *receipts} - unknown)
    files = {name: _observed(folder, name) for name in names} | {name: [] for name in sorted(unknown)}
    lines = history.lines_of(folder / history.HISTORY)
    head = lost_line(folder) or (lines[-1].digest if lines else None)
    write_text(folder / STATE, json.dumps(sealed({"files": files, "head": head})) + "\n")


def lost_line(folder: Path) -> str | None:
    """Return the digest of the last line of the history at the last :func:`save`, if it is neither there nor recorded.

    The chain of digests in the history shows every other loss.
    """
    head = _saved(folder).get("head")
    lines = history.lines_of(folder / history.HISTORY)
    known = {digest for line in lines for digest in (line.digest, *line.known)}
    return head if isinstance(head, str) and head not in known else None


def differing(folder: Path) -> set[str] | None:
    """Return the names of the files that differ from the state of ``folder``; None if that is not known."""
    files = _saved(folder).get("files")
    if not isinstance(files, dict):
        return None
    return {name for name, before in files.items() if _observed(folder, name) != before or _is_broken(folder, name)}


def files_to_remake(folder: Path, makeable: Collection[str], different: Collection[str] | None) -> list[str]:
    """Return the sorted names of the present files that jobs make, and that are not as their job wrote them."""
    names = set(makeable) if different is None else set(makeable).intersection(different)
    there = [name for name in sorted(names) if os.path.lexists(folder / name)]
    entries = manifest.entries_of(folder) if there else {}
    return [name for name in there if name not in entries or manifest.is_changed(folder / name, entries[name])]


def with_results_of(folder: Path, makeable: Collection[str], damaged: Collection[str]) -> list[str]:
    """Return ``damaged`` files and all present files that jobs have made from them, directly or not, sorted."""
    inputs = {name: set(entry.get("inputs", ())) for name, entry in manifest.entries_of(folder).items()}
    found = set(damaged)
    while more := {name for name in makeable if found & inputs.get(name, set())} - found:
        found |= more
    return sorted(name for name in found if os.path.lexists(folder / name))


def _saved(folder: Path) -> dict[str, Any]:
    """Return the saved state; empty if there is none or it is damaged."""
    try:
        return opened(read_bytes(folder / STATE)) or {}
    except OSError:
        return {}


def _is_broken(folder: Path, name: str) -> bool:
    """Return True for a receipt whose seal does not match; a flipped bit leaves size and time as they were."""
    try:
        return name.startswith("logs/") and opened(read_bytes(folder / name)) is None
    except OSError:
        return True


def _observed(folder: Path, name: str) -> Observed:
    """Return size and time of a file; None if there is none."""
    try:
        found = os.stat(f"{folder}/{name}")  # noqa: PTH116 - pathlib takes longer than the system
    except OSError:
        return None
    return [found.st_size, found.st_mtime_ns]


# --- Damaged results, set aside while Snakemake plans a run, so that it makes them again.
#
# Files that no job has made again by the end of the process return to their places, where ``verify`` names them.

#: Folder of these files, in the folder of results.
ASIDE = Path("logs", "aside")


def set_aside(folder: Path, names: Iterable[str]) -> None:
    """Move results out of their places until the end of the process."""
    atexit.register(restore, folder)
    for name in names:
        kept = folder / ASIDE / name
        kept.parent.mkdir(parents=True, exist_ok=True)
        (folder / name).rename(kept)


def restore(folder: Path) -> None:
    """Move results back to those places that no job has filled, also after an earlier process was killed."""
    for kept in sorted((folder / ASIDE).rglob("*")):
        place = folder / kept.relative_to(folder / ASIDE)
        if not os.path.lexists(place) and not (kept.is_dir() and not kept.is_symlink()):
            place.parent.mkdir(parents=True, exist_ok=True)
            kept.rename(place)
    shutil.rmtree(folder / ASIDE, ignore_errors=True)


# --- Lock of a folder of results: one run of the workflow at a time. It ends with its process, also with a killed one.

#: File with the host and the number of the process that holds the lock, or held it last.
LOCK = Path("logs", "lock")


def lock(folder: Path) -> None:
    """Hold the lock of ``folder`` until this process ends.

    In a folder without locks, for example a read-only one, there is a warning and no lock.
    """
    place = folder / LOCK
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # unlike flock, no child process holds it too
    except (BlockingIOError, PermissionError):
        if not os.access(place, os.R_OK | os.W_OK):
            _warn(place, "Permission denied")
            return
        host, _, number = place.read_text(errors="replace").strip().rpartition(" ")
        holder = f"process {number} on {host}" if host else "another process"
        message = f"{folder} is in use: the workflow runs there as {holder}; wait for its end, or stop it"
        raise RefusedError(message) from None
    except OSError as error:
        _warn(place, str(error.strerror))
    else:
        os.ftruncate(file, 0)
        os.pwrite(file, f"{platform.node()} {os.getpid()}\n".encode(), 0)


def _warn(place: Path, reason: str) -> None:
    print(f"nearharmonic: warning: two runs at once are not prevented: {place}: {reason}", file=sys.stderr)
