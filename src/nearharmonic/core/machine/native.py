"""On-disk cache of compiled object code, which is called without the compiler.

numba takes longer to load than the integrations of a figure take. The key of a file covers the sources of ``core``, the
versions of the compilers, the processor, and the parts that the caller names, so that a file is never stale.

Kernels: loops that numba compiled for a form, linked with the formulas of a system and optimised together.

The loops of a form are cached as LLVM text, so that a new system of a known form does not need numba.
"""

from __future__ import annotations

import ctypes
import inspect
import os
import re
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from llvmlite import binding, ir
from numpy.typing import NDArray

from nearharmonic.core.layout import Argument, Scalar, Signature
from nearharmonic.core.machine import disk
from nearharmonic.core.machine.values import INDEX, PLACEHOLDERS, PREFIX, Kinds, argument_types, define, result_type
from nearharmonic.errors import CompiledCodeError

_SOURCES = sorted(Path(__file__).parents[1].rglob("*.py"))
_KINDS: dict[Scalar, tuple[Any, np.dtype[Any]]] = {
    "int64": (ctypes.c_int64, np.dtype(np.int64)),
    "float64": (ctypes.c_double, np.dtype(np.float64)),
    "bool": (ctypes.c_bool, np.dtype(np.bool_)),
}
_PERMANENT: set[NativeFunction] = set()


Found = TypeVar("Found")


def native(key: str, signature: Signature, make: Callable[[], tuple[str, bytes]]) -> NativeFunction:
    """Load the C function kept under a key; make and keep it if it is absent or cannot be loaded.

    The key, the name of its file without suffix, must cover everything that the machine code depends on. ``make``
    returns the name of the symbol and an object file. New code that cannot be loaded raises a CompiledCodeError.
    """

    def announced() -> tuple[str, bytes]:
        with _announced():
            return make()

    return kept(key, announced, lambda name, code: loaded(name, code, signature))


def kept(key: str, make: Callable[[], tuple[str, bytes]], load: Callable[[str, bytes], Found]) -> Found:
    """Return what is loaded from the name and the code kept under a key, which are made and kept if need be."""
    place = disk.place_of(key)
    found = _found(place, load)
    if found is None:
        with disk.claimed(place):
            # Of many processes that start together, one compiles and the others wait.
            found = _found(place, load)
            if found is None:
                name, code = make()
                found = load(name, code)
                if place:
                    disk.write(place, name, code)
    return found


def _found(place: Path | None, load: Callable[[str, bytes], Found]) -> Found | None:
    """Load from the file ``place``; None if it is absent or cannot be loaded, and then it is deleted."""
    content = disk.read(place) if place else None
    if not place or not content:
        return None
    try:
        return load(*content)
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


def source_key(*parts: str) -> str:
    """Digest of ``parts`` and of the dependencies of LLVM text, which is the same for every processor."""
    return sha256(" ".join([_source_digest(), *parts]).encode()).hexdigest()


@cache
def core_digest() -> str:
    """Digest of the sources of ``core``, of the versions of the compilers and of the processor."""
    return sha256(f"{_source_digest()} {processor()}".encode()).hexdigest()


@cache
def _source_digest() -> str:
    text = sha256(f"{version('numba')} {version('llvmlite')}".encode())
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
    """Optimise a module and return its object code.

    Arithmetic is not re-ordered, and loops are not vectorised: the code has explicit vectors.
    """
    module.verify()
    machine = target_machine()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = options.loop_vectorization = False
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    code: bytes = machine.emit_object(module)
    return code


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
        """Return a repeatable call of a packed function with these arguments, checked as those of a call."""
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
            flat.append(_number(argument, value))
            continue
        if value.dtype != kind or value.ndim != argument.dimensions or not value.flags.c_contiguous:
            message = f"expected a contiguous {kind} array of {argument.dimensions} dimensions"
            raise TypeError(f"{argument.name}: {message}")
        flat += [_place(value), *value.shape]
    return flat


def _number(argument: Argument, value: Any) -> Any:
    if isinstance(value, NativeFunction):
        return value.place
    return float(value) if argument.scalar == "float64" else value


def _place(array: NDArray[Any]) -> int:
    """Address of the first number; ``array.ctypes`` takes four times as long, and a short run passes twenty arrays."""
    if array.flags.writeable and array.size:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]
    return int(array.ctypes.data)


#: Letters of the placeholder types in the LLVM text of loops.
_LETTERS = {f"ptr addrspace({space})": letter for letter, space in PLACEHOLDERS.items()}
#: A placeholder type with or without null, a phi instruction of one, and declarations of operations and of formulas.
_TYPE = re.compile(rf"({'|'.join(map(re.escape, _LETTERS))})( null)?")
_CHOICE = re.compile(rf"= phi ({'|'.join(map(re.escape, _LETTERS))}) .*")
_OPERATION = re.compile(rf"^declare (.+) @({re.escape(PREFIX)}\w+\.\w+)\(", re.MULTILINE)
_FORMULA = re.compile(rf"^declare .* @{re.escape(PREFIX)}(\w+)\(", re.MULTILINE)
_MADE: dict[str, tuple[str, bytes]] = {}


