"""Steps inside compiled functions of users: moves of a step size, their cache, and calls by address."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import update_wrapper
from inspect import signature
from math import frexp, ldexp
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, errors
from numba.core import types as numba_types
from numba.extending import intrinsic, overload, typeof_impl

from nearharmonic.core.arithmetic import fma, two_product, two_sum
from nearharmonic.core.layout import (
    COLUMNS,
    DRIFT,
    KICK,
    PRODUCT,
    REST,
    SQUARE,
    TALLY,
    Floats,
    Signature,
    aligned_zeros,
    running_at,
    running_rows,
)
from nearharmonic.core.numba_code import jit
from nearharmonic.core.values import TRUTH, argument_types, result_type
from nearharmonic.errors import CompiledCodeError, bad_setting

# --- Products of exact coefficients and powers of a run-time step size, each rounded once.
#
# A coefficient is a rational number, stored as a sum of doubles of decreasing size. Its product with a power of tau is
# computed in double-double. If the error of this product leaves two candidates for the nearest double, an exact sum of
# all doubles decides. This is not rare: 7 tau / 24 is half-way between two doubles for many tau, and for a coefficient
# with 76 decimals in place of 7/24 the product is very near to half-way.

#: Smallest number of bits that a double of a sum adds.
BITS = 53
#: Largest number of doubles of a coefficient, for decimals of 100 digits and their products: the next double would
#: underflow.
MOST_DOUBLES = 18
#: Bound of the relative error of a product in double-double: four roundings of at most 2^-104, and omitted terms below
#: 2^-104.
UNCERTAIN = 2.0**-101
#: Number of columns of a table: kick, drift, and their product or the coefficient of the square.
KINDS = 3


def table_of(rows: Sequence[Sequence[Fraction]], powers: Sequence[int]) -> Floats:
    """Return coefficients of moves, KINDS each, as sums of doubles (doubles, KINDS, rows): enough for all roundings.

    With the power n of tau of a column, k tau^n and a number half-way between two doubles are equal, or their relative
    difference exceeds 2^-b, where b is the larger of 54 + log2(denominator of k) and 53 n + log2(numerator of k).
    """
    bits = max(
        max(BITS + 1 + k.denominator.bit_length(), BITS * n + abs(k.numerator).bit_length())
        for row in rows
        for k, n in zip(row, powers, strict=True)
    )
    count = min(MOST_DOUBLES, bits // BITS + 3)
    table = np.zeros((count, KINDS, len(rows)))
    for i, row in enumerate(rows):
        for kind, k in enumerate(row):
            rest = k
            for part in range(count):
                table[part, kind, i] = float(rest)
                rest -= Fraction(float(rest))
    return table


@jit
def _power(tau: float, n: int) -> tuple[float, float]:
    """Return tau^n as a pair, for n = 1, 2 or 3."""
    if n == 1:
        return tau, 0.0
    high, low = two_product(tau, tau)
    if n == 2:
        return high, low
    product, error = two_product(high, tau)
    return product, fma(low, tau, error)


@jit
def _neighbours(c: float, c_low: float, high: float, low: float) -> tuple[float, float]:
    """Return the double nearest to a product of pairs twice, or the two candidates if the error leaves two."""
    product, error = two_product(c, high)
    rest = fma(c, low, fma(c_low, high, error))
    bound = abs(product) * UNCERTAIN
    return product + (rest - bound), product + (rest + bound)


@jit
def _added(terms: Floats, count: int, x: float) -> int:
    """Add a number to a sum of doubles that do not overlap, exactly (Shewchuk 1997, doi:10.1007/PL00009321)."""
    for i in range(count):
        x, terms[i] = two_sum(x, terms[i])
    terms[count] = x
    return count + 1


@jit
def _nearest(table: Floats, kind: int, row: int, tau: float, n: int, below: float, above: float) -> float:
    """Return the one of two neighbouring doubles that is nearest to k tau^n; the even one in a tie."""
    mantissa, exponent = frexp(tau)
    lower, upper = ldexp(below, -n * exponent), ldexp(above, -n * exponent)
    half = (upper - lower) / 2
    powers, factors = np.zeros(4), 1
    powers[0] = mantissa
    if n > 1:
        powers[0], powers[1] = two_product(mantissa, mantissa)
        factors = 2
    if n > 2:
        high, low = powers[0], powers[1]
        powers[0], powers[1] = two_product(high, mantissa)
        powers[2], powers[3] = two_product(low, mantissa)
        factors = 4
    terms = np.zeros(2 + 2 * len(table) * factors)
    count = _added(terms, _added(terms, 0, -lower), -half)
    for part in range(len(table)):
        for factor in range(factors):
            product, error = two_product(table[part, kind, row], powers[factor])
            count = _added(terms, _added(terms, count, error), product)
    excess = 0.0
    for i in range(count):
        excess += terms[i]
    if abs(excess) <= abs(upper) * 2.0 ** (-BITS * (len(table) - 1)):
        return ldexp(lower + half, n * exponent)
    return above if excess > 0.0 else below


@jit
def _settle(table: Floats, n: int, tau: float, moves: Floats) -> None:
    """Fill in the moves again, by :func:`_nearest` where the error of double-double leaves two candidates."""
    rows = table.shape[2]
    for i in range(rows):
        for kind in range(KINDS):
            power = n if kind == SQUARE else 1
            below, above = _neighbours(table[0, kind, i], table[1, kind, i], *_power(tau, power))
            if below != above and np.isfinite(above - below):
                above = _nearest(table, kind, i, tau, power, below, above)
            moves[COLUMNS * i + kind] = above


@jit
def fill(table: Floats, flags: Floats, n: int, tau: float, moves: Floats) -> None:
    """Fill in the ``moves`` of a step of size tau: COLUMNS doubles for each row of a table of :func:`table_of`.

    The third column has tau^n: n = 2 for the product of kick and drift, which REST follows, 3 for the coefficient of
    the square. ``flags`` (rows,) are then the last column, for kicks of a modified potential.
    """
    high, low = _power(tau, n)
    rows, doubtful = table.shape[2], False
    for i in range(rows):
        below, kick = _neighbours(table[0, KICK, i], table[1, KICK, i], tau, 0.0)
        doubtful |= below != kick
        below, drift = _neighbours(table[0, DRIFT, i], table[1, DRIFT, i], tau, 0.0)
        doubtful |= below != drift
        below, third = _neighbours(table[0, SQUARE, i], table[1, SQUARE, i], high, low)
        doubtful |= below != third
        moves[COLUMNS * i + KICK], moves[COLUMNS * i + DRIFT], moves[COLUMNS * i + PRODUCT] = kick, drift, third
    if doubtful:
        _settle(table, n, tau, moves)
    for i in range(rows):
        at = COLUMNS * i
        if n == 2:
            product, error = two_product(moves[at + KICK], moves[at + DRIFT])
            moves[at + REST] = (product - moves[at + PRODUCT]) + error
        else:
            moves[at + REST] = flags[i]


@jit
def fill_all(table: Floats, flags: Floats, n: int, taus: Floats, moves: Floats) -> None:
    """Fill in the moves (steps, rows COLUMNS) of steps of several sizes (steps,), as :func:`fill` does."""
    for i in range(len(taus)):
        fill(table, flags, n, taus[i], moves[i])


# --- Cache of the moves of recent step sizes, shared by threads without locks.
#
# The multiplication of coefficients by tau takes longer than a step of leapfrog, and most steps have the same tau as
# the previous step. Each of SLOTS slots holds the moves of one tau and a counter. A thread adds 1 to the counter
# before it writes and 1 after. A reader copies the moves, and uses them if the counter was even and has not changed:
# a sequence lock (Boehm 2012, doi:10.1145/2247684.2247688). Otherwise the reader computes the moves.

#: Number of slots, a power of two: threads with different step sizes seldom share a slot.
SLOTS_BITS = 6
SLOTS = 1 << SLOTS_BITS
#: Number of doubles before the moves: the counter, and tau.
HEAD = 2
#: Multiplier of the hash: 2^64 divided by the golden ratio (Knuth, TAOCP 3, 6.4).
GOLDEN = 0x9E3779B97F4A7C15

types: Any = numba_types
_WORD = ir.IntType(64)


def empty_slots(count: int) -> Floats:
    """Return empty slots for ``count`` doubles of moves each."""
    return aligned_zeros(SLOTS * (HEAD + count))


@intrinsic
def _bits(typing, x):  # type: ignore[no-untyped-def]
    return types.uint64(types.float64), lambda context, builder, signature, values: builder.bitcast(values[0], _WORD)


def _place(builder: Any, values: Any) -> Any:
    """Address of the counter of a slot."""
    return builder.bitcast(builder.gep(values[0], [values[1]]), _WORD.as_pointer())


@intrinsic
def _before_reading(typing, slots, at):  # type: ignore[no-untyped-def]
    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        return builder.load_atomic(_place(builder, values), "acquire", 8)

    return types.int64(slots, types.int64), codegen


@intrinsic
def _behind_reading(typing, slots, at):  # type: ignore[no-untyped-def]
    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        builder.fence("acquire")
        return builder.load_atomic(_place(builder, values), "monotonic", 8)

    return types.int64(slots, types.int64), codegen


@intrinsic
def _may_write(typing, slots, at, counter):  # type: ignore[no-untyped-def]
    """Add 1 to the counter unless another thread has changed it; return True if it was added."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        odd = builder.add(values[2], _WORD(1))
        found = builder.cmpxchg(_place(builder, values), values[2], odd, "acquire", "monotonic")
        builder.fence("release")
        return builder.extract_value(found, 1)

    return types.boolean(slots, types.int64, types.int64), codegen


