"""Cache of the moves of recent step sizes, shared by threads without locks.

The multiplication of coefficients by tau takes longer than a step of leapfrog, and most steps have the same tau as the
previous step. Each of SLOTS slots holds the moves of one tau and a counter. A thread adds 1 to the counter before it
writes and 1 after. A reader copies the moves, and uses them if the counter was even and has not changed: a sequence
lock (Boehm 2012, doi:10.1145/2247684.2247688). Otherwise the reader computes the moves.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import types as numba_types
from numba.extending import intrinsic

from nearharmonic.core.layout import Floats, aligned_zeros
from nearharmonic.core.machine.jit import jit
from nearharmonic.core.stepper.products import fill

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
    """Fill in the moves of a step, from a slot if it holds them: see :func:`nearharmonic.core.stepper.products.fill`.

    Parameters
    ----------
    slots : pointer to doubles
        Slots of :func:`empty_slots`, used for this table only.
    table, flags, n, tau, moves
        As for :func:`nearharmonic.core.stepper.products.fill`.
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
