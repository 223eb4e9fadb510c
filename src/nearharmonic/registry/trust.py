"""Trust in users' Python files: commands that read results run none of them but those on their own command line."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from shlex import quote

from nearharmonic.errors import UntrustedFileError

#: Environment variable with the trusted files as a JSON list of absolute paths: child processes obey it too.
TRUSTED = "NEARHARMONIC_TRUSTED"


@contextmanager
def trusting_only(files: Iterable[str | os.PathLike[str]]) -> Iterator[None]:
    """Refuse inside the block, and in processes that start there, to run any user's file except ``files``.

    A block inside another one cannot allow more than the outer block.
    """
    before = os.environ.get(TRUSTED)
    allowed = {str(Path(file).resolve()) for file in files}
    if before is not None:
        allowed &= set(json.loads(before))
    os.environ[TRUSTED] = json.dumps(sorted(allowed))
    try:
        yield
    finally:
        if before is None:
            del os.environ[TRUSTED]
        else:
            os.environ[TRUSTED] = before


def is_trusted(file: str | os.PathLike[str]) -> bool:
    """Return True if a user's file may be run: any file outside of the blocks of :func:`trusting_only`."""
    given = os.environ.get(TRUSTED)
    return given is None or str(Path(file).resolve()) in json.loads(given)


def check_trust(*files: str | os.PathLike[str]) -> None:
    """Raise an error if a user's file must not be run.

    Raises
    ------
    UntrustedFileError
        One of the files is not among those of :func:`trusting_only`; the message has the SHA-256 of its bytes.
    """
    refused = [os.fspath(file) for file in files if not is_trusted(file)]
    if refused:
        told = ", ".join(f"{file} (SHA-256 {_digest_of(Path(file))})" for file in refused)
        options = " ".join(f"--trust {quote(file)}" for file in refused)
        is_code = "is Python code, which" if len(refused) == 1 else "are Python code, which"
        raise UntrustedFileError(f"{told} {is_code} is not run: read it, and allow it by {options}")


def _digest_of(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest() if file.is_file() else "unknown, there is no such file"
