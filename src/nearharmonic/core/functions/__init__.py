"""Elementary functions for kernels: sin, cos, tan, exp, log, cbrt, pow, atan2, tanh, sinh, cosh, erf and hypot.

Functions of arrays are the code of kernels in a loop over lanes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numpy.typing import NDArray

from nearharmonic.core.layout import Signature, floats
from nearharmonic.core.native import code_key, native, object_code
from nearharmonic.core.number import FUNCTIONS
from nearharmonic.core.values import DOUBLE, INDEX, LLVMValue

#: (arguments, results): one row of doubles for each part of an argument or result.
ELEMENTWISE = Signature((floats("arguments", "rows", "count"), floats("results", "results_rows", "count")))
#: Prefix of the names of compiled functions: it separates them from names of the C library.
PREFIX = "nearharmonic_"
#: Lanes in which arrays are evaluated.
LANES = 8
Body = Callable[..., Sequence[LLVMValue]]


def elementwise(body: Body, rows: int, width: int, symbol: str = "elementwise") -> tuple[str, bytes]:
    """Name and object code of a C function of the signature :data:`ELEMENTWISE`.

    ``body`` of ``rows`` values is emitted for ``width`` lanes, and for single numbers: the remainder of an array.
    """
    from nearharmonic.core.values import Index, LoopWriter

    module, pointer = ir.Module(), DOUBLE.as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [pointer, INDEX, INDEX] * 2), symbol)
    source, _, length, target, _, _ = function.args
    writer = LoopWriter(ir.IRBuilder(function.append_basic_block()))
    count = Index(writer.builder, length)
    whole = count & -width
    stretches: list[tuple[int | Index, Index, int]] = [(0, whole, width), (whole, count, 1)]
    for begin, end, lanes in stretches if width > 1 else stretches[:1]:
        with writer.repeated(end, begin, lanes) as i:
            values = [writer.load(writer.place(source, count * row + i), lanes) for row in range(rows)]
            for row, result in enumerate(body(*values)):
                writer.store(result, writer.place(target, count * row + i))
    writer.builder.ret_void()
    return symbol, object_code(binding.parse_assembly(str(module)))


def of_numbers(name: str) -> Callable[..., float]:
    """The function ``name`` of floats, from the cache of compiled code or compiled into it."""
    count = len(FUNCTIONS[name])
    signature, symbol = Signature(tuple(floats(f"x{i}") for i in range(count)), "float64"), f"{PREFIX}{name}"

    def make() -> tuple[str, bytes]:
        from nearharmonic.core.functions import double

        module = ir.Module()
        function = ir.Function(module, ir.FunctionType(DOUBLE, [DOUBLE] * count), symbol)
        builder = ir.IRBuilder(function.append_basic_block())
        result = double.FUNCTIONS[name](*(LLVMValue(builder, x) for x in function.args))
        builder.ret(result.value)
        return symbol, object_code(binding.parse_assembly(str(module)))

    address = native(f"number-{name}-{code_key()}", signature, make).address
    # called without a signature, whose conversion of arguments takes ten times as long as a sine
    return ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * count)(address)


@cache
def _of_arrays(name: str) -> Callable[..., None]:
    def make() -> tuple[str, bytes]:
        from nearharmonic.core.functions import double  # slower to load than the cached machine code

        return elementwise(lambda *x: [double.FUNCTIONS[name](*x)], len(FUNCTIONS[name]), LANES, f"{PREFIX}{name}s")

    return native(f"array-{name}-{code_key()}", ELEMENTWISE, make)


def of_arrays(name: str, *arrays: Any) -> NDArray[np.float64]:
    """Return the function ``name`` of arrays, broadcast against each other, in double precision."""
    given = np.array(np.broadcast_arrays(*arrays), dtype=np.float64)
    rows = np.ascontiguousarray(given.reshape(len(given), -1))
    result = np.empty((1, rows.shape[1]))
    if result.size:
        _of_arrays(name)(rows, result)
    return result.reshape(given.shape[1:])
