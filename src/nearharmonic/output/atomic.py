"""The one way in which this package writes a result file: under a temporary name, then moved into its place.

A reader sees the old file or the new one, never a part of either. Temporary names are hidden and hold the host and the
process, so that two machines on a shared folder never write to the same one. A process that is killed (SIGKILL, power
loss) leaves its temporary file behind; no rule and no reader asks for such a name, so it can be deleted at any time.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` to write to, and move that file to ``path`` when the block ends.

    The parent folder is made if it is missing. If the block raises, ``path`` stays as it was and the temporary file is
    removed.

    Parameters
    ----------
    path
        The file to make or to replace.

    Yields
    ------
    Path
        A name in the folder of ``path`` that no other running process uses.
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
    """Write ``text`` to ``path`` in UTF-8, whole or not at all."""
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write ``content`` to ``path``, whole or not at all."""
    with replacing(path) as part:
        part.write_bytes(content)
