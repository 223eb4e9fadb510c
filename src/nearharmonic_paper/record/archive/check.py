"""Check of an archive: its seal, then each file against the digest in the metadata of the crate."""

from __future__ import annotations

import hashlib
import json
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote
from zipfile import BadZipFile, ZipFile

from nearharmonic.errors import ResultFileError
from nearharmonic.output.table import in_one_line
from nearharmonic_paper.record.archive import seal
from nearharmonic_paper.record.archive.description.metadata import METADATA, PREVIEW
from nearharmonic_paper.record.archive.description.preview import shown_in
from nearharmonic_paper.record.archive.members import faults_of_members
from nearharmonic_paper.record.archive.pack import RUNS

#: Exceptions from damaged zip files and damaged JSON.
_UNREADABLE = (
    BadZipFile, EOFError, KeyError, NotImplementedError, OSError, OverflowError, RuntimeError, TypeError, ValueError,
    struct.error,
)  # fmt: skip


def faults_of_archive(path: str | os.PathLike[str]) -> list[str]:
    """Check an archive that ``nearharmonic archive`` wrote.

    The seal covers every byte of the file and is checked first: any change is detected, and a file without a seal is
    not interpreted. Then each file is compared with the metadata of the crate and with the manifest; if the seal is
    broken, this finds the damaged files.

    Returns
    -------
    list of str
        Faults, one sentence each; [] if there are none.

    Raises
    ------
    ResultFileError
        The file does not exist or cannot be read.
    """
    place = Path(path)
    try:
        whole = seal.is_whole(place)
    except OSError as error:
        message = f"{place} cannot be read: {error.strerror}"
        raise ResultFileError(message) from error
    if whole is None:
        return [f"{place} is not an archive of `nearharmonic archive`, or its end is missing or damaged"]
    broken = [] if whole else [f"{place} is damaged: its bytes do not have the digest at its end"]
    try:
        found = list(_faults_of_contents(place))
    except _UNREADABLE as error:
        found = [] if broken else [f"{place} cannot be read: {error}"]
    return [in_one_line(sentence) for sentence in broken + found]


def _faults_of_contents(place: Path) -> Iterator[str]:
    with ZipFile(place) as archive:
        unsafe = list(faults_of_members(archive, place.stat().st_size))
        yield from unsafe
        if unsafe:
            return
        digests = {name: _digest(archive, name) for name in sorted(archive.namelist())}
        described = _described(archive)
        for name in sorted(described):
            if name not in digests:
                yield f"{name} is missing from {place.name}"
            elif digests[name] != described[name]:
                yield f"{name} in {place.name} does not have the size and the digest that {METADATA} gives"
        for name in sorted(digests.keys() - described.keys() - {METADATA, PREVIEW}):
            yield f"{name} in {place.name} is not described in {METADATA}"
        if PREVIEW in digests and shown_in(archive.read(PREVIEW)) != _document(archive, METADATA):
            yield f"{PREVIEW} in {place.name} does not show {METADATA}"
        yield from _faults_against_manifest(archive, digests)


def _digest(archive: ZipFile, name: str) -> tuple[int, str] | None:
    """Return size and digest of a member; None if it cannot be read."""
    try:
        member: Any = archive.open(name)
        with member:
            return archive.getinfo(name).file_size, hashlib.file_digest(member, "sha256").hexdigest()
    except _UNREADABLE:
        return None


def _document(archive: ZipFile, name: str) -> dict[str, Any]:
    """Return the JSON object in a member."""
    found = json.loads(archive.read(name))
    if not isinstance(found, dict):
        message = f"{name} holds no JSON object"
        raise ResultFileError(message)
    return found


def _described(archive: ZipFile) -> dict[str, tuple[int, str]]:
    """Return size and digest of each file in the metadata, by its path in the archive."""
    graph = _document(archive, METADATA).get("@graph")
    entities = [entity for entity in graph if isinstance(entity, Mapping)] if isinstance(graph, list) else []
    files = (entity for entity in entities if "File" in _values(entity.get("@type")))
    return {unquote(str(file["@id"])): (int(str(file.get("contentSize"))), str(file.get("sha256"))) for file in files}


def _values(value: object) -> list[object]:
    return value if isinstance(value, list) else [value]


def _faults_against_manifest(archive: ZipFile, digests: Mapping[str, tuple[int, str] | None]) -> Iterator[str]:
    recorded = _document(archive, "manifest.json").get("files")
    if not isinstance(recorded, dict):
        yield "manifest.json has no table of files"
        return
    for name, entry in sorted(recorded.items()):
        if name not in digests:
            if PurePosixPath(name).parts[:1] != (RUNS,):
                yield f"{name} is in manifest.json but not in the archive"
        elif not isinstance(entry, dict) or digests[name] != (entry.get("size"), entry.get("sha256")):
            yield f"{name} does not have the size and the digest that manifest.json gives"
