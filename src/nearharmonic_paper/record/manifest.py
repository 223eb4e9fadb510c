"""The manifest of a folder of results, and the files that it vouches for."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from nearharmonic.errors import (
    NearharmonicError,
    ResultFileError,
    SettingError,
    UnknownNameError,
    bad_setting,
    unknown_name,
)
from nearharmonic.output.atomic import read_bytes, read_text, sealed, write_text
from nearharmonic.output.atomic import unsealed as opened
from nearharmonic.output.store import command_for, unusable
from nearharmonic.output.table import Table, from_csv
from nearharmonic.registry import check_trust, is_file, is_trusted
from nearharmonic_paper.record.history import HISTORY, runs_newest_first
from nearharmonic_paper.tasks.provenance import BESIDE, Receipts, files_in, measured, read_definitions, receipts_in
from nearharmonic_paper.tasks.provenance import digest_of_file as digest_of

# --- The manifest of a folder of results: size, digest and origin of every file, as written by its job.

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
    """
    from nearharmonic_paper.tasks.schema import complaint

    place, document = folder / MANIFEST, None
    try:
        document = opened(read_text(place))
        fault = "is damaged" if document is None else complaint("manifest", document)
    except FileNotFoundError:
        fault = "does not exist"
    except (OSError, ValueError):
        fault = "is damaged"
    if fault or document is None:
        raise ResultFileError(f"{place} {fault}. Make it again: {command_for(folder / 'report.html')}")
    return {"configfiles": [], "former": [], "unrecorded": [], **document}


def write(
    folder: Path, makeable: Collection[str] | None = None, configfiles: Sequence[str] = (),
    receipts: Receipts | None = None,
) -> list[str]:  # fmt: skip
    """Write the manifest of ``folder`` from its receipts, and from the previous manifest if a receipt is lost.

    ``makeable`` are the names of all files that jobs of the present config make, any by default: a missing one of them
    stays in the list. ``configfiles`` are the files of the config. The ``receipts`` are read unless given. The names of
    files that have changed after their job wrote them are returned, sorted; their entries keep the original digest. A
    manifest that cannot be written is an OSError.
    """
    known, there = entries_of(folder, receipts), set(names_in(folder))
    made = set(known if makeable is None else makeable)
    entries = {name: known[name] for name in sorted(known) if name in there | made}
    changed = [name for name, entry in entries.items() if name in there and is_changed(folder / name, entry)]
    document = {
        "format": FORMAT,
        "configfiles": list(configfiles),
        "files": {n: {k: v for k, v in entry.items() if k not in VARYING} for n, entry in entries.items()},
        "changed": changed,
        "former": sorted(entries.keys() - made),
        "unrecorded": sorted((there & made) - entries.keys()),
    }
    write_text(folder / MANIFEST, json.dumps(sealed(document), indent=1) + "\n")
    return changed


def entries_of(folder: Path, receipts: Receipts | None = None) -> dict[str, dict[str, Any]]:
    """Return the present entries of the files of ``folder``: from its receipts, or from the previous manifest.

    If a receipt and the manifest give different digests of a file, the file decides: the receipt of a later job agrees
    with it, an old receipt, for example from before a copy of the results, does not.
    """
    try:
        entries = dict(read(folder)["files"])
    except ResultFileError:
        entries = {}
    for _, receipt in receipts_in(folder) if receipts is None else receipts:
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


