"""Numba types of the core: a real is a number, or one per lane; a point is one real per coordinate.

Stages are points of the stages of an implicit method, side by side.

Code that numba compiles does not depend on the number of coordinates, the number of lanes, or the system. An operation
on reals and points is a call of a function (:mod:`nearharmonic.core.machine.values`), and so is a formula of a
system. These functions are linked to the compiled loops, and inlined, for a system and a number of lanes.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import binding, ir
from numba.core import cgutils
from numba.core import types as numba_types
from numba.core.dispatcher import Dispatcher
from numba.extending import intrinsic, lower_builtin, models, overload, register_jitable, register_model, type_callable

from nearharmonic.core import arithmetic
from nearharmonic.core.layout import Signature
from nearharmonic.core.machine import disk
from nearharmonic.core.machine.native import code_key
from nearharmonic.core.machine.values import PLACEHOLDERS, PREFIX, TRUTH, argument_types, result_type

# --- Decorators of functions that numba compiles: flags, and the folder of the machine code.
#
# The module is separate because numba takes longer to load than most runs take.

Function = TypeVar("Function", bound=Callable[..., Any])

#: fastmath stays off because it changes numbers. ``error_model="numpy"`` omits the tests for division by zero, which
#: slow loops down. ``nogil`` lets searches run in threads.
FLAGS = {"error_model": "numpy", "nogil": True}
#: Only other compiled functions call such a function.
UNWRAPPED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


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


types: Any = numba_types
#: Numba types of the numbers of a :class:`nearharmonic.core.layout.Signature`.
SCALARS = {"int64": types.int64, "float64": types.float64, "bool": types.boolean}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function of the core, which allocates no memory and raises no exceptions, for calls by others."""
    return numba.njit(**FLAGS, **UNWRAPPED, boundscheck=False, _nrt=False)(function)


class Numbers(numba_types.Type):
    """A real, a point, or the parameters of a system."""

    def __init__(self, letter: str) -> None:
        self.letter = letter
        super().__init__(name=f"Numbers({letter})")


REAL, POINT, PARAMETERS, STAGES = (Numbers(letter) for letter in "RPCS")
LETTERS = {REAL: "R", POINT: "P", PARAMETERS: "C", STAGES: "S", types.float64: "D", types.int64: "I"}


@register_model(Numbers)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Numbers) -> None:
        super().__init__(manager, kind, ir.IntType(8).as_pointer(PLACEHOLDERS[kind.letter]))


def _call(context: Any, builder: Any, name: str, result: Any, values: Any) -> Any:
    symbol, nothing = PREFIX + name, result == types.void
    binding.add_symbol(symbol, 1)  # numba generates machine code for it immediately; nothing calls that code
    returned = ir.VoidType() if nothing else context.get_value_type(result)
    kind = ir.FunctionType(returned, [value.type for value in values])
    found = builder.call(cgutils.get_or_insert_function(builder.module, kind, symbol), values)
    return context.get_dummy_value() if nothing else found


