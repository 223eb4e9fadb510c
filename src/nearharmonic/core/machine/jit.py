"""Decorators of functions that numba compiles: flags, and the folder of the machine code.

The module is separate because numba takes longer to load than most runs take; only searches import it.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.dispatcher import Dispatcher

from nearharmonic.core.machine import disk
from nearharmonic.core.machine.native import code_key

Function = TypeVar("Function", bound=Callable[..., Any])

FLAGS = {"error_model": "numpy", "nogil": True}


def jit(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code in the folder of compiled code.

    fastmath stays off because it changes numbers. ``error_model="numpy"`` omits the tests for division by zero, which
    slow loops down. ``nogil`` lets searches run in threads. numba compiles a function again after an edit of its own
    file, but not after an edit of the file of a callee or a constant. The name of the folder is therefore a digest of
    ``core``, of the modules beside the function, and of those beside the compiled functions that its module imports:
    callees and constants come from these only.
    """
    beside = sorted(path for folder in _folders(function, {}) for path in folder.glob("*.py"))
    folder = disk.folder_of(f"numba-{code_key(sources=beside)}")
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return numba.njit(cache=folder is not None, **FLAGS)(function)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before


def generic(function: Function) -> Function:
    """Compile ``function``, a closure of compiled functions, with each of its callers, in whose machine code it is."""
    return numba.njit(**FLAGS)(function)  # type: ignore[no-any-return]


def _folders(function: Callable[..., Any], found: dict[Path, None]) -> dict[Path, None]:
    """Add the folders of a function and of all compiled functions that its module and theirs know to ``found``."""
    found[Path(function.__code__.co_filename).parent] = None
    for callee in function.__globals__.values():
        if isinstance(callee, Dispatcher) and Path(callee.py_func.__code__.co_filename).parent not in found:
            _folders(callee.py_func, found)
    return found
