"""Functions that numba compiles: their decorators, and potentials that are such functions.

The module is separate because numba takes longer to load than most runs take.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import nan
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import binding, ir
from numba.core import errors, registry
from numba.core import types as numba_types
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic, overload, register_jitable
from numba.np.unsafe.ndarray import to_fixed_tuple

from nearharmonic.core import arithmetic, disk
from nearharmonic.core.native import code_key, join, run_passes
from nearharmonic.core.values import DOUBLE, PREFIX, LLVMValue

# --- Decorators of functions that numba compiles: flags, and the folder of the machine code.

Function = TypeVar("Function", bound=Callable[..., Any])

#: fastmath stays off because it changes numbers. ``error_model="numpy"`` omits the tests for division by zero, which
#: slow loops down. ``nogil`` lets searches run in threads.
FLAGS = {"error_model": "numpy", "nogil": True}


def jit_compiled(function: Callable[..., Any]) -> Any:
    """Compile ``function`` with each of its callers, in whose machine code it is."""
    return numba.njit(**FLAGS)(function)


def jit(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code in the folder of compiled code.

    numba compiles a function again after an edit of its own file, but not after an edit of the file of a callee or a
    constant. The name of the folder is therefore a digest of ``core``, of the modules beside the function, and of those
    beside the compiled functions that its module imports: callees and constants come from these only.
    """
    beside = sorted(path for folder in _folders(function, {}) for path in folder.glob("*.py"))
    folder = disk.folder_of(f"numba-{code_key(sources=beside)}")
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(folder)
    try:
        return numba.njit(cache=folder is not None, **FLAGS)(function)  # type: ignore[no-any-return]
    finally:
        numba.config.CACHE_DIR = before


def _folders(function: Callable[..., Any], found: dict[Path, None]) -> dict[Path, None]:
    """Add the folders of a function and of all compiled functions that its module and theirs know to ``found``."""
    found[Path(function.__code__.co_filename).parent] = None
    for callee in function.__globals__.values():
        if isinstance(callee, Dispatcher) and Path(callee.py_func.__code__.co_filename).parent not in found:
            _folders(callee.py_func, found)
    return found


# --- Operations of doubles, for functions that numba compiles.

types: Any = numba_types


@intrinsic
def _fma(typing, x, y, z):  # type: ignore[no-untyped-def]
    return types.float64(x, y, z), lambda context, builder, signature, values: builder.fma(*values)


@overload(arithmetic.fma)
def _fma_of_doubles(x, y, z):  # type: ignore[no-untyped-def]
    return lambda x, y, z: _fma(x, y, z)  # noqa: PLW0108 (numba compares the names)


for _transform in (arithmetic.two_sum, arithmetic.two_product):
    register_jitable(_transform)


# --- Potentials that are functions of numba: their LLVM code, and calls of it in the formulas of a system.
#
# Such functions may branch, loop and read arrays. They are not traced. Their code is linked to the loops of
# :mod:`nearharmonic.core.loops` as traced formulas are.

_REAL = (types.Float, types.Integer, types.Boolean)
#: Only other compiled functions call such a function.
_COMPILED = numba.njit(no_cpython_wrapper=True, no_cfunc_wrapper=True)

#: Number of coordinates up to which a tuple is tried before an array; code for long tuples is slow to compile.
LONGEST_TUPLE = 8
#: Formulas and the names of their functions in generated code.
SYMBOLS = {"V": f"{PREFIX}given.V", "grad_V": f"{PREFIX}given.grad_V"}
_POINTER, _STATUS, _INDEX = DOUBLE.as_pointer(), ir.IntType(32), ir.IntType(32)
#: Names in LLVM text; pickled exceptions of numba, which contain line numbers of files; debug information.
_NAME = re.compile(r'@("[^"]*"|[\w.$-]+)')
_PICKLED = re.compile(r"^@\.const\.pickle\w+\..*\n", re.MULTILINE)
_DEBUG = re.compile(r"^!.*\n|,? !\w+ !\d+", re.MULTILINE)
#: Lines of numba's messages about its own state, not about the fault.
_FRAMES = ("During", "Failed in", "- Resolution", "- Of which")
#: Names that numba gives to addresses of this process, and to functions that are located at their first call.
_ADDRESS, _RECURSION = "numba.dynamic.globals", ".numba.unresolved$"


class NumbaFunctionError(ValueError):
    """A function of numba that cannot be a potential or its gradient; the message continues "V ..."."""


@dataclass(frozen=True, kw_only=True)
class NumbaCode:
    """Code of a potential and its gradient.

    ``text`` is a module of LLVM with the functions :data:`SYMBOLS`, each ``void (double *q, double *parameters, double
    *result)``. The result is NaN if numba's function raises an exception. ``digest`` is a digest of ``text`` without
    the names that differ between processes, and ``instructions`` the number of its instructions. ``takes_tuple`` is
    True if the functions take the coordinates as a tuple, False for an array.
    """

    text: str
    digest: str
    takes_tuple: bool
    instructions: int


