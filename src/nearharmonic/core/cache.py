"""A cache of jitted functions that hits across processes and is never stale.

Numba's own file cache looks only at the file of the compiled function: it misses for functions that close over others,
and returns old code when a callee elsewhere has changed (numba issues 1833 and 6772). Here the caller names everything
that the machine code depends on, and a digest of that is the key.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, _CacheLocator

from nearharmonic.core.native import cache_folder, core_digest

__all__ = ["KernelCache", "compiled", "core_digest", "named", "strict"]


class _Locator(_CacheLocator):  # type: ignore[misc]
    """Places the files of one kernel; freshness is the key's business, so the stamp is constant."""

    def __init__(self, digest: str) -> None:
        self._digest = digest

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return self._digest

    def get_disambiguator(self) -> str:
        return self._digest[:16]

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> _Locator:
        raise NotImplementedError("made by KernelCache alone")


class _KernelImpl(CompileResultCacheImpl):  # type: ignore[misc]
    def __init__(self, digest: str, name: str) -> None:
        self._locator = _Locator(digest)
        self._filename_base = f"{name}-{digest[:16]}"


class KernelCache(FunctionCache):  # type: ignore[misc]
    """Numba's function cache with the key given by ``digest`` instead of guessed from the bytecode."""

    def __init__(self, py_func: Callable[..., Any], digest: str) -> None:
        self._name, self._py_func, self._digest = py_func.__name__, py_func, digest
        self._impl = _KernelImpl(digest, py_func.__name__)
        self._cache_path = self._impl.locator.get_cache_path()
        self._cache_file = IndexDataCacheFile(self._cache_path, self._impl.filename_base, digest)
        self.enable()

    def _index_key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return sig, codegen.magic_tuple(), self._digest


def named(py_func: Callable[..., Any], digest: str) -> Callable[..., Any]:
    """``py_func`` under a name that no other kernel has.

    Symbols in compiled code derive from this name. Two kernels loaded from the cache under one name resolve to the same
    machine code, with the wrong array layout.
    """
    py_func.__qualname__ = f"{py_func.__name__}_{digest[:16]}"
    return py_func


def strict(py_func: Callable[..., Any]) -> Callable[..., Any]:
    """``py_func`` jitted with the flags of every kernel, compiled at its first use.

    ``error_model="numpy"`` because the check for division by zero blocks SIMD; no fastmath, which deletes the carry of
    compensated summation.
    """
    return numba.njit(error_model="numpy", fastmath=False, nogil=True)(py_func)  # type: ignore[no-any-return]


def compiled(py_func: Callable[..., Any], signature: Any, digest: str) -> Callable[..., Any]:
    """``py_func`` compiled for ``signature``, from the cache if it holds ``digest``."""
    dispatcher: Any = strict(py_func)
    dispatcher._cache = KernelCache(py_func, digest)
    dispatcher.compile(signature)
    dispatcher.disable_compile()
    return dispatcher  # type: ignore[no-any-return]
