"""The manifest of a folder of results: size, digest and origin of every file, as written by its job."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import ResultFileError
from nearharmonic.output.atomic import read_text, sealed, write_text
from nearharmonic.output.atomic import sealed_json_opened as opened
from nearharmonic.output.store import command_for
from nearharmonic_paper.record.history import HISTORY
from nearharmonic_paper.tasks.receipts import BESIDE, measured, receipts_in

MANIFEST = "manifest.json"
FORMAT = "nearharmonic manifest 1"
#: What a receipt says that differs between runs with equal results: the time of a file, and the run that made it.
VARYING = ("modified", "run")
#: Files that no manifest lists, because they change with every run.
LEFT_OUT = (HISTORY, MANIFEST)


def read(folder: Path) -> dict[str, Any]:
    """Return the manifest of ``folder`` without its own SHA-256, which is verified.

    Its keys are ``format``; ``configfiles``; ``files``, the entries by name; and lists of file names: files ``changed``
    after their jobs wrote them, files of a ``former`` config, and ``unrecorded`` files without a receipt.

    Raises
    ------
    ResultFileError
        The manifest is missing or invalid; the message names the command that makes it again.
    """
    from nearharmonic_paper.tasks.receipts.schema import complaint

    place, found = folder / MANIFEST, None
    try:
        found = opened(read_text(place))
        fault = "is damaged" if found is None else complaint("manifest", found)
    except FileNotFoundError:
        fault = "does not exist"
    except (OSError, ValueError):
        fault = "is damaged"
    if fault or found is None:
        raise ResultFileError(f"{place} {fault}. Make it again: {command_for(folder / 'report.html')}")
    return {"configfiles": [], "former": [], "unrecorded": [], **found}


def write(folder: Path, makeable: Collection[str] | None = None, configfiles: Sequence[str] = ()) -> list[str]:
    """Write the manifest of ``folder`` from its receipts, and from the previous manifest if a receipt is lost.

    ``makeable`` are the names of all files that jobs of the present config make, any by default: a missing one of them
    stays in the list. ``configfiles`` are the files of the config. The names of files that have changed after their job
    wrote them are returned, sorted; their entries keep the original digest. A manifest that cannot be written is an
    OSError.
    """
    entries = entries_of(folder)
    there = set(names_in(folder))
    wanted = there if makeable is None else there | set(makeable)
    entries = {name: entries[name] for name in sorted(entries) if makeable is None or name in wanted}
    changed = [name for name, entry in entries.items() if name in there and is_changed(folder / name, entry)]
    for entry in entries.values():
        for varying in VARYING:
            entry.pop(varying, None)
    document = {
        "format": FORMAT,
        "configfiles": list(configfiles),
        "files": entries,
        "changed": changed,
        "former": [] if makeable is None else sorted(entries.keys() - set(makeable)),
        "unrecorded": [] if makeable is None else sorted((there & set(makeable)) - entries.keys()),
    }
    write_text(folder / MANIFEST, json.dumps(sealed(document), indent=1) + "\n")
    return changed


def entries_of(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the present entries of the files of ``folder``: from receipts, or from the previous manifest.

    If a receipt and the manifest give different digests of a file, the file decides: the receipt of a later job agrees
    with it, an old receipt, for example from before a copy of the results, does not.
    """
    try:
        entries = dict(read(folder)["files"])
    except ResultFileError:
        entries = {}
    for _, receipt in receipts_in(folder):
        for name, entry in receipt.items():
            place, before = folder / name, entries.get(name, entry)
            differs = before["sha256"] != entry["sha256"] and place.is_file()
            if not (differs and is_changed(place, entry) and not is_changed(place, before)):
                entries[name] = entry
    return entries


def names_in(folder: Path) -> Iterator[str]:
    """Yield the names of all files for a manifest, without temporary files of unfinished writes."""
    for place in sorted(folder.rglob("*")):
        name = place.relative_to(folder)
        is_beside = name.parts[0] in BESIDE or str(name) in LEFT_OUT or place.name.endswith(".part")
        if not is_beside and place.is_file():
            yield name.as_posix()


def is_changed(place: Path, entry: Mapping[str, Any]) -> bool:
    """Return True if a file differs from the output of its job; equal size and time count as equal."""
    try:
        state = place.stat()
        if (state.st_size, state.st_mtime_ns) == (entry["size"], entry.get("modified")):
            return False
        return bool(measured(place)["sha256"] != entry["sha256"])
    except OSError:  # a folder, a pipe or a device in its place
        return True
