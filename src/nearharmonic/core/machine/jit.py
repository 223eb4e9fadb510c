"""Decorator of functions that numba compiles: flags, and the folder of the machine code.

The module is separate because numba takes longer to load than most runs take; only searches import it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba

from nearharmonic.core.machine import disk
from nearharmonic.core.machine.native import code_key

Function = TypeVar("Function", bound=Callable[..., Any])


def jit(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code in the folder of compiled code.

    fastmath stays off because it changes numbers. ``error_model="numpy"`` omits the tests for division by zero, which
    slow loops down. ``nogil`` lets searches run in threads. numba compiles a function again after an edit of its own
    file, but not after an edit of the file of a callee or a constant. The name of the folder is therefore a digest of
    ``core`` and of the modules beside the function: compiled functions import callees and constants from these only.
    """
    beside = sorted(Path(function.__code__.co_filename).parent.glob("*.py"))
    folder = disk.folder_of(f"numba-{code_key(sources=beside)}")
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return numba.njit(cache=folder is not None, error_model="numpy", nogil=True)(function)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before
