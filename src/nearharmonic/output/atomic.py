"""Atomic file writes: a file is written under a temporary name and then moved to its place.

A reader sees the old file or the new one, never a part of either. Temporary names are hidden and hold the host and the
process, so that two machines never write to the same file in a shared folder. A killed process (SIGKILL, power loss)
leaves its temporary file behind, which the next run of the workflow deletes. No rule and no reader uses such a name.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Ending of the names of temporary files.
PART = ".part"


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, and move that file to ``path`` when the block ends.

    The folder is created if it is missing. If the block raises an exception, ``path`` does not change and the temporary
    file is removed. No other running process uses the temporary path.
    """
    place = Path(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    part = place.with_name(f".{place.name}.{platform.node()}.{os.getpid()}{PART}")
    try:
        yield part
        part.replace(place)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write ``text`` to ``path`` in UTF-8, atomically."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write ``content`` to ``path``, atomically."""
    with replacing(path) as part:
        part.write_bytes(content)


def remove_parts(folder: str | os.PathLike[str]) -> list[Path]:
    """Delete the temporary files of ended processes below ``folder``, and return their paths.

    The caller knows that no other process of this computer writes there. Files from another computer are deleted an
    hour after their last change: a job may still be running there.
    """
    here, old = f".{platform.node()}.", time.time() - 3600
    parts = sorted(Path(folder).rglob(f".*{PART}"))
    found = [part for part in parts if here in part.name or part.lstat().st_mtime < old]
    for part in found:
        part.unlink(missing_ok=True)
    return found
