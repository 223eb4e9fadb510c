"""Fixed-point iteration on the forces at the stages of a step, to the rounding of the arithmetic.

Changes shrink by about the same factor from iteration to iteration, so that the next one is known before it is made. A
lane stops when that is below the rounding of the forces, or when the changes no longer shrink. What a lane computes is
independent of the other lanes.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import (
    all_zero,
    compiled,
    largest_modulus,
    linked_number,
    where_greater,
    where_zero,
    zero_like,
)

_lanes = linked_number("lanes")

#: Most iterations of a step.
MOST_ITERATIONS = 100
#: Iterations after which a change that does not shrink is rounding.
FEW = 3
#: Largest next change of the forces, relative to the largest force, that needs no iteration, in double and in
#: double-double: the rounding of a force. Energies drift no more than if every step went on until nothing changes.
NEGLIGIBLE = {False: 2.0**-53, True: 2.0**-106}
#: Largest last change with which a step counts as solved, unless the next one is known to be negligible.
SOLVED = {False: 2.0**-34, True: 2.0**-70}


def continuing(*, extended: bool) -> Any:
    """Return ``going(active, size, before, change, latest, count)``: ``active`` where one more iteration helps, else 0.

    ``size`` is the largest force, ``before``, ``change`` and ``latest`` the largest changes in the last three of
    ``count`` + 1 iterations. The larger of their two ratios tells the next one: a guess may be so good in the part that
    shrinks slowest that the last ratio alone promises too much.
    """
    negligible = NEGLIGIBLE[extended]

    @compiled
    def going(active, size, before, change, latest, count):  # type: ignore[no-untyped-def]
        nothing = zero_like(active)
        found = where_greater(latest, negligible * size, active, nothing)
        if count > 1:
            by_last = where_greater(latest * latest, negligible * size * change, found, nothing)
            found = where_greater(latest * change, negligible * size * before, found, by_last)
        if count >= FEW:
            found = where_greater(change, latest, found, nothing)
        return found

    return going


def missing(*, extended: bool) -> Any:
    """Return ``missed(size, before, change, latest, count)``: 1 where a step that ends here is not solved, else 0.

    Arguments are those of :func:`continuing`.
    """
    negligible, solved = NEGLIGIBLE[extended], SOLVED[extended]

    @compiled
    def missed(size, before, change, latest, count):  # type: ignore[no-untyped-def]
        nothing = zero_like(size)
        found = where_greater(latest, solved * size, nothing + 1.0, nothing)
        if count > 1:
            by_last = where_greater(latest * latest, negligible * size * change, found, nothing)
            found = where_greater(latest * change, negligible * size * before, found, by_last)
        return found

    return missed


def iteration(form: Form, forces_behind: Any) -> Any:
    """Return ``solve(f, step, parameters)``: the forces at the stages, the iterations, and 1 where they failed, else 0.

    ``forces_behind(f, step, parameters)`` are the forces at the positions that follow from forces ``f``.
    """
    extended = form.extended
    going, missed = continuing(extended=extended), missing(extended=extended)

    @compiled
    def largest(f):  # type: ignore[no-untyped-def]
        return largest_modulus(f[0] if extended else f)

    @compiled
    def apart(f, g):  # type: ignore[no-untyped-def]
        if extended:
            return largest_modulus((f[0] - g[0]) + (f[1] - g[1]))
        return largest_modulus(f - g)

    @compiled
    def kept(active, f, g):  # type: ignore[no-untyped-def]
        if extended:
            return where_zero(active, f[0], g[0]), where_zero(active, f[1], g[1])
        return where_zero(active, f, g)

    @compiled
    def solve(f, step, parameters):  # type: ignore[no-untyped-def]
        size = largest(f)
        nothing = zero_like(size)
        active, made, before, change, failed = nothing + 1.0, nothing, nothing, nothing, nothing
        count, several = 0, _lanes() > 1
        while True:
            found = forces_behind(f, step, parameters)
            latest = apart(found, f)
            # A single lane is active until the loop ends; to ask would be longer than the chain of an iteration.
            f = kept(active, f, found) if several else found
            made = made + active
            still = going(active, size, before, change, latest, count)
            over = missed(size, before, change, latest, count)
            failed = where_zero(active, failed, over) if several else over
            before = where_zero(active, before, change) if several else change
            change = where_zero(active, change, latest) if several else latest
            active = still
            count += 1
            if count >= MOST_ITERATIONS or all_zero(active):
                break
        return f, made, failed

    return solve