def compiled_code(V: Any, grad_V: Any, dimension: int, parameters: int) -> NumbaCode:
    """Compile a potential and its gradient, functions of the coordinates (a tuple or an array) and of the parameters.

    A NumbaFunctionError says what numba cannot compile for doubles, which function returns a value of a wrong type, or
    whose code contains an address of this process.
    """
    takes_tuple, returned = _types(V, grad_V, dimension, parameters)
    module = binding.parse_assembly("")
    for formula, function in (("V", V), ("grad_V", grad_V)):
        count = 1 if formula == "V" else dimension
        wrapped = _wrapped(function, dimension, parameters, takes_tuple, _writer(returned[formula], count))
        name, text = _compiled(formula, wrapped)
        join(module, text, str(_entry(SYMBOLS[formula], name, count)))
    _keep_entries(module)
    _check_symbols(module)
    text, count = str(module), sum(1 for f in module.functions for block in f.blocks for _ in block.instructions)
    return NumbaCode(text=text, digest=_digest(text), takes_tuple=takes_tuple, instructions=count)


def _types(V: Any, grad_V: Any, dimension: int, parameters: int) -> tuple[bool, dict[str, Any]]:
    """Try both functions with a tuple, then with an array; return True for a tuple, and the types of the results."""
    tried = {False: types.Array(types.float64, 1, "C")}
    if dimension <= LONGEST_TUPLE:
        tried = {True: types.UniTuple(types.float64, dimension)} | tried
    refused: list[str] = []
    for takes_tuple, q in tried.items():
        given = (q, *[types.float64] * parameters)
        try:
            returned = {"V": _result("V", V, given), "grad_V": _result("grad_V", grad_V, given)}
            _check_types(returned, dimension)
        except NumbaFunctionError as error:
            refused.append(str(error))
        else:
            return takes_tuple, returned
    raise NumbaFunctionError("; ".join(refused))


def _result(formula: str, function: Any, given: tuple[Any, ...]) -> Any:
    """Return the type of the result of a function for arguments of these types."""
    try:
        context = registry.cpu_target.typing_context
        context.refresh()
        found = context.resolve_function_type(numba.typeof(function), given, {})
    except errors.NumbaError as error:
        raise NumbaFunctionError(f"{formula} is not compiled by numba for {_kind(given)}: {_essence(error)}") from error
    if found is not None:
        return found.return_type
    raise NumbaFunctionError(f"{formula} is not compiled by numba for {_kind(given)}: none of its signatures fits")


def _kind(given: tuple[Any, ...]) -> str:
    return "a tuple q" if isinstance(given[0], types.BaseTuple) else "an array q"


def _essence(error: Exception) -> str:
    """The sentence of numba's message about the fault, and the line of the user's file."""
    lines = [re.sub(r"\x1b\[\d*m", "", line).strip() for line in str(error).splitlines()]
    said = [line.removeprefix(">>> ") for line in lines if line and not line.startswith(_FRAMES)]
    told = " ".join(said[: 2 if said and said[0].endswith(":") else 1]) or type(error).__name__
    place = next((line for line in lines if line.startswith("File ")), "")
    return f"{told} ({place.rstrip(':')})" if place else told


def _check_types(returned: dict[str, Any], dimension: int) -> None:
    V, gradient = returned["V"], returned["grad_V"]
    if not isinstance(V, _REAL):
        raise NumbaFunctionError(f"V returns {V}, expected one real number")
    if isinstance(gradient, types.BaseTuple):
        fine = len(gradient) == dimension and all(isinstance(x, _REAL) for x in gradient)
    else:
        fine = isinstance(gradient, types.Array) and gradient.ndim == 1 and isinstance(gradient.dtype, _REAL)
    if not fine:
        expected = f"a tuple of {dimension} real numbers or an array of one dimension"
        raise NumbaFunctionError(f"grad_V returns {gradient}, expected {expected}")


def _wrapped(function: Any, dimension: int, parameters: int, takes_tuple: bool, write: Any) -> Any:
    """Return a function of the addresses of coordinates, parameters and results."""
    array = _COMPILED(lambda address, length: numba.carray(address, (length,)))
    if takes_tuple:
        coordinates = _COMPILED(lambda q: to_fixed_tuple(array(q, dimension), dimension))
    else:
        coordinates = _COMPILED(lambda q: array(q, dimension))
    if parameters:
        return _COMPILED(
            lambda q, given, result: write(
                result, function(coordinates(q), *to_fixed_tuple(array(given, parameters), parameters))
            )
        )
    return _COMPILED(lambda q, given, result: write(result, function(coordinates(q))))


def _writer(kind: Any, count: int) -> Any:
    """``write(address, found)``: a number, or ``count`` entries of a tuple or of an array, as doubles."""

    @intrinsic
    def write_tuple(typing, address, found):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            for i, entry in enumerate(found):
                double = context.cast(builder, builder.extract_value(values[1], i), entry, types.float64)
                builder.store(double, builder.gep(values[0], [_INDEX(i)]))
            return context.get_dummy_value()

        return types.void(address, found), codegen

    def write_array(address, found):  # type: ignore[no-untyped-def]
        if found.size != count:
            raise ValueError
        for i in range(count):
            address[i] = found[i]

    def write_number(address, found):  # type: ignore[no-untyped-def]
        address[0] = found

    if isinstance(kind, types.BaseTuple):
        return write_tuple
    return _COMPILED(write_array if isinstance(kind, types.Array) else write_number)


