"""The folder of compiled code: its path, the trust in its files, and their reading and writing.

A user who can write to the folder can make this process execute any code. A folder or file that belongs to another
user, or that others can change, is not used unless ``NEARHARMONIC_SHARED_CACHE=1``. If nothing can be kept, a process
logs one warning and compiles its own code.
"""

from __future__ import annotations

import logging
import os
import platform
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

#: Seconds to wait for code that another process compiles; a kernel of many coordinates takes 1 to 10.
PATIENCE = 120.0
#: Without it, opening a pipe would wait for its writer.
_NO_WAIT = getattr(os, "O_NONBLOCK", 0)
#: Bytes that are written to a folder on trial before numba writes to it: a few times its machine code.
ROOM = 2**20
_WARNED: list[str] = []
_WRITTEN: set[Path] = set()


def cache_folder() -> Path:
    """Return the folder of compiled code: ``NEARHARMONIC_CACHE_DIR`` if set, else a folder in the user's cache folder.

    A user without a home folder gets a RuntimeError.
    """
    chosen = os.environ.get("NEARHARMONIC_CACHE_DIR")
    if chosen:
        return Path(chosen).expanduser()
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "nearharmonic" / "kernels"


def place_of(key: str) -> Path | None:
    """Return the path of the file for ``key``; None, with a warning, if no folder can be trusted."""
    folder = _trusted()
    return folder / f"{key}.kernel" if folder else None


def folder_of(name: str) -> Path | None:
    """Return the subfolder ``name`` of the folder of compiled code; None, with a warning, if it has no room for code.

    numba ends a program whose code it cannot write.
    """
    folder = _trusted() and _trusted(name)
    if folder and folder not in _WRITTEN:
        try:
            with tempfile.TemporaryFile(dir=folder) as file:
                file.write(bytes(ROOM))
        except OSError as error:
            _warn(str(error))
            return None
        _WRITTEN.add(folder)
    return folder


def _trusted(name: str = "") -> Path | None:
    """Return the folder of compiled code, or its subfolder ``name``; None, with a warning, if it cannot be trusted."""
    try:
        folder = cache_folder() / name
        for path in reversed([folder, *folder.parents]):
            if not path.exists():
                path.mkdir(mode=0o700, exist_ok=True)
        fault = _fault(folder.stat()) if folder.is_dir() else "is not a folder"
    except (OSError, RuntimeError) as error:
        _warn(str(error))
        return None
    if fault:
        _warn(f"{folder} {fault}")
        return None
    return folder


def read(place: Path) -> tuple[str, bytes] | None:
    """Return the symbol and the object code in the file ``place``, or None if it is absent.

    A file that is damaged, or that another user may have changed, is deleted, and the result is None.
    """
    try:
        with os.fdopen(os.open(place, os.O_RDONLY | _NO_WAIT), "rb") as file:
            fault, content = _fault(os.fstat(file.fileno())), file.read()
    except OSError:
        return None
    digest, _, rest = content.partition(b"\n")
    if fault or digest != _digest(place, rest):
        discard(place)
        return None
    name, _, code = rest.partition(b"\n")
    return name.decode(), code


def write(place: Path, name: str, code: bytes) -> None:
    """Write the symbol ``name`` and its object ``code`` to the file ``place``; log a warning if that fails."""
    rest = f"{name}\n".encode() + code
    # Unique among the hosts that share a file system, their processes and threads.
    prefix = f"{place.stem}.{platform.node()}.{os.getpid()}."
    try:
        descriptor, part = tempfile.mkstemp(dir=place.parent, prefix=prefix, suffix=".part")
        try:
            with os.fdopen(descriptor, "wb") as file:
                file.write(_digest(place, rest) + b"\n" + rest)
            if _shared():
                Path(part).chmod(0o644)
            Path(part).replace(place)
        except BaseException:
            discard(Path(part))
            raise
    except OSError as error:
        _warn(str(error))


@contextmanager
def claimed(place: Path | None) -> Iterator[None]:
    """Hold a lock for the file ``place`` inside the block; another process that claims it waits up to :data:`PATIENCE`.

    The lock ends with its process, also on other hosts of a shared folder. Where files cannot be locked, the block runs
    without a lock, and several processes may compile the same code.
    """
    descriptor = _lock(place.with_suffix(".lock")) if place else None
    try:
        yield
    finally:
        if place and descriptor is not None:
            discard(place.with_suffix(".lock"))
            os.close(descriptor)


def _lock(path: Path) -> int | None:
    """Return the descriptor of the locked file ``path``; None if it cannot be locked."""
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock

        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666 if _shared() else 0o600)
    except (ImportError, OSError):
        return None
    end = time.monotonic() + PATIENCE
    while True:
        try:
            flock(descriptor, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            if time.monotonic() < end:
                time.sleep(0.05)
                continue
        except OSError:
            pass
        else:
            return descriptor
        os.close(descriptor)
        return None


def discard(place: Path) -> None:
    """Delete the file ``place`` if possible; otherwise each process compiles its code again."""
    with suppress(OSError):
        place.unlink()


def _digest(place: Path, rest: bytes) -> bytes:
    """Return the first line of the file ``place``: a digest of its name and of all following bytes."""
    return sha256(f"{place.name}\n".encode() + rest).hexdigest().encode()


def _shared() -> bool:
    return os.environ.get("NEARHARMONIC_SHARED_CACHE") == "1"


def _fault(status: os.stat_result) -> str:
    """Return the reason to distrust a file or folder of this status, or an empty text."""
    if _shared() or not hasattr(os, "geteuid"):  # Windows has no such owners and modes
        return ""
    if status.st_uid != os.geteuid():
        return "belongs to another user"
    return "is writable by group or others" if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH) else ""


def _warn(reason: str) -> None:
    """Log ``reason`` once per process; a Python warning could end the run, where a filter makes it an error."""
    if not _WARNED:
        _WARNED.append(reason)
        logging.getLogger("nearharmonic").warning(
            "compiled code is not kept, and each process compiles it anew: %s. Set NEARHARMONIC_CACHE_DIR to a folder "
            "that only you can write to, or NEARHARMONIC_SHARED_CACHE=1 to trust all who can write to that one.",
            reason,
        )
