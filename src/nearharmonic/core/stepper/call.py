"""Functions of numba that advance arrays by one step, for use inside other functions of numba.

They call the machine code of kernels by its address. They use the stack or memory of their own, so that threads may
call them concurrently. The module is separate because it imports numba, which takes longer to load than most runs take.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import update_wrapper
from inspect import signature
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, errors
from numba.core import types as numba_types
from numba.extending import intrinsic, overload, typeof_impl

from nearharmonic.core.layout import COLUMNS, TALLY, Floats, Signature, running_at, running_rows
from nearharmonic.core.machine.reals import at_address
from nearharmonic.core.stepper.recent_moves import empty_slots, recall
from nearharmonic.errors import bad_setting

types: Any = numba_types
#: What a step takes beside the step size.
ARRAY = "writable, C-contiguous array of float64 with one dimension"
#: Arrays whose addresses are constants in machine code.
_KEPT: list[Floats] = []


@dataclass(frozen=True, kw_only=True)
class Step:
    """A step of one method on one system.

    Attributes
    ----------
    name : str
        Name of the system, for errors.
    address : int
        Address of machine code for :data:`~nearharmonic.core.layout.STEP` or :data:`~nearharmonic.core.layout.ADVANCE`.
    signature : Signature
        STEP or ADVANCE.
    dimension : int
        Number of coordinates d.
    room : int
        Number of doubles behind the rows of ADVANCE.
    stages : int
        Stages of a collocation method, whose forces are in these rows; 0 for a splitting method.
    compensated : bool
        True if sums are compensated: arrays then have carries.
    kick_first : bool
        True if a step begins with a kick.
    table, flags, power
        Coefficients of the moves: see :func:`nearharmonic.core.stepper.products.fill`.
    parameters : (2 P,) array of float
        Parameters as pairs.
    """

    name: str
    address: int
    signature: Signature
    dimension: int
    room: int
    stages: int
    compensated: bool
    kick_first: bool
    table: Floats
    flags: Floats
    power: int
    parameters: Floats


class Stepper:
    """A step as a program calls it; numba takes the compiled function in its place.

    Raises
    ------
    SettingError
        An argument of another type.
    """

    def __init__(self, compiled: Any) -> None:
        self.compiled = compiled
        update_wrapper(self, compiled.py_func)

    def __call__(self, *given: Any, **named: Any) -> None:
        """Advance arrays by one step, in place."""
        try:
            self.compiled(*given, **named)
        except errors.TypingError:
            arguments = signature(self.compiled.py_func).bind(*given, **named).arguments
            for name, value in arguments.items():
                real = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
                if name == "tau" and not real:
                    raise bad_setting(name, value, "a real number, behind the arrays") from None
                if name != "tau" and (what := _other_type(value)) is not None:
                    raise bad_setting(name, what, f"a {ARRAY}") from None
            raise


@typeof_impl.register(Stepper)  # type: ignore[untyped-decorator]
def _type_of(step: Stepper, context: Any) -> Any:
    return types.Dispatcher(step.compiled)


def _other_type(value: Any) -> Any:
    """Description of an argument that is no array that a step takes; None for such an array."""
    if type(value) is not np.ndarray:
        return value
    flags = value.flags
    wrong = "read-only " * (not flags.writeable) + "strided " * (not flags.c_contiguous)
    if wrong or value.dtype != np.float64 or value.ndim != 1:
        return f"{wrong}array of {value.dtype}, of shape {value.shape}"
    return None


def stepper(steps: Step) -> Any:
    """Return ``step(q, p, tau)``, or ``step(q, p, carry_q, carry_p, tau)`` if sums are compensated, compiled by numba.

    numba counts references to arrays by atomic operations, which take longer than a step of leapfrog. The function is
    compiled without these counters and passes addresses. It is compiled here, not for a caller, whose options such as
    ``fastmath`` would then apply to it.
    """
    advance, d = _with_moves(steps), steps.dimension
    message = f"step of {steps.name}: expected arrays of {d} number{'s' if d > 1 else ''}"

    def step(q, p, tau):  # type: ignore[no-untyped-def]
        """Advance positions and momenta by one step of size tau, in place."""
        check(tau, q, p)
        if q.size != d or p.size != d:
            raise ValueError(message)
        advance(_data(q), _data(q), _data(p), _data(p), float(tau))

    def compensated_step(q, p, carry_q, carry_p, tau):  # type: ignore[no-untyped-def]
        """Advance positions, momenta and their carries by one step of size tau, in place."""
        check(tau, q, p, carry_q, carry_p)
        if q.size != d or p.size != d or carry_q.size != d or carry_p.size != d:
            raise ValueError(message)
        advance(_data(q), _data(carry_q), _data(p), _data(carry_p), float(tau))

    made, arrays = (compensated_step, 4) if steps.compensated else (step, 2)
    compiled = numba.njit(nogil=True, _nrt=False)(made)
    compiled.compile((*[types.Array(types.float64, 1, "C")] * arrays, types.float64))
    return Stepper(compiled)


@intrinsic
def _data(typing, array):  # type: ignore[no-untyped-def]
    """Address of the first number of an array."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return context.make_array(array)(context, builder, values[0]).data

    return types.CPointer(types.float64)(array), codegen