def _operation(name: str) -> Any:
    """Return a generator of code that calls an operation."""

    def codegen(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        letters = "".join(LETTERS.get(kind, "A") for kind in signature.args)
        return _call(context, builder, f"{name}.{letters}", signature.return_type, values)

    return codegen


def _common(*kinds: Any) -> Any:
    """The type of the result of an operation: stages if an operand is, or a point; None if no operand is a real."""
    if not all(kind in (REAL, POINT, STAGES, types.float64) for kind in kinds):
        return None
    return next((kind for kind in (STAGES, POINT, REAL) if kind in kinds), None)


def _common_of_two(a: Any, b: Any) -> Any:
    return _common(a, b)


def _common_of_one(x: Any) -> Any:
    return _common(x)


for _name, _operator in (("add", operator.add), ("sub", operator.sub), ("mul", operator.mul)):

    @type_callable(_operator)
    def _typed(context):  # type: ignore[no-untyped-def]
        return _common_of_two

    for _left, _right in ((Numbers, Numbers), (Numbers, types.Float), (types.Float, Numbers)):
        lower_builtin(_operator, _left, _right)(_operation(_name))


@type_callable(operator.neg)
def _typed_negative(context):  # type: ignore[no-untyped-def]
    return _common_of_one


lower_builtin(operator.neg, Numbers)(_operation("neg"))


@intrinsic
def _fma(typing, x, y, z):  # type: ignore[no-untyped-def]
    kind = _common(x, y, z)
    if kind is None:
        return types.float64(x, y, z), lambda context, builder, signature, values: builder.fma(*values)
    return kind(x, y, z), _operation("fma")


@overload(arithmetic.fma)
def _fma_of_reals(x, y, z):  # type: ignore[no-untyped-def]
    return lambda x, y, z: _fma(x, y, z)  # noqa: PLW0108 (numba compares the names)


for _transform in (
    arithmetic.quick_two_sum, arithmetic.two_sum, arithmetic.two_product, arithmetic.dd_add, arithmetic.dd_mul,
    arithmetic.dd_add_double,
):  # fmt: skip
    register_jitable(_transform)


@intrinsic
def absolute(typing, x):  # type: ignore[no-untyped-def]
    return x(x), _operation("absolute")


@intrinsic
def larger(typing, x, y):  # type: ignore[no-untyped-def]
    """x where x > y, else y: a NaN in x is dropped."""
    return _common(x, y)(x, y), _operation("larger")


@intrinsic
def where_greater(typing, x, y, yes, no):  # type: ignore[no-untyped-def]
    """``yes`` in the lanes where x > y, else ``no``."""
    return _common(yes, no)(x, y, yes, no), _operation("where_greater")


@intrinsic
def where_zero(typing, x, yes, no):  # type: ignore[no-untyped-def]
    """``yes`` in the lanes where x = 0, else ``no``."""
    return _common(yes, no)(x, yes, no), _operation("where_zero")


@intrinsic
def all_within(typing, x, bound):  # type: ignore[no-untyped-def]
    """True if x <= bound in every lane; False for a NaN."""
    return types.boolean(x, bound), _operation("all_within")


@intrinsic
def all_greater(typing, x, bound):  # type: ignore[no-untyped-def]
    return types.boolean(x, bound), _operation("all_greater")


@intrinsic
def all_zero(typing, x):  # type: ignore[no-untyped-def]
    return types.boolean(x), _operation("all_zero")


@intrinsic
def largest_modulus(typing, point):  # type: ignore[no-untyped-def]
    """The largest |x| of the coordinates, in each lane."""
    return REAL(point), _operation("largest_modulus")


@intrinsic
def zero_like(typing, value):  # type: ignore[no-untyped-def]
    """0, or a tuple of zeros, of the type of ``value``."""
    codegen = lambda context, builder, signature, values: context.get_constant_null(signature.return_type)  # noqa: E731
    return value(value), codegen


def _loader(kind: Numbers) -> Any:
    @intrinsic
    def load(typing, array, row):  # type: ignore[no-untyped-def]
        return kind(array, types.int64), _operation(f"load{kind.letter}")

    return load


#: ``load_...(array, row)`` returns the numbers in the rows from ``row`` on.
load_real, load_point, load_parameters, load_stages = map(_loader, (REAL, POINT, PARAMETERS, STAGES))


@intrinsic
def store(typing, array, row, value):  # type: ignore[no-untyped-def]
    """Store a value in the rows from ``row`` on."""
    return types.void(array, types.int64, value), _operation("store")


@intrinsic
def store_rest(typing, array, row, value):  # type: ignore[no-untyped-def]
    """Store only the coordinates of a value behind the last full block."""
    return types.void(array, types.int64, value), _operation("store_rest")


def _star(given: Any) -> Any:
    """Types of the arguments of a variadic intrinsic function."""
    return given[0] if len(given) == 1 and isinstance(given[0], tuple) else given


def linked(name: str, result: Any) -> Any:
    """Return a function with this result that is linked later: a formula, or a function of the shape of a system."""

    @intrinsic
    def call(typing, *given):  # type: ignore[no-untyped-def]
        arguments = _star(given)

        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            passed = [builder.extract_value(values[0], i) for i in range(len(signature.args[0]))]
            return _call(context, builder, name, result, passed)

        return result(types.StarArgTuple(arguments)), codegen

    return call


def linked_number(name: str) -> Any:
    """Return a function without arguments that is linked later and returns an integer."""

    @intrinsic
    def call(typing):  # type: ignore[no-untyped-def]
        return types.int64(), lambda context, builder, signature, values: _call(context, builder, name, types.int64, [])

    return call


def at_address(signature: Signature) -> Any:
    """Return ``call(address, ...)``, which calls a C function; the lengths of an array follow the array."""
    kinds = argument_types(signature)
    pointer = ir.FunctionType(result_type(signature), kinds).as_pointer()

    @intrinsic
    def call(typing, *given):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signed, values):  # type: ignore[no-untyped-def]
            address, *passed = (builder.extract_value(values[0], i) for i in range(1 + len(kinds)))
            passed = [builder.zext(x, kind) if x.type == TRUTH else x for x, kind in zip(passed, kinds, strict=True)]
            found = builder.call(builder.inttoptr(address, pointer), passed)
            return found if signature.result else context.get_dummy_value()

        result = SCALARS[signature.result] if signature.result else types.void
        return result(types.StarArgTuple(_star(given))), codegen

    return call
