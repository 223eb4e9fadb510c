"""On-disk cache of compiled object code, which is called without the compiler.

A kernel takes longer to compile than many runs take. The key of a file covers the sources of ``core``, the
version of the compiler, the processor, and the parts that the caller names, so that a file is never stale.
"""

from __future__ import annotations

import ctypes
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import llvmlite
import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from nearharmonic.core import disk
from nearharmonic.core.layout import Argument, Scalar, Signature
from nearharmonic.errors import CompiledCodeError

_SOURCES = sorted(Path(__file__).parent.rglob("*.py"))
_KINDS: dict[Scalar, tuple[Any, np.dtype[Any]]] = {
    "int64": (ctypes.c_int64, np.dtype(np.int64)),
    "float64": (ctypes.c_double, np.dtype(np.float64)),
    "bool": (ctypes.c_bool, np.dtype(np.bool_)),
}
_PERMANENT: set[NativeFunction] = set()


def native(key: str, signature: Signature, make: Callable[[], tuple[str, bytes]]) -> NativeFunction:
    """Load the C function kept under a key; make and keep it if it is absent or cannot be loaded.

    The key, the name of its file without suffix, must cover everything that the machine code depends on. ``make``
    returns the name of the symbol and an object file. New code that cannot be loaded raises a CompiledCodeError.
    """
    place = disk.place_of(key)
    found = _found(place, signature)
    if found is None:
        with disk.claimed(place):
            # Of many processes that start together, one compiles and the others wait.
            found = _found(place, signature)
            if found is None:
                with _announced():
                    name, code = make()
                found = loaded(name, code, signature)
                if place:
                    disk.write(place, name, code)
    return found


def _found(place: Path | None, signature: Signature) -> NativeFunction | None:
    """Load the function in the file ``place``; None if it is absent or cannot be loaded, and then it is deleted."""
    content = disk.read(place) if place else None
    if not place or not content:
        return None
    try:
        return loaded(*content, signature)
    except CompiledCodeError:
        disk.discard(place)
        return None


@contextmanager
def _announced() -> Iterator[None]:
    """Print a message to a terminal if the block takes more than two seconds."""

    def say() -> None:
        print("nearharmonic: compiling a kernel, which is kept for later runs", file=sys.stderr, flush=True)

    timer = threading.Timer(2.0, say)
    timer.daemon = True
    if sys.stderr.isatty():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()


def loaded(name: str, code: bytes, signature: Signature) -> NativeFunction:
    """Load the function of this symbol from object code, without writing it to disk."""
    try:
        engine = binding.create_mcjit_compiler(binding.parse_assembly(""), target_machine())
        file = binding.ObjectFileRef.from_data(code)
        if not file:  # LLVM crashes on such a file
            raise CompiledCodeError(f"no object file of {len(code)} bytes")
        engine.add_object_file(file)
        engine.finalize_object()
        address = int(engine.get_function_address(name))
    except RuntimeError as error:
        raise CompiledCodeError(f"LLVM cannot load {name!r}: {error}") from error
    if not address:
        raise CompiledCodeError(f"no symbol {name!r} in the object file")
    return NativeFunction(address, signature, engine)


def code_key(*parts: str, sources: Iterable[Path] = ()) -> str:
    """Digest of :func:`core_digest`, of ``parts``, and of the contents of the files ``sources``."""
    digest = sha256(" ".join([core_digest(), *parts]).encode())
    for path in sources:
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def core_digest() -> str:
    """Digest of the sources of ``core``, of the version of the compiler and of the processor."""
    text = sha256(f"{llvmlite.__version__} {processor()}".encode())
    for path in _SOURCES:
        text.update(path.read_bytes())
    return text.hexdigest()


@cache
def processor() -> tuple[str, str]:
    """Name and features of the target processor; numba's own environment variables override them."""
    name = os.environ.get("NUMBA_CPU_NAME") or binding.get_host_cpu_name()
    features = os.environ.get("NUMBA_CPU_FEATURES")
    if features is None:
        features = "" if name == "generic" else binding.get_host_cpu_features().flatten()
    return name, features


