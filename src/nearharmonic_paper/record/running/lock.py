"""Lock of a folder of results: one run of the workflow at a time. It ends with its process, also with a killed one."""

from __future__ import annotations

import fcntl
import os
import platform
import sys
from pathlib import Path

from nearharmonic.errors import RefusedError

#: File with the host and the number of the process that holds the lock, or held it last.
LOCK = Path("logs", "lock")


def lock(folder: Path) -> None:
    """Hold the lock of ``folder`` until this process ends.

    In a folder without locks, for example a read-only one, there is a warning and no lock.

    Raises
    ------
    RefusedError
        Another run holds the lock; the message names its host and process.
    """
    place = folder / LOCK
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(place, os.O_RDWR | os.O_CREAT, 0o666)
        fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # unlike flock, no child process holds it too
    except (BlockingIOError, PermissionError):
        if not os.access(place, os.R_OK | os.W_OK):
            _warn(place, "Permission denied")
            return
        host, _, number = place.read_text(errors="replace").strip().rpartition(" ")
        holder = f"process {number} on {host}" if host else "another process"
        message = f"{folder} is in use: the workflow runs there as {holder}; wait for its end, or stop it"
        raise RefusedError(message) from None
    except OSError as error:
        _warn(place, str(error.strerror))
    else:
        os.ftruncate(file, 0)
        os.pwrite(file, f"{platform.node()} {os.getpid()}\n".encode(), 0)


def _warn(place: Path, reason: str) -> None:
    print(f"nearharmonic: warning: two runs at once are not prevented: {place}: {reason}", file=sys.stderr)
