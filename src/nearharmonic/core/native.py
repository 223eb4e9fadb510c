"""Machine code kept on disk and called without the compiler: loading numba takes longer than a figure's integrations.

A file holds the name of a C function and an object file. Its key covers the sources of this folder, the versions of
the compilers, the processor, and whatever the caller names, so it is never stale. The files live in
``NEARHARMONIC_CACHE_DIR`` if set, else in the user's cache folder.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import binding

_SOURCES = sorted(Path(__file__).parent.glob("*.py"))
_LETTERS: dict[str, tuple[Any, Any]] = {
    "i": (ctypes.c_int64, np.int64),
    "f": (ctypes.c_double, np.float64),
    "b": (ctypes.c_bool, np.bool_),
}
#: What numba's error paths call. Compiled text here raises nothing, so these are never reached; they abort.
_NEVER_CALLED = (
    "NRT_Free", "NRT_MemInfo_call_dtor", "numba_do_raise", "numba_gil_ensure", "numba_gil_release",
    "numba_runtime_build_excinfo_struct", "numba_unpickle",
)  # fmt: skip
_ENGINES: list[Any] = []


def cache_folder() -> Path:
    """Where compiled code is kept."""
    chosen = os.environ.get("NEARHARMONIC_CACHE_DIR")
    if chosen:
        return Path(chosen)
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "nearharmonic" / "kernels"


@cache
def core_digest() -> str:
    """Digest of the sources in this folder, of the compilers' versions and of the processor."""
    text = sha256(f"{version('numba')} {version('llvmlite')} {processor()}".encode())
    for path in _SOURCES:
        text.update(path.read_bytes())
    return text.hexdigest()


@cache
def processor() -> tuple[str, str]:
    """Name and features of the processor that code is made for; numba's own environment variables override them."""
    name = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if features is None:
        features = "" if name == "generic" else binding.get_host_cpu_features().flatten()
    return name, features


def target_machine() -> Any:
    """A fresh LLVM code generator for :func:`processor`; an engine takes it over."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = processor()
    return binding.Target.from_default_triple().create_target_machine(cpu=name, features=features, opt=3, jit=True)


def native(key: str, arguments: str, result: str, make: Callable[[], tuple[str, bytes]]) -> Callable[..., Any]:
    """The C function stored under ``key``, made by ``make() -> (name, object code)`` if there is none.

    ``arguments`` and ``result`` as for :func:`nearharmonic.core.compile.machine_code`. The function takes numpy arrays,
    which must be contiguous and of the right type, and numbers.
    """
    place = cache_folder() / f"{key}.kernel"
    if not place.is_file():
        name, code = make()
        place.parent.mkdir(parents=True, exist_ok=True)
        part = place.with_name(f"{place.name}.{os.getpid()}.part")
        part.write_bytes(f"{name}\n{sha256(code).hexdigest()}\n".encode() + code)
        part.replace(place)
    name, digest, code = _parts(place.read_bytes())
    if sha256(code).hexdigest() != digest:
        place.unlink()  # damaged on disk: it is made again
        return native(key, arguments, result, make)
    return _callable(_address(name, code), arguments, result)


def _parts(content: bytes) -> tuple[str, str, bytes]:
    name, _, rest = content.partition(b"\n")
    digest, _, code = rest.partition(b"\n")
    return name.decode(errors="replace"), digest.decode(errors="replace"), code


def _address(name: str, code: bytes) -> int:
    abort = ctypes.cast(ctypes.CDLL(None).abort, ctypes.c_void_p).value
    for symbol in _NEVER_CALLED:
        if not binding.address_of_symbol(symbol):
            binding.add_symbol(symbol, abort)
    machine = target_machine()
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), machine)
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _ENGINES.append(engine)  # code lives as long as its engine
    return int(engine.get_function_address(name))


def _callable(address: int, arguments: str, result: str) -> Callable[..., Any]:
    described = [(letter, int(digit)) for letter, digit in zip(arguments[::2], arguments[1::2], strict=True)]
    kinds: list[Any] = []
    for letter, dimensions in described:
        kinds += [ctypes.c_void_p, *[ctypes.c_int64] * dimensions] if dimensions else [_LETTERS[letter][0]]
    function = ctypes.CFUNCTYPE(_LETTERS[result][0] if result in _LETTERS else None, *kinds)(address)

    def call(*given: Any) -> Any:
        flat: list[Any] = []
        for (letter, dimensions), value in zip(described, given, strict=True):
            if not dimensions:
                flat.append(value)
                continue
            kind = _LETTERS[letter][1]
            if value.dtype != kind or value.ndim != dimensions or not value.flags.c_contiguous:
                raise TypeError(f"expected a contiguous {kind.__name__} array of {dimensions} dimensions")
            flat += [value.ctypes.data, *value.shape]
        return function(*flat)

    return call
