"""Check of an archive: its seal, then each file against the digest in the metadata of the crate.

The seal is a digest of all bytes of the zip file in the comment at its end. A zip file itself protects the contents of
its members by 32-bit checksums, and leaves names, dates, sizes and its directory unprotected. The seal protects from
damage and says nothing about who made the file: a member that ``nearharmonic archive`` never writes is a fault, so that
an archive without a fault can be unpacked by any program.
"""

from __future__ import annotations

import hashlib
import json
import os
import stat
import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import unquote
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from nearharmonic.errors import ResultFileError
from nearharmonic.output.atomic import opened
from nearharmonic.output.store import digest_of_first
from nearharmonic.output.table import in_one_line
from nearharmonic_paper.record.archive.description import METADATA, PREVIEW, several, shown_in

#: Text of the comment of the zip file before the digest, and with a placeholder until the digest is known.
WORDS = b"nearharmonic archive 1; sha256 of all bytes before this comment: "
BLANK = WORDS + b"0" * (2 * hashlib.sha256().digest_size)
#: Exceptions from damaged zip files and damaged JSON.
_UNREADABLE = (
    BadZipFile, EOFError, KeyError, NotImplementedError, OSError, OverflowError, RuntimeError, TypeError, ValueError,
    struct.error,
)  # fmt: skip
_ENCRYPTED = 0x1


def close(place: Path) -> None:
    """Write the digest of a zip file, made with the comment :data:`BLANK`, into that comment."""
    with place.open("r+b") as file:
        file.write(_seal(file))


def _seal(file: BinaryIO) -> bytes:
    """Return the seal of all bytes before the place of the seal, and move ``file`` to that place."""
    start = max(0, file.seek(0, os.SEEK_END) - len(BLANK))
    return WORDS + digest_of_first(file, start).encode()


def faults_of_archive(path: str | os.PathLike[str]) -> list[str]:
    """Check an archive that ``nearharmonic archive`` wrote.

    The seal covers every byte of the file and is checked first: any change is detected, and a file without a seal is
    not interpreted. Then each file is compared with the metadata of the crate and with the manifest; if the seal is
    broken, this finds the damaged files. Each fault is a sentence; a file that cannot be read is a ResultFileError.
    """
    place = Path(path)
    try:
        with opened(place) as file:
            seal = _seal(file)
            written = file.read()
    except OSError as error:
        raise ResultFileError(f"{place} cannot be read: {error.strerror}") from error
    if not written.startswith(WORDS) or len(written) != len(BLANK):
        return [f"{place} is not an archive of `nearharmonic archive`, or its end is missing or damaged"]
    broken = [] if written == seal else [f"{place} is damaged: its bytes do not have the digest at its end"]
    try:
        with ZipFile(place) as archive:
            faults = list(_faults_of_members(archive, place.stat().st_size)) or list(_faults(archive, place.name))
    except _UNREADABLE as error:
        faults = [] if broken else [f"{place} cannot be read: {error}"]
    return [in_one_line(sentence) for sentence in broken + faults]


def _faults_of_members(archive: ZipFile, size: int) -> Iterator[str]:
    """Yield a sentence for each member that ``nearharmonic archive`` does not write, from the directory alone."""
    members = archive.infolist()
    names = {member.filename.casefold(): member.filename for member in members}
    counts = Counter(member.filename.casefold() for member in members)
    yield from (f"{names[name]} is in the archive {count} times" for name, count in counts.items() if count > 1)
    for member in members:
        yield from (f"{member.filename} {fault}" for fault in _faults_of_member(member))
    if sum(member.compress_size for member in members) > size:
        yield "members of the archive overlap: together they are larger than its file"


def _faults_of_member(member: ZipInfo) -> Iterator[str]:
    name = member.orig_filename
    # A relative path with slashes whose parts are ordinary names on every system.
    if not name.isprintable() or {"", ".", ".."} & {*name.split("/")} or {"\\", ":"} & {*name}:
        yield "is no plain path inside of the archive"
    mode = member.external_attr >> 16
    if stat.S_IFMT(mode) not in {0, stat.S_IFREG}:
        yield f"is {'a symbolic link' if stat.S_ISLNK(mode) else 'no regular file'}"
    if member.flag_bits & _ENCRYPTED:
        yield "is encrypted"
    if member.compress_type != ZIP_STORED:
        yield "is compressed: the members of an archive are stored as they are"


def _faults(archive: ZipFile, place: str) -> Iterator[str]:
    """Yield the deviations of the members from the metadata and from the manifest."""
    digests = {name: _digest(archive, name) for name in sorted(archive.namelist())}
    metadata = _object_in(archive, METADATA)
    described = _described(metadata)
    for name in sorted(described):
        if name not in digests:
            yield f"{name} is missing from {place}"
        elif digests[name] != described[name]:
            yield f"{name} in {place} does not have the size and the digest that {METADATA} gives"
    for name in sorted(digests.keys() - described.keys() - {METADATA, PREVIEW}):
        yield f"{name} in {place} is not described in {METADATA}"
    if PREVIEW in digests and shown_in(archive.read(PREVIEW)) != metadata:
        yield f"{PREVIEW} in {place} does not show {METADATA}"
    recorded = _object_in(archive, "manifest.json").get("files")
    if not isinstance(recorded, dict):
        yield "manifest.json has no table of files"
        return
    for name, entry in sorted(recorded.items()):
        if name not in digests:
            if PurePosixPath(name).parts[:1] != ("runs",):  # trajectories may be left out
                yield f"{name} is in manifest.json but not in the archive"
        elif not isinstance(entry, dict) or digests[name] != (entry.get("size"), entry.get("sha256")):
            yield f"{name} does not have the size and the digest that manifest.json gives"


def _digest(archive: ZipFile, name: str) -> tuple[int, str] | None:
    """Return size and digest of a member; None if it cannot be read."""
    try:
        member: Any = archive.open(name)
        with member:
            return archive.getinfo(name).file_size, hashlib.file_digest(member, "sha256").hexdigest()
    except _UNREADABLE:
        return None


def _object_in(archive: ZipFile, name: str) -> dict[str, Any]:
    """Return the JSON object in a member."""
    document = json.loads(archive.read(name))
    if not isinstance(document, dict):
        raise ResultFileError(f"{name} holds no JSON object")
    return document


def _described(metadata: Mapping[str, Any]) -> dict[str, tuple[int, str]]:
    """Return size and digest of each file in the metadata, by its path in the archive."""
    graph = metadata.get("@graph")
    entities = [entity for entity in graph if isinstance(entity, Mapping)] if isinstance(graph, list) else []
    files = [entity for entity in entities if "File" in several(entity.get("@type"))]
    return {unquote(str(file["@id"])): (int(str(file.get("contentSize"))), str(file.get("sha256"))) for file in files}
