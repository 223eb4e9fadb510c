"""Atomic file writes: a file is written under a temporary name and then moved to its place.

A reader sees the old file or the new one, never a part of either, also after a power failure: the bytes are on disk
before the file gets its name. Temporary names are hidden and hold the host and the process, so that two machines never
write to the same file in a shared folder. A killed process (SIGKILL, power loss) leaves its temporary file behind;
the next run of the workflow deletes it. No rule and no reader uses such a name.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from nearharmonic.errors import FileWriteError

#: Ending of the names of temporary files.
PART = ".part"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, and move that file to ``path`` when the block ends.

    The folder is created if it is missing. If the block raises an exception, ``path`` does not change and the temporary
    file is removed. No other running process uses the temporary path.

    Raises
    ------
    FileWriteError
        The file cannot be written: the disk is full, the folder is read-only, or the like.
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
    """Write ``text`` to ``path`` in UTF-8, atomically; errors are those of :func:`replacing`."""
    write_bytes(path, text.encode())


def write_bytes(path: str | os.PathLike[str], content: bytes | memoryview) -> None:
    """Write ``content`` to ``path``, atomically; errors are those of :func:`replacing`."""
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