def _with_moves(step: Step) -> Any:
    """Return ``advance(q, carry_q, p, carry_p, tau)``, which takes addresses."""
    advanced = _in_memory(step) if step.signature.result else _at_once(step)
    table, flags, power = step.table, step.flags, step.power
    count = COLUMNS * len(flags)
    room, slots = _stack(count), address_of(empty_slots(count))

    @numba.njit((*[types.CPointer(types.float64)] * 4, types.float64))
    def advance(q, carry_q, p, carry_p, tau):  # type: ignore[no-untyped-def]
        moves = room()
        recall(slots(), table, flags, power, tau, numba.carray(moves, (count,)))
        advanced(moves, q, carry_q, p, carry_p)

    return advance


def check(tau: Any, *arrays: Any) -> None:
    """Raise TypingError for wrong types of arguments when the caller is compiled."""


@overload(check)
def _check(tau, *arrays):  # type: ignore[no-untyped-def]
    for array in arrays:
        fits = isinstance(array, types.Array) and array.dtype == types.float64 and array.ndim == 1
        if not (fits and array.layout == "C" and array.mutable):
            raise errors.TypingError(f"a step takes a {ARRAY} in each place but the last; this is {array}")
    if not isinstance(tau, types.Integer | types.Float):
        raise errors.TypingError(f"a step takes arrays and a real number tau behind them; this is {tau}")
    return lambda tau, *arrays: None


def _at_once(step: Step) -> Any:
    """Return ``advanced(moves, q, carry_q, p, carry_p)``, which calls a function of one step."""
    call, code, d = at_address(step.signature), _fixed(step.address, types.int64), step.dimension
    stages, count, kick_first = len(step.flags) - 2, COLUMNS * len(step.flags), step.kick_first
    parameters = step.parameters if step.parameters.size else np.zeros(2)

    @numba.njit
    def advanced(moves, q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
        given = _data(parameters)
        call(code(), stages, kick_first, moves, count, given, parameters.size, q, d, carry_q, d, p, d, carry_p, d)

    return advanced


def _in_memory(step: Step) -> Any:
    """Return ``advanced(moves, q, carry_q, p, carry_p)``, which calls a kernel whose state is in rows."""
    call, code, d = at_address(step.signature), _fixed(step.address, types.int64), step.dimension
    stages, coefficients, kick_first = len(step.flags) - 2, COLUMNS * len(step.flags), step.kick_first
    parameters, compensated = step.parameters, step.compensated
    count, behind = parameters.size, 4 * d + TALLY
    running = running_at(d, count // 2)
    size = running + running_rows(d, step.stages) + step.room

    @numba.njit
    def advanced(moves, q, carry_q, p, carry_p):  # type: ignore[no-untyped-def]
        rows = np.zeros(size)
        rows[behind : behind + count] = parameters
        for i in range(d):
            rows[running + i], rows[running + 2 * d + i] = q[i], p[i]
            if compensated:
                rows[running + d + i], rows[running + 3 * d + i] = carry_q[i], carry_p[i]
        call(code(), 1, stages, kick_first, moves, coefficients, _data(rows), size)
        for i in range(d):
            q[i], p[i] = rows[i], rows[2 * d + i]
            if compensated:
                carry_q[i], carry_p[i] = rows[d + i], rows[3 * d + i]

    return advanced


def _stack(count: int) -> Any:
    """Return a function that returns the address of ``count`` doubles on the stack of its caller."""

    @intrinsic
    def room(typing):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            block = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count))
            return builder.bitcast(block, ir.DoubleType().as_pointer())

        return types.CPointer(types.float64)(), codegen

    return room


def address_of(array: Floats) -> Any:
    """Return a function that returns the address of an array, and keep the array until the process ends."""
    _KEPT.append(array)
    return _fixed(array.ctypes.data, types.CPointer(types.float64))


def _fixed(address: int, kind: Any) -> Any:
    """Return a function that returns an address of this process; numba then does not cache its callers on disk."""

    @intrinsic
    def place(typing):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
            found = context.add_dynamic_addr(builder, address, info="nearharmonic.stepper")
            wanted = context.get_value_type(kind)
            return builder.ptrtoint(found, wanted) if kind == types.int64 else builder.bitcast(found, wanted)

        return kind(), codegen

    return place
