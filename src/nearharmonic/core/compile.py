"""Compilation by numba: the flags that all compiled text shares, and C functions made of it and called by it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from nearharmonic.core.layout import Argument, Group, Scalar, Signature
from nearharmonic.core.native import target_machine

_TYPES: dict[Scalar, Any] = {"int64": types.int64, "float64": types.float64, "bool": types.boolean}


def strict(py_func: Callable[..., Any]) -> Callable[..., Any]:
    """``py_func`` jitted with the flags of every kernel, compiled at its first use.

    ``error_model="numpy"`` because the check for division by zero blocks SIMD; no fastmath, which deletes the carry of
    compensated summation; no runtime of numba's own, which counts references to arrays: the text allocates nothing, so
    machine code needs nothing of numba.
    """
    return numba.njit(error_model="numpy", fastmath=False, nogil=True, _nrt=False)(py_func)  # type: ignore[no-any-return]


def machine_code(function: Callable[..., Any], signature: Signature) -> tuple[str, bytes]:
    """Name and object code of a C function that calls the jitted ``function``.

    The C function takes each array as its address and its lengths, and the members of groups in a row.
    """
    kinds, parameters, values = _flat(signature)
    text = f"def entry({', '.join(parameters)}):\n    return function({_passed(signature.arguments, values)})\n"
    scope: dict[str, Any] = {"function": function, "array_at": array_at}
    exec(text, scope)  # numba reads arities from text
    result = _TYPES[signature.result] if signature.result else types.void
    entry = numba.cfunc(result(*kinds), error_model="numpy", fastmath=False, _nrt=False)(scope["entry"])
    module = binding.parse_assembly(entry.inspect_llvm())
    return entry.native_name, target_machine().emit_object(module)


def _flat(signature: Signature) -> tuple[list[Any], list[str], dict[str, str]]:
    """Types and names of the arguments of a C function, and the text of each argument as ``function`` takes it."""
    kinds: list[Any] = []
    names: list[str] = []
    values = {}
    for argument in signature.flat:
        scalar, lengths = _TYPES[argument.scalar], [f"{argument.name}_{i}" for i in range(argument.dimensions)]
        kinds += [types.CPointer(scalar) if lengths else scalar, *[types.int64] * len(lengths)]
        names += [argument.name, *lengths]
        values[argument.name] = f"array_at({argument.name}, ({', '.join(lengths)},))" if lengths else argument.name
    return kinds, names, values


def _array(context: Any, builder: ir.IRBuilder, kind: Any, data: ir.Value, lengths: ir.Value) -> ir.Value:
    """The C-contiguous array of type ``kind`` whose first number is at ``data``."""
    array = context.make_array(kind)(context, builder)
    itemsize = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    shape = cgutils.unpack_tuple(builder, lengths)
    strides = [itemsize]
    for length in shape[:0:-1]:
        strides.insert(0, builder.mul(length, strides[0]))
    populate_array(array, data, shape, strides, itemsize, meminfo=None)
    return array._getvalue()


@intrinsic
def array_at(typingctx, address, lengths):  # type: ignore[no-untyped-def]
    """The C-contiguous array of these ``lengths``, a tuple, at ``address``."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        return _array(context, builder, signature.return_type, args[0], args[1])

    return types.Array(address.dtype, len(lengths), "C")(address, lengths), codegen


def _passed(arguments: tuple[Argument | Group, ...], values: dict[str, str]) -> str:
    """Text of the arguments as ``function`` takes them, with groups as tuples."""
    parts = (f"({_passed(a.members, values)},)" if isinstance(a, Group) else values[a.name] for a in arguments)
    return ", ".join(parts)