@intrinsic
def _written(typing, slots, at, counter):  # type: ignore[no-untyped-def]
    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        builder.store_atomic(values[2], _place(builder, values), "release", 8)
        return context.get_dummy_value()

    return types.void(slots, types.int64, types.int64), codegen


@jit
def recall(slots: Floats, table: Floats, flags: Floats, n: int, tau: float, moves: Floats) -> None:
    """Fill in the moves of a step as :func:`nearharmonic.core.stepper.fill`, from a slot if it holds them.

    ``slots`` is the address of :func:`empty_slots`, used for this table only.
    """
    key, count = _bits(tau), len(moves)
    at = np.int64((key * np.uint64(GOLDEN)) >> np.uint64(64 - SLOTS_BITS)) * (HEAD + count)
    slot = numba.carray(slots, (SLOTS * (HEAD + count),))
    counter = _before_reading(slots, at)
    idle = counter % 2 == 0
    if idle and counter > 0 and _bits(slot[at + 1]) == key:
        for i in range(count):
            moves[i] = slot[at + HEAD + i]
        if _behind_reading(slots, at) == counter:
            return
    fill(table, flags, n, tau, moves)
    if idle and _may_write(slots, at, counter):
        slot[at + 1] = tau
        for i in range(count):
            slot[at + HEAD + i] = moves[i]
        _written(slots, at, counter + 2)


