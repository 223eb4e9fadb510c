"""Files: atomic writes, reads that never block, and seals of JSON documents."""

from __future__ import annotations

import errno
import json
import os
import platform
import stat
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, is_dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

from nearharmonic.errors import FileWriteError

# --- Atomic file writes: a file is written under a temporary name and then moved to its place.
#
# A reader sees the old file or the new one, never a part of either, also after a power failure: the bytes are on disk
# before the file gets its name. Temporary names are hidden and hold the host and the process, so that two machines
# never write to the same file in a shared folder. A killed process (SIGKILL, power loss) leaves its temporary file
# behind; the next run of the workflow deletes it. No rule and no reader uses such a name.

#: Ending of the names of temporary files.
PART = ".part"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, and move that file to ``path`` when the block ends.

    The folder is created if it is missing. If the block raises an exception, ``path`` does not change and the temporary
    file is removed. No other running process uses the temporary path. A FileWriteError says why the file cannot be
    written: the disk is full, the folder is read-only, or the like.
    """
    place = Path(path)
    part = place.with_name(f".{place.name}.{platform.node()}.{os.getpid()}{PART}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        yield part
        _synchronise(part)
        part.replace(place)
        with suppress(OSError):  # some file systems do not synchronise folders
            _synchronise(place.parent)
    except FileWriteError:
        raise
    except OSError as error:
        reason = (error.strerror or error) if error.filename in {None, os.fspath(part)} else error
        raise FileWriteError(f"{place} cannot be written: {reason}") from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _synchronise(path: Path) -> None:
    """Return when the content of a file or a folder is on disk."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write ``text`` to ``path`` in UTF-8, atomically, with the errors of :func:`replacing`."""
    write_bytes(path, text.encode())


def write_bytes(path: str | os.PathLike[str], content: bytes | memoryview) -> None:
    """Write ``content`` to ``path``, atomically, with the errors of :func:`replacing`."""
    # Not part.write_bytes: after an error, the traceback keeps its view of the content.
    with replacing(path) as part, part.open("wb") as file:
        file.write(content)


def parts_in(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the sorted paths of the temporary files below ``folder``."""
    return sorted(Path(folder).rglob(f".*{PART}"))


def remove_parts(folder: str | os.PathLike[str]) -> None:
    """Delete the temporary files of ended processes below ``folder``.

    The caller knows that no other process of this computer writes there. Files from another computer are deleted an
    hour after their last change: a job may still be running there.
    """
    here, old = f".{platform.node()}.", time.time() - 3600
    for part in parts_in(folder):
        if here in part.name or part.lstat().st_mtime < old:
            part.unlink(missing_ok=True)


def opened(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a regular file for reading, as bytes; an OSError says that it is missing, no such file, or not readable."""
    number = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # without the last, a pipe waits for its writer
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a regular file", os.fspath(path))
    return os.fdopen(number, "rb")


# --- Reading of files: a pipe, a device or a folder in place of a file is refused, and never blocks the reader.
def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a regular file, with the errors of :func:`opened`."""
    with opened(path) as file:
        return file.read()


def read_text(path: str | os.PathLike[str], errors: str = "strict") -> str:
    """Return the text of a regular file in UTF-8, with the errors of :func:`opened`.

    ``errors`` says what becomes of bytes that are no UTF-8: ``strict`` raises UnicodeDecodeError, a ValueError.
    """
    return read_bytes(path).decode("utf-8", errors)


# --- Seals of JSON documents: the last member, ``sha256``, is the digest of the others.
#
# A seal reveals accidental changes, such as a flipped bit. It is no signature: anybody can seal a changed document
# again.


def digest_of(document: Any) -> str:
    """Return the SHA-256 of ``document`` as JSON: keys sorted, settings as mappings, exact numbers as text."""
    return sha256(json.dumps(document, sort_keys=True, ensure_ascii=False, default=plain).encode()).hexdigest()


def plain(value: Any) -> Any:
    """Return a value that JSON does not know as a mapping or as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return dict(value) if isinstance(value, Mapping) else str(value)


def sealed(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``document`` followed by its seal."""
    return {**document, "sha256": digest_of(document)}


def unsealed(text: str | bytes) -> dict[str, Any] | None:
    """Return the document in a JSON text without its seal; None if there is no document, no seal or a wrong one."""
    try:
        found = json.loads(text)
        return found if isinstance(found, dict) and found.pop("sha256", None) == digest_of(found) else None
    except (ValueError, RecursionError):
        return None
