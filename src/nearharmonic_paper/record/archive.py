"""A result as one self-describing zip file, and the check of such a file."""

from __future__ import annotations

import hashlib
import json
import os
import stat
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO
from urllib.parse import unquote
from zipfile import ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from nearharmonic.errors import ResultFileError, SettingError, bad_setting
from nearharmonic.output.atomic import opened, replacing
from nearharmonic.output.store import digest_of_first
from nearharmonic.output.table import in_one_line
from nearharmonic.registry import split_path
from nearharmonic_paper.record import description, history, manifest
from nearharmonic_paper.record.description import METADATA, PREVIEW, Archive, Member, format_of, several, shown_in
from nearharmonic_paper.record.manifest import is_edited, recorded_digests
from nearharmonic_paper.tasks.provenance import files_of

# --- Check of an archive: its seal, then each file against the digest in the metadata of the crate.
#
# The seal is a digest of all bytes of the zip file in the comment at its end. A zip file itself protects the contents
# of its members by 32-bit checksums, and leaves names, dates, sizes and its directory unprotected. The seal protects
# from damage and says nothing about who made the file: a member that ``nearharmonic archive`` never writes is a
# fault, so that an archive without a fault can be unpacked by any program.

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


# --- A result as one self-describing zip file: an RO-Crate with the digest of every file and every run of the workflow.
#
# Equal results give equal bytes on every machine: members are sorted, have one fixed date and are stored without
# compression, because its output depends on the version of zlib. Almost all members already have compressed formats.

#: Folder of users' Python files in an archive.
USER_FILES = "user_files"
#: The date of every member, the earliest that a zip file can hold.
DATE = (1980, 1, 1, 0, 0, 0)

_CHUNK = 1 << 20
_FILE_MODE = 0o100644
_UNIX = 3
_KINDS = {
    "cubes": "Cube",
    "derived": "Document",
    "figures": "Figure",
    "report.html": "Page",
    "runs": "Trajectories",
    "tables": "Table",
}
_CONFIG = "Settings of a run as resolved; `snakemake --configfile` takes this file."


def reasons_against(folder: Path) -> list[str]:
    """Return the reasons against archiving the result in ``folder``, one sentence each; [] if there are none.

    A result is archived only if its files agree with its manifest, and if its history has their settings.
    """
    from nearharmonic_paper.record import verify

    return [str(fault) for fault in verify.faults(folder)] or ([] if history.runs_of(folder) else [_no_history(folder)])


def _no_history(folder: Path) -> str:
    return f"{folder / 'history.jsonl'} holds no run, so that the settings behind {folder.absolute().name} are unknown"


def save(
    folder: str | os.PathLike[str], place: str | os.PathLike[str] | None = None, *, with_runs: bool = False
) -> Path:
    """Write the result in ``folder`` as an archive, atomically.

    The caller calls :func:`reasons_against` first. Digests are checked again while files are copied. An existing file
    is replaced. ``with_runs`` includes the trajectories below ``runs/``.
    """
    result = Path(folder).absolute()
    zipped = target(result, place)
    members = _members(result, with_runs=with_runs)
    try:
        with replacing(zipped) as part:
            _write(part, members)
            close(part)
    except OSError as error:
        raise SettingError(f"{zipped} cannot be written: {error}") from error
    return zipped


def target(folder: str | os.PathLike[str], place: str | os.PathLike[str] | None) -> Path:
    """Return the file for an archive of the result in ``folder``; by default its name in the working directory.

    A ``place`` with another ending than .zip, that is a folder, or that lies in ``folder``, is a SettingError.
    """
    result = Path(folder).absolute()
    zipped = Path(f"{result.name}.zip" if place is None else place)
    if zipped.suffix != ".zip" or zipped.is_dir():
        raise bad_setting("-o", str(zipped), "a file with the ending .zip")
    if zipped.resolve().is_relative_to(result.resolve()):
        raise bad_setting("-o", str(zipped), f"a file outside of {result.name}, which it archives")
    return zipped


def _members(result: Path, *, with_runs: bool) -> list[Member]:
    """Return all members of the archive, sorted by path."""
    runs = [run for run in history.runs_of(result) if run["status"] != "damaged"]
    if not runs:
        raise ResultFileError(_no_history(result))
    recorded = manifest.read(result)["files"]
    taken = {path: entry for path, entry in recorded.items() if with_runs or not path.startswith("runs/")}
    about = Archive(result.name, runs, len(recorded) - len(taken))
    user_files = UserFiles(recorded.values(), recorded_digests(result))
    configs, texts = _configs(runs, user_files)
    makers = history.makers_in(result)
    members = [_result_file(result, path, entry, makers.get(path, entry.get("run"))) for path, entry in taken.items()]
    members += [Member.of_bytes(path, text, _CONFIG) for path, text in texts.items()]
    members += [Member.of_file(name, result / name, _sentence_on(name)) for name in manifest.LEFT_OUT]
    members += [_added(name, description.document(name)) for name in description.DOCUMENTS]
    members += [*user_files.members(), *description.workflow_files()]
    members.append(_added(description.ZENODO, description.zenodo(about)))
    members.append(_added("README.md", description.readme(about, members)))
    described = description.metadata(about, sorted(members, key=lambda member: member.path), configs)
    members.append(_added(description.METADATA, described))
    members.append(_added(description.PREVIEW, description.preview(described)))
    return sorted(members, key=lambda member: member.path)


