"""The last line of a result file: the SHA-256 of all bytes before it.

HDF5 ignores bytes after its own end of file. The digest is checked before a file is opened: with a damaged file the
HDF5 library may crash, return wrong numbers, or never end.
"""

from __future__ import annotations

import os
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from nearharmonic.output.reading import opened

#: Name and value of the attribute that identifies the result files of this package.
FORMAT_KEY, FORMAT = "format", "nearharmonic 2"
#: First bytes of any HDF5 file.
SIGNATURE = b"\x89HDF\r\n\x1a\n"
#: Beginning of the last line, before the digest and a line feed.
SEAL = b"\nnearharmonic sha256 "
SEALED = len(SEAL) + 2 * sha256().digest_size + len(b"\n")
#: Number of bytes per update of the digest.
PIECE = 2**20


def seal(content: BytesIO) -> None:
    """Append the last line to the bytes of a file."""
    content.seek(0, os.SEEK_END)
    content.write(_line(sha256(content.getbuffer()).hexdigest()))


def complaint(path: Path) -> str:
    """Return the reason why a file must not be opened, empty if there is none, without the HDF5 library."""
    try:
        with opened(path) as file:
            signed = file.read(len(SIGNATURE)) == SIGNATURE
            size = file.seek(0, os.SEEK_END) - SEALED
            if size < 0 or not signed:
                return "is truncated or no result file"
            digest = digest_of_first(file, size)
            last = file.read()
    except OSError as error:
        return "does not exist" if isinstance(error, FileNotFoundError) else f"cannot be read ({error.strerror})"
    if not last.startswith(SEAL):
        return "is truncated or no result file"
    return "" if last == _line(digest) else "is damaged: its bytes are not those that were written"


def digest_of_first(file: BinaryIO, size: int) -> str:
    """Return the SHA-256 of the first ``size`` bytes of a file; what follows is left to be read."""
    digest = sha256()
    file.seek(0)
    for start in range(0, size, PIECE):
        digest.update(file.read(min(PIECE, size - start)))
    return digest.hexdigest()


def sealed_digest(path: str | os.PathLike[str]) -> str:
    """Return the digest in the last line of a file, or an empty text if the file ends otherwise."""
    with opened(path) as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - SEALED))
        last = file.read()
    return last[len(SEAL) : -1].decode() if last.startswith(SEAL) and len(last) == SEALED else ""


def _line(digest: str) -> bytes:
    return SEAL + digest.encode() + b"\n"