# --- Functions of numba that advance arrays by one step, for use inside other functions of numba.
#
# They call the machine code of kernels by its address. They use the stack or memory of their own, so that threads may
# call them concurrently.

#: What a step takes beside the step size.
ARRAY = "writable, C-contiguous array of float64 with one dimension"
#: Arrays whose addresses are constants in machine code.
_KEPT: list[Floats] = []


@dataclass(frozen=True, kw_only=True)
class Step:
    """A step of one method on one system."""

    name: str  # of the system, for errors
    address: int  # of machine code
    signature: Signature  # of that code: STEP or ADVANCE of :mod:`nearharmonic.core.layout`
    dimension: int  # number of coordinates d
    room: int  # doubles behind the rows of ADVANCE
    stages: int  # of a collocation method, whose forces are in these rows; 0 for a splitting method
    compensated: bool  # arrays then have carries
    kick_first: bool
    #: Coefficients of the moves: see :func:`nearharmonic.core.stepper.fill`.
    table: Floats
    flags: Floats
    power: int
    parameters: Floats  # as pairs


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
    if numba.config.DISABLE_JIT:
        raise CompiledCodeError("NUMBA_DISABLE_JIT is set, so that numba compiles no step: unset it")
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


def at_address(signature: Signature) -> Any:
    """Return ``call(address, ...)``, which calls a C function without a result that is used."""
    kinds = argument_types(signature)
    pointer = ir.FunctionType(result_type(signature), kinds).as_pointer()

    @intrinsic
    def call(typing, *given):  # type: ignore[no-untyped-def]
        def codegen(context, builder, signed, values):  # type: ignore[no-untyped-def]
            address, *passed = (builder.extract_value(values[0], i) for i in range(1 + len(kinds)))
            passed = [builder.zext(x, kind) if x.type == TRUTH else x for x, kind in zip(passed, kinds, strict=True)]
            builder.call(builder.inttoptr(address, pointer), passed)
            return context.get_dummy_value()

        arguments = given[0] if len(given) == 1 and isinstance(given[0], tuple) else given  # as numba calls it
        return types.void(types.StarArgTuple(arguments)), codegen

    return call


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
