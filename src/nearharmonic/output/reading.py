"""Reading of files: a pipe, a device or a folder in place of a file is refused, and never blocks the reader."""

from __future__ import annotations

import errno
import os
import stat
from typing import BinaryIO


def opened(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a regular file for reading, as bytes.

    Raises
    ------
    OSError
        The file is missing, or not a regular file, or it cannot be read.
    """
    number = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)  # without the last, a pipe waits for its writer
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "not a regular file", os.fspath(path))
    return os.fdopen(number, "rb")


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Return the bytes of a regular file; errors are those of :func:`opened`."""
    with opened(path) as file:
        return file.read()


def read_text(path: str | os.PathLike[str], errors: str = "strict") -> str:
    """Return the text of a regular file in UTF-8; errors are those of :func:`opened`.

    ``errors`` says what becomes of bytes that are no UTF-8: ``strict`` raises UnicodeDecodeError, a ValueError.
    """
    return read_bytes(path).decode("utf-8", errors)
