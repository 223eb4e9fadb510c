"""The seal of an archive: a digest of all its bytes in the comment at the end of the zip file.

A zip file protects the contents of its members by 32-bit checksums and leaves names, dates, sizes and its directory
unprotected. The seal covers every byte before it, and it is checked before anything in the file is interpreted.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import BinaryIO

from nearharmonic.output.atomic import opened
from nearharmonic.output.store import digest_of_first

#: Text of the comment of the zip file before the digest.
WORDS = b"nearharmonic archive 1; sha256 of all bytes before this comment: "
#: Placeholder of the right length until the digest is known.
BLANK = WORDS + b"0" * (2 * hashlib.sha256().digest_size)


def close(place: str | os.PathLike[str]) -> None:
    """Write the digest of a zip file, made with the comment :data:`BLANK`, into that comment."""
    with Path(place).open("r+b") as file:
        file.write(_seal(file))


def is_whole(place: str | os.PathLike[str]) -> bool | None:
    """Return True if the digest in the seal of ``place`` equals that of the bytes before it; None without a seal.

    Raises
    ------
    OSError
        ``place`` cannot be read.
    """
    with opened(place) as file:
        seal = _seal(file)
        written = file.read()
    return written == seal if written.startswith(WORDS) and len(written) == len(BLANK) else None


def _seal(file: BinaryIO) -> bytes:
    """Return the seal of all bytes before the place of the seal, and move ``file`` to that place."""
    start = max(0, file.seek(0, os.SEEK_END) - len(BLANK))
    return WORDS + digest_of_first(file, start).encode()