def _added(name: str, content: bytes) -> Member:
    return Member.of_bytes(name, content, _sentence_on(name))


def _sentence_on(name: str) -> str:
    words = description.PLACES[name]
    return f"{words[0].upper()}{words[1:]}."


def _configs(runs: Sequence[history.Run], user_files: UserFiles) -> tuple[dict[str, str], dict[str, bytes]]:
    """Return the path of the config of each run by the id of the run, and the text of each config by its path.

    The config of the newest successful run is ``config.json``; different configs have their digest in the name. Keys
    without values are omitted, as in a handwritten config.
    """
    texts = {
        run["id"]: json.dumps(_set(user_files.config(run["config"])), indent=1, ensure_ascii=False).encode() + b"\n"
        for run in runs
    }
    newest = texts[next((run for run in reversed(runs) if run["status"] == "ok"), runs[-1])["id"]]
    paths = {
        name: "config.json" if text == newest else f"config-{hashlib.sha256(text).hexdigest()[:12]}.json"
        for name, text in texts.items()
    }
    return paths, {path: texts[name] for name, path in paths.items()}


def _set(value: Any) -> Any:
    """Return ``value`` without None values of nested mappings."""
    if isinstance(value, Mapping):
        return {key: _set(member) for key, member in value.items() if member is not None}
    return value


def _result_file(result: Path, path: str, entry: Mapping[str, Any], run: str | None) -> Member:
    """Return the member for the file ``path`` of ``result`` with this ``entry`` in the manifest, made by ``run``."""
    first = PurePosixPath(path).parts[0]
    stem = PurePosixPath(path).with_suffix("").relative_to(first) if path != first else PurePosixPath(first)
    measured = "; holds measured times" if entry.get("volatile") else ""
    says = f"{_KINDS.get(first, 'File')} {stem}, {format_of(path)[1]}, made by {entry['function']}{measured}."
    return Member(
        path=path, source=result / path, size=entry["size"], sha256=entry["sha256"], description=says, run=run
    )  # fmt: skip


def _write(place: Path, members: Sequence[Member]) -> None:
    with ZipFile(place, "w", ZIP_STORED) as archive:
        archive.comment = BLANK
        for member in members:
            information = ZipInfo(member.path, DATE)
            information.create_system = _UNIX
            information.external_attr = _FILE_MODE << 16
            information.file_size = member.size
            digest = hashlib.sha256()
            with archive.open(information, "w") as copy, description.opened(member.source) as source:
                while chunk := source.read(_CHUNK):
                    digest.update(chunk)
                    copy.write(chunk)
            if digest.hexdigest() != member.sha256:
                message = f"{member.path} is not the file that the manifest records: see `nearharmonic verify`"
                raise ResultFileError(message)


class UserFiles:
    """Users' files of some results, from the entries of their manifest and the ``recorded`` digests of their code."""

    def __init__(self, entries: Iterable[Mapping[str, Any]], recorded: Mapping[str, str]) -> None:
        self._recorded = recorded
        self._systems: dict[str, Path] = {}
        self._integrators: dict[str, Path] = {}
        for defined in (entry.get("definitions", {}) for entry in entries):
            systems = defined.get("systems", {})
            self._systems |= {name: Path(own["file"]) for name, own in systems.items() if own["file"] is not None}
            methods = defined.get("integrators", {}).values()
            self._integrators |= {method["written"]: Path(method["file"]) for method in methods}
        self._paths = (*self._systems.values(), *self._integrators.values())
        parents = sorted({path.parent for path in self._paths})
        folders = [USER_FILES] if len(parents) == 1 else [f"{USER_FILES}/{i}" for i in range(1, len(parents) + 1)]
        self._folders = dict(zip(parents, folders, strict=True))

    def members(self) -> list[Member]:
        """Return the members of an archive for these files and the files that they import.

        A manifest may name any file: a file whose code has another digest than recorded raises ResultFileError.
        """
        members = {}
        for path in self._paths:
            if is_edited(path, self._recorded):
                raise ResultFileError(f"{path} is not archived: its code has no digest in the history, or another one")
            for file in files_of(path):
                name = f"{self._folders[path.parent]}/{file.relative_to(path.parent).as_posix()}"
                members[name] = Member.of_file(name, file, "Python file of a system or an integrator of the config.")
        return list(members.values())

    def config(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return a config of the history in which the paths of files are those in the archive."""
        return {key: self._placed(key, value) for key, value in given.items()}

    def _placed(self, key: str, value: Any) -> Any:
        if key == "systems" and isinstance(value, Mapping):
            own = {n: s for n, s in value.items() if n in self._systems and s.get("file") is not None}
            return {**value, **{n: {**s, "file": self._place(self._systems[n])} for n, s in own.items()}}
        if isinstance(value, Mapping):
            return self.config(value)
        if key in {"integrators", "decomposition", "overview"} and isinstance(value, list):
            return [self._integrator(entry) for entry in value]
        return value

    def _integrator(self, entry: str) -> str:
        path, name = split_path(entry)
        if path not in self._integrators:
            return entry
        return self._place(self._integrators[path]) + (f":{name}" if name else "")

    def _place(self, path: Path) -> str:
        return f"{self._folders[path.parent]}/{path.name}"