def target_machine() -> Any:
    """A new LLVM code generator for :func:`processor`; an engine becomes its owner."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = processor()
    return binding.Target.from_default_triple().create_target_machine(cpu=name, features=features, opt=3, jit=True)


def run_passes(module: Any, *names: str) -> None:
    passes = binding.create_new_module_pass_manager()
    for name in names:
        getattr(passes, f"add_{name}_pass")()
    passes.run(module, binding.create_pass_builder(target_machine(), binding.create_pipeline_tuning_options()))


def join(module: Any, *texts: str) -> Any:
    """Link texts of LLVM to a module, which takes the target of the first if it has none, and return the module."""
    for text in texts:
        other = binding.parse_assembly(text)
        if not module.triple:
            module.triple, module.data_layout = other.triple, other.data_layout
        other.triple, other.data_layout = module.triple, module.data_layout
        module.link_in(other)
    return module


def object_code(module: Any) -> bytes:
    """Optimise a module and return its object code for this processor."""
    machine = target_machine()
    code: bytes = machine.emit_object(optimised(module, machine))
    return code


def optimised(module: Any, machine: Any) -> Any:
    """Optimise a module for a target machine, and return it.

    Arithmetic is not re-ordered, and loops are not vectorised: the code has explicit vectors.
    """
    module.triple, module.data_layout = machine.triple, str(machine.target_data)
    module.verify()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module


class NativeFunction:
    """A C function at an address, with the arguments of its signature.

    Its machine code is freed together with ``engine``, when neither this object nor a prepared call exists any longer.
    """

    def __init__(self, address: int, signature: Signature, engine: Any = None) -> None:
        self.place, self._engine, self._packed = address, engine, signature.packed
        self._arguments = [(argument, _KINDS[argument.scalar][1]) for argument in signature.arguments]
        kinds: list[Any] = []
        for argument in signature.arguments:
            number = _KINDS[argument.scalar][0]
            kinds += [ctypes.c_void_p, *[ctypes.c_int64] * argument.dimensions] if argument.dimensions else [number]
        result = _KINDS[signature.result][0] if signature.result else None
        kinds = [ctypes.c_void_p] if signature.packed else kinds
        self._function = ctypes.CFUNCTYPE(result, *kinds)(address)

    @property
    def address(self) -> int:
        """The address, for code that has no reference to this object: the machine code is then never freed."""
        _PERMANENT.add(self)
        return self.place

    def __call__(self, *given: Any) -> Any:
        """Call the function; an array of another type or number of dimensions, or not contiguous, is a TypeError."""
        if self._packed:
            return self.prepared(*given)()
        return self._function(*_converted(zip(self._arguments, given, strict=True)))

    def prepared(self, *given: Any) -> PreparedCall:
        """Return a repeatable call of a packed function with these arguments, checked as in a call."""
        return PreparedCall(self._function, _converted(zip(self._arguments, given, strict=True)), (self, *given))


class PreparedCall:
    """A call of a packed function with converted arguments; the conversion takes 10 microseconds."""

    def __init__(self, function: Any, slots: list[Any], given: tuple[Any, ...]) -> None:
        numbers = {i: slot for i, slot in enumerate(slots) if type(slot) is float}
        block = np.array([0 if i in numbers else slot for i, slot in enumerate(slots)], np.int64)
        doubles = block.view(np.float64)
        for i, number in numbers.items():
            doubles[i] = number
        self._function, self._place = function, block.ctypes.data
        self._alive = block, given  # the block holds the addresses of these arrays and functions

    def __call__(self) -> Any:
        """Call the function."""
        return self._function(self._place)


def _converted(pairs: Iterable[tuple[tuple[Argument, Any], Any]]) -> list[Any]:
    """Arguments in C form, with kinds and values: a number, or the address and the lengths of an array."""
    flat: list[Any] = []
    for (argument, kind), value in pairs:
        if not argument.dimensions:
            number = value.place if isinstance(value, NativeFunction) else value
            flat.append(float(number) if argument.scalar == "float64" else number)
            continue
        if value.dtype != kind or value.ndim != argument.dimensions or not value.flags.c_contiguous:
            message = f"expected a contiguous {kind} array of {argument.dimensions} dimensions"
            raise TypeError(f"{argument.name}: {message}")
        flat += [_place(value), *value.shape]
    return flat


def _place(array: NDArray[Any]) -> int:
    """Address of the first number; ``array.ctypes`` takes four times as long, and a short run passes twenty arrays."""
    if array.flags.writeable and array.size:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]
    return int(array.ctypes.data)