# --- Tables, documents and pictures of a result, each checked against its record before use.
class Texts:
    """The text files of a folder of results, ``results/<name>``."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @cached_property
    def _entries(self) -> dict[str, dict[str, Any]]:
        return entries_of(self._folder)

    def read(self, name: str) -> str:
        """Return the text of the file ``name``, relative to the folder.

        A file that is missing, no text, or changed after its job wrote it is a ResultFileError; the message has the
        command that makes it again.
        """
        place = self._folder / name
        try:
            content = read_bytes(place)
            if name in self._entries and sha256(content).hexdigest() != self._entries[name]["sha256"]:
                raise self.unusable(name, "is damaged: its bytes differ from what its job wrote")
            return content.decode()
        except FileNotFoundError:
            raise self.unusable(name, "does not exist") from None
        except (OSError, UnicodeDecodeError) as error:
            raise self.unusable(name, "cannot be read") from error

    def table(self, name: str) -> Table:
        """Return the table in the CSV file ``name``; a file without one is an error as for :meth:`read`."""
        text = self.read(name)
        try:
            return from_csv(text)
        except NearharmonicError as error:
            raise self.unusable(name, "holds no table") from error

    def unusable(self, name: str, complaint: str) -> ResultFileError:
        """Return the error for the file ``name``."""
        return unusable(self._folder / name, complaint)


# --- Result folders by name.

#: The folder of all results, below the folder of the project.
RESULTS = Path("results")
#: Files and folders that identify a folder of results: it has at least one.
SIGNS = ("manifest.json", "history.jsonl", "cubes", "logs/running")


def folder_of(name: str) -> Path:
    """Return the folder of a result by its path, or its name below ``results/``; else raise UnknownNameError."""
    for folder in (Path(name), RESULTS / name):
        if is_result(folder):
            return folder
    if known := result_names():
        raise unknown_name("result", name, known)
    says = f"no folder below {RESULTS}/ holds a result. Make the first: snakemake -j2"
    raise UnknownNameError(f"unknown result {name!r}: {says}")


def result_names() -> list[str]:
    """Return the sorted names of the folders below ``results/`` with a result."""
    return sorted(folder.name for folder in RESULTS.glob("*") if is_result(folder))


def is_result(folder: Path) -> bool:
    """Return True if ``folder`` has a manifest, a history or a folder of cubes."""
    return any((folder / sign).exists() for sign in SIGNS)


# --- Users' Python files of a result: those that its record names, and a check of those that the user trusts.

Entries = Iterable[Mapping[str, Any]]


def check_trusted(folder: Path, given: Iterable[str]) -> None:
    """Check that the files which the user trusts have made the results in ``folder``.

    No such file, or another digest or none of the newest run that used it, is a SettingError.
    """
    recorded = recorded_digests(folder)
    for file in given:
        if not is_file(Path(file)):
            raise bad_setting("--trust", file, "a Python file that the results name")
        if (key := _key(file)) not in recorded:
            raise bad_setting("--trust", file, f"the history of {folder} has no digest of such a file")
        if (digest := digest_of(file)) != recorded[key]:
            message = f"{file} is not the file that made {folder}: its code has the digest {digest}, recorded is"
            raise SettingError(f"{message} {recorded[key]}")


def recorded_digests(folder: Path) -> dict[str, str]:
    """Return the digest of the code of each user's file, by absolute path, as its newest run has recorded it."""
    runs = [run.get("user_files", {}) for _, run in reversed(runs_newest_first([folder]))]
    return {_key(file): digest for files in runs for file, digest in files.items()}


def is_edited(file: str | os.PathLike[str], recorded: Mapping[str, str]) -> bool:
    """Return True if the code of a user's file, which is read, has not the ``recorded`` digest."""
    return digest_of(file) != recorded.get(_key(file))


def check_files_of(entries: Entries) -> None:
    """Raise UntrustedFileError, which names each file, if entries of a manifest need users' files not trusted."""
    check_trust(
        *sorted({file for entry in entries for file in files_in(read_definitions(entry.get("definitions", {})))})
    )


def integrator_files_not_run(entries: Entries) -> list[str]:
    """Return the sorted files with integrators of entries of a manifest, without the trusted ones."""
    kinds = ({"integrators": entry.get("definitions", {}).get("integrators", {})} for entry in entries)
    files = {file for kind in kinds for file in files_in(read_definitions(kind))}
    return sorted(file for file in files if not is_trusted(file))


def _key(file: str | os.PathLike[str]) -> str:
    return str(Path(os.path.realpath(file)))
