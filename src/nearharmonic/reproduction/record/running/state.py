"""State of a folder of results at the end of a run: sizes and times of all its files and receipts.

A start compares it with the present state, which takes milliseconds, and computes digests only of what differs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable
from pathlib import Path

from nearharmonic.output.atomic import write_text
from nearharmonic.output.reading import read_bytes
from nearharmonic.output.sealed_json import opened, sealed
from nearharmonic.reproduction.record.files import manifest
from nearharmonic.reproduction.record.history import HISTORY
from nearharmonic.reproduction.tasks.receipts import receipts_in

STATE = Path("logs", "state")
#: Files of the record, which are compared too.
RECORD = (HISTORY, manifest.MANIFEST)

Observed = list[int] | None


def save(folder: Path, makeable: Iterable[str]) -> None:
    """Write the state of ``folder`` after a run; files that are not as their job wrote them count as unknown.

    Parameters
    ----------
    folder : Path
        Folder of results, with a manifest.
    makeable : iterable of str
        Names of all files that jobs of the present config make.

    Raises
    ------
    OSError
        The file cannot be written.
    ResultFileError
        The manifest is missing or damaged.
    """
    told = manifest.read(folder)
    unknown = {*told["changed"], *told["unrecorded"]}
    receipts = (place.relative_to(folder).as_posix() for place, _ in receipts_in(folder))
    names = sorted({*makeable, *told["files"], *RECORD, *receipts} - unknown)
    files = {name: _observed(folder, name) for name in names} | {name: [] for name in sorted(unknown)}
    write_text(folder / STATE, json.dumps(sealed({"files": files})) + "\n")


def differing(folder: Path) -> set[str] | None:
    """Return the names of the files that differ from the state of ``folder``; None if that is not known."""
    try:
        files = (opened(read_bytes(folder / STATE)) or {}).get("files")
    except OSError:
        return None
    if not isinstance(files, dict):
        return None
    return {name for name, before in files.items() if _observed(folder, name) != before}


def files_to_remake(folder: Path, makeable: Collection[str], different: Collection[str] | None) -> list[str]:
    """Return the sorted names of the present files that jobs make, and that are not as their job wrote them.

    Parameters
    ----------
    folder : Path
        Folder of results.
    makeable : collection of str
        Names of all files that jobs of the present config make.
    different : collection of str, optional
        Names of the files that :func:`differing` returned; None if that is not known.

    Raises
    ------
    OSError
        A file cannot be read.
    """
    names = set(makeable) if different is None else set(makeable).intersection(different)
    there = [name for name in sorted(names) if os.path.lexists(folder / name)]
    entries = manifest.entries_of(folder) if there else {}
    return [name for name in there if name not in entries or manifest.is_changed(folder / name, entries[name])]


def _observed(folder: Path, name: str) -> Observed:
    """Return size and time of a file; None if there is none."""
    try:
        found = os.stat(f"{folder}/{name}")  # noqa: PTH116 - pathlib takes longer than the system
    except OSError:
        return None
    return [found.st_size, found.st_mtime_ns]
