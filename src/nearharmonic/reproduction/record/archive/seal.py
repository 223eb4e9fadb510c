"""The seal of an archive: a digest of all its bytes in the comment at the end of the zip file.

A zip file protects the contents of its members by 32-bit checksums and leaves names, dates, sizes and its directory
unprotected. The seal covers every byte before it, and it is checked before anything in the file is interpreted.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

#: Text of the comment of the zip file before the digest.
WORDS = b"nearharmonic archive 1; sha256 of all bytes before this comment: "
#: Placeholder of the right length until the digest is known.
BLANK = WORDS + b"0" * (2 * hashlib.sha256().digest_size)

_CHUNK = 1 << 20


def close(place: str | os.PathLike[str]) -> None:
    """Write the digest of a zip file, made with the comment :data:`BLANK`, into that comment."""
    with Path(place).open("r+b") as file:
        start = file.seek(-len(BLANK), os.SEEK_END)
        seal = _seal(file, start)
        file.seek(start)
        file.write(seal)


def is_sealed(place: str | os.PathLike[str]) -> bool:
    """Return True if ``place`` ends with a seal; :func:`is_whole` checks its digest.

    Raises
    ------
    OSError
        ``place`` cannot be read.
    """
    with Path(place).open("rb") as file:
        return _start(file) is not None


def is_whole(place: str | os.PathLike[str]) -> bool:
    """Return True if the digest in the seal of ``place`` equals that of the bytes before the seal.

    Raises
    ------
    OSError
        ``place`` cannot be read.
    """
    with Path(place).open("rb") as file:
        start = _start(file)
        if start is None:
            return False
        written = file.read(len(BLANK))
        return written == _seal(file, start)


def _start(file: BinaryIO) -> int | None:
    """Move ``file`` to its seal and return the position; None without a seal."""
    start = file.seek(0, os.SEEK_END) - len(BLANK)
    if start < 0:
        return None
    file.seek(start)
    words = file.read(len(WORDS))
    file.seek(start)
    return start if words == WORDS else None


def _seal(file: BinaryIO, size: int) -> bytes:
    """Return the seal of the first ``size`` bytes of ``file``."""
    digest = hashlib.sha256()
    file.seek(0)
    while size > 0 and (chunk := file.read(min(_CHUNK, size))):
        digest.update(chunk)
        size -= len(chunk)
    return WORDS + digest.hexdigest().encode()
