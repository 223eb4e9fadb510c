"""What surrounds the work of a workflow's job: its log file, and errors that end it with one message."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

from nearharmonic.errors import NearharmonicError


@contextmanager
def logged(path: str) -> Iterator[None]:
    """Send what is printed to the file ``path``; an error goes there in full, and in one sentence to the terminal.

    Raises:
        SystemExit: with status 1, for any error of the work inside.
    """
    with Path(path).open("w", encoding="utf-8") as log:
        try:
            with redirect_stdout(log), redirect_stderr(log):
                yield
        except NearharmonicError as error:
            log.write(f"{error}\n")
            raise SystemExit(str(error)) from None
        except Exception as error:
            traceback.print_exc(file=log)
            message = f"{type(error).__name__}: {error} (traceback in {path})"
            raise SystemExit(message) from None