def link_kept(name: str, choice: str, make: Callable[[], tuple[str, bytes]]) -> tuple[str, bytes]:
    """Return the loops of a name and of options from the cache, or call ``make`` and put its result there.

    If nothing can be kept on disk, each process makes them once.
    """
    key = f"loops-{source_key(name, choice)}"

    def once() -> tuple[str, bytes]:
        found = _MADE[key] = _MADE.get(key) or make()
        return found

    return kept(key, once, lambda *found: found)


def loops(function: Callable[..., Any], signature: Signature) -> tuple[str, bytes]:
    """Return the name and the LLVM text of a function compiled by numba.

    The function takes those arguments of the signature that it names: numbers, addresses of arrays, and lengths of
    arrays. The code is not optimised, because the size of a number is not known yet.
    """
    from numba.core import config, registry
    from numba.core.compiler_lock import global_compiler_lock

    from nearharmonic.core.machine.reals import SCALARS, compiled, types

    kinds, taken = [], [*inspect.signature(function).parameters]
    by_name = {argument.name: argument for argument in signature.arguments}
    for name in taken:
        argument = by_name.get(name)
        scalar = SCALARS[argument.scalar] if argument else types.int64
        kinds.append(types.CPointer(scalar) if argument and argument.dimensions else scalar)
    # At its first use, numba fixes the optimisation level of all other code of the process.
    registry.cpu_target.target_context.refresh()
    with global_compiler_lock:
        config.reload_config()  # or the compiler reloads it after a change of the environment
        if config.DISABLE_JIT:
            raise CompiledCodeError("NUMBA_DISABLE_JIT is set, so that kernels cannot be compiled: unset it")
        level, config.OPT = config.OPT, config._OptLevel(0)
        try:
            jitted = compiled(function)
            jitted.compile(tuple(kinds))
        finally:
            config.OPT = level
    (made,) = jitted.overloads.values()
    entry = _entry(made.fndesc.llvm_func_name, function.__name__, signature, taken)
    module = join(binding.parse_assembly(made.library.get_llvm_str()), str(entry))
    _make_one(module, function.__name__)
    run_passes(module, "sroa", "simplify_cfg", "aggressive_dce", "simplify_cfg")  # once, not each time loops are linked
    return function.__name__, str(module).encode()


def _make_one(module: Any, name: str) -> None:
    """Inline the functions that ``name`` calls, except those that are only declared or marked noinline."""
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
            if not any(b"noinline" in attribute for attribute in function.attributes):
                function.add_function_attribute("alwaysinline")
    run_passes(module, "always_inliner", "global_dead_code_eliminate")


def needed(loops: bytes) -> frozenset[str]:
    """Names of the functions that loops call and do not define, without operations."""
    return frozenset(_FORMULA.findall(loops.decode()))


def linked(name: str, loops: bytes, written: ir.Module, kinds: Kinds, given: str = "") -> tuple[str, bytes]:
    """Name and object code of loops linked with the module ``written`` of a system, for a number of lanes.

    ``given`` is the LLVM text of functions that the formulas call; LLVM may inline them.
    """
    zero = "zeroinitializer"
    text = _CHOICE.sub(lambda found: found[0].replace("[ null,", f"[ {zero},"), loops.decode())
    text = _TYPE.sub(lambda found: f"{kinds.of(_LETTERS[found[1]])} {zero if found[2] else ''}", text)
    for result, symbol in _OPERATION.findall(loops.decode()):
        define(written, symbol, kinds, _LETTERS.get(result) or {"i1": "B", "void": "V"}[result])
    module = join(binding.parse_assembly(text), str(written))
    _make_one(module, name)
    if given:
        names = [function.name for function in binding.parse_assembly(given).functions if not function.is_declaration]
        join(module, given)
        for own in names:
            module.get_function(own).linkage = "internal"
    return name, object_code(module)


def alone(name: str, loops: bytes) -> tuple[str, bytes]:
    """Name and object code of loops that call no other function."""
    return linked(name, loops, ir.Module(), Kinds(1, 1, 1))


def _entry(name: str, entry: str, signature: Signature, taken: Sequence[str]) -> ir.Module:
    """A module with a C function that calls numba's function, which returns a status, and its result by an address."""
    module = ir.Module()
    names = [name for argument in signature.arguments for name in (argument.name, *argument.lengths)]
    kinds, result = argument_types(signature), result_type(signature)
    outer = ir.Function(module, ir.FunctionType(result, [INDEX.as_pointer()] if signature.packed else kinds), entry)
    builder = ir.IRBuilder(outer.append_basic_block())
    given = dict(zip(names, outer.args, strict=False))
    if signature.packed:
        given = {n: _slot(builder, outer.args[0], i, k) for i, (n, k) in enumerate(zip(names, kinds, strict=True))}
    address = ir.IntType(8).as_pointer()
    returned = builder.alloca(result if signature.result else address)
    arguments = [returned, builder.alloca(address), *(given[name] for name in taken)]
    callee = ir.Function(module, ir.FunctionType(ir.IntType(32), [value.type for value in arguments]), name)
    builder.call(callee, arguments)
    if signature.result:
        builder.ret(builder.load(returned))
    else:
        builder.ret_void()
    return module


def _slot(builder: ir.IRBuilder, block: ir.Value, number: int, kind: ir.Type) -> ir.Value:
    """An argument in a block of arguments of 8 bytes each."""
    return builder.load(builder.bitcast(builder.gep(block, [INDEX(number)]), kind.as_pointer()))