def _compiled(formula: str, wrapped: Any) -> tuple[str, str]:
    """Return the name and the LLVM text of a function of addresses that numba compiles."""
    pointer = types.CPointer(types.float64)
    try:
        wrapped.compile((pointer,) * 3)
    except errors.NumbaError as error:
        raise NumbaFunctionError(f"{formula} is not compiled by numba: {_essence(error)}") from error
    (made,) = wrapped.overloads.values()
    text = made.library.get_llvm_str()
    if "@numba_parallel_for" in text:
        raise NumbaFunctionError(f"{formula} is compiled with parallel=True: runs have threads of their own, drop it")
    if "@numba_unpickle" in text:
        raise NumbaFunctionError(f"{formula} calls the Python interpreter, as print and numba.objmode do: runs cannot")
    if _ADDRESS in text:
        raise NumbaFunctionError(
            f"{formula} refers to an address of this process, by an array of more than a megabyte, an array that is "
            "not contiguous, or a function of ctypes: make the array smaller or contiguous"
        )
    return made.fndesc.llvm_func_name, text


def _entry(symbol: str, name: str, count: int) -> ir.Module:
    """Return a C function that calls numba's function ``name``, and sets results to NaN if it returns an error."""
    module = ir.Module()
    byte = ir.IntType(8).as_pointer()
    inner = ir.FunctionType(_STATUS, [byte.as_pointer(), byte.as_pointer(), _POINTER, _POINTER, _POINTER])
    callee = ir.Function(module, inner, name)
    outer = ir.Function(module, ir.FunctionType(ir.VoidType(), [_POINTER] * 3), symbol)
    builder = ir.IRBuilder(outer.append_basic_block())
    status = builder.call(callee, [builder.alloca(byte), builder.alloca(byte), *outer.args])
    with builder.if_then(builder.icmp_signed("!=", status, _STATUS(0)), likely=False):
        for i in range(count):
            builder.store(DOUBLE(nan), builder.gep(outer.args[2], [_INDEX(i)]))
    builder.ret_void()
    return module


def _keep_entries(module: Any) -> None:
    """Remove all code that the two entries do not need, and hide the rest from other modules."""
    for thing in (*module.functions, *module.global_variables):
        if not thing.is_declaration and thing.name not in SYMBOLS.values():
            thing.linkage = "internal"
    run_passes(module, "global_dead_code_eliminate")
    module.verify()


def _check_symbols(module: Any) -> None:
    """Raise an error for symbols without an address, as a call of them in a kernel would crash the process."""
    for thing in (*module.functions, *module.global_variables):
        if not thing.is_declaration or thing.name.startswith("llvm."):
            continue
        if thing.name.startswith(_RECURSION):
            raise NumbaFunctionError("V or grad_V calls a function that calls itself: write it as a loop")
        if binding.address_of_symbol(thing.name) is None:
            raise NumbaFunctionError(f"V or grad_V calls {thing.name}, which has no address outside of numba")


def _digest(text: str) -> str:
    """Digest of code in which generated names, which contain counters of a process, are replaced by their order."""
    text = _DEBUG.sub("", _PICKLED.sub("", text))
    outside = set(re.findall(r"^declare .*?" + _NAME.pattern, text, re.MULTILINE))
    places: dict[str, str] = {}

    def place(found: re.Match[str]) -> str:
        name = found[1]
        return found[0] if name in outside else places.setdefault(name, f"@{len(places)}")

    return sha256(_NAME.sub(place, text).encode()).hexdigest()


def called(formula: str, count: int, q: Sequence[LLVMValue], parameters: Sequence[LLVMValue]) -> list[LLVMValue]:
    """Return the ``count`` results of a call of one of :data:`SYMBOLS` in the function that is being built."""
    builder = q[0].builder
    kind = ir.FunctionType(ir.VoidType(), [_POINTER] * 3)
    function = builder.module.globals.get(SYMBOLS[formula]) or ir.Function(builder.module, kind, SYMBOLS[formula])
    arrays = [_array(builder, max(1, n)) for n in (len(q), len(parameters), count)]
    for array, values in zip(arrays, (q, parameters), strict=False):
        for i, x in enumerate(values):
            builder.store(x.value, builder.gep(array, [_INDEX(i)]))
    builder.call(function, arrays)
    return [LLVMValue(builder, builder.load(builder.gep(arrays[2], [_INDEX(i)]))) for i in range(count)]


def _array(builder: ir.IRBuilder, count: int) -> ir.Value:
    """Allocate doubles on the stack once in a function, outside its loops."""
    with builder.goto_entry_block():
        return builder.alloca(DOUBLE, _INDEX(count))
