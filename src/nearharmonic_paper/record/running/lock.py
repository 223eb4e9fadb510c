"""Lock of a folder of results: one run of the workflow at a time. It ends with its process, also with a killed one."""

from __future__ import annotations

import fcntl
import os
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from nearharmonic.errors import RefusedError

#: File with the host and the number of the process that holds the lock, or held it last.
LOCK = Path("logs", "lock")


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of ``folder`` inside the block.

    In a folder without locks, for example a read-only one, the block runs after a warning.

    Raises
    ------
    RefusedError
        Another run holds the lock; the message names its host and process.
    """
    file = _opened(folder / LOCK)
    if file is None:
        yield
        return
    try:
        _acquire(file, folder)
        yield
    finally:
        os.close(file)


def _opened(place: Path) -> int | None:
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        return os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        _warn(place, error)
        return None


def _acquire(file: int, folder: Path) -> None:
    try:
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # unlike flock, no child process holds it too
    except (BlockingIOError, PermissionError):
        host, _, number = os.pread(file, 300, 0).decode(errors="replace").strip().rpartition(" ")
        holder = f"process {number} on {host}" if host else "another process"
        message = f"{folder} is in use: the workflow runs there as {holder}; wait for its end, or stop it"
        raise RefusedError(message) from None
    except OSError as error:
        _warn(folder / LOCK, error)
    else:
        os.ftruncate(file, 0)
        os.pwrite(file, f"{platform.node()} {os.getpid()}\n".encode(), 0)


def _warn(place: Path, error: OSError) -> None:
    print(f"nearharmonic: warning: two runs at once are not prevented: {place}: {error.strerror}", file=sys.stderr)
