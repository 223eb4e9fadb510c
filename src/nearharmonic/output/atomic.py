"""Atomic file writes: a file is written under a temporary name and then moved to its place.

A reader sees the old file or the new one, never a part of either. Temporary names are hidden and hold the host and the
process, so that two machines never write to the same file in a shared folder. A killed process (SIGKILL, power loss)
leaves its temporary file behind. No rule and no reader uses such a name, so the file can be deleted at any time.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``, and move that file to ``path`` when the block ends.

    The folder is created if it is missing. If the block raises an exception, ``path`` does not change and the temporary
    file is removed. No other running process uses the temporary path.
    """
    place = Path(path)
    place.parent.mkdir(parents=True, exist_ok=True)
    part = place.with_name(f".{place.name}.{platform.node()}.{os.getpid()}.part")
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
