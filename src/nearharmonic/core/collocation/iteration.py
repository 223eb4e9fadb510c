"""Fixed-point iteration on the forces at the stages of a step, to the rounding of the arithmetic.

Changes shrink by about the same factor from iteration to iteration, so that the next one is known before it is made. A
lane stops when that is below the rounding of the forces, or when the changes no longer shrink. A change that is far
above the rounding of doubles may grow for once and shrink again in a long step: only if none of several is a new least
one, it is the rounding of forces that cancel. What a lane computes is independent of the other lanes.
"""

from __future__ import annotations

from math import inf
from typing import Any

from nearharmonic.core.loops.shape import Form
from nearharmonic.core.machine.reals import (
    all_zero,
    compiled,
    larger,
    largest_modulus,
    linked_number,
    where_greater,
    where_zero,
    zero_like,
)

_lanes = linked_number("lanes")

#: Most iterations of a step.
MOST_ITERATIONS = 200
#: Iterations after which a small change that does not shrink is rounding; iterations in a row without a new least
#: change after which any is.
FEW, IN_VAIN = 3, 10.0
#: Growth of a change, from the least one, after which it does not shrink again.
HOPELESS = 2.0**30
#: Largest next change of the forces, relative to the largest force, that needs no iteration, in double and in
#: double-double: the rounding of a force. Energies drift no more than if every step went on until nothing changes.
NEGLIGIBLE = {False: 2.0**-53, True: 2.0**-106}
#: Largest change that is small in this sense, and with which a step counts as solved while its changes shrink.
SMALL = {False: 2.0**-46, True: 2.0**-99}
#: Largest last change with which a step counts as solved that ends because changes no longer shrink.
SOLVED = {False: 2.0**-34, True: 2.0**-70}


def continuing(*, extended: bool) -> Any:
    """Return ``going(active, size, before, change, latest, count, vain)``: ``active`` where one more helps, or 0.

    ``size`` is the largest force, ``before``, ``change`` and ``latest`` the largest changes in the last three of
    ``count`` + 1 iterations, ``vain`` the number of the last ones without a new least change. The larger of the two
    ratios tells the next change: a guess may be so good in the part that shrinks slowest that the last ratio alone
    promises too much.
    """
    negligible, small = NEGLIGIBLE[extended], SMALL[extended]

    @compiled
    def going(active, size, before, change, latest, count, vain):  # type: ignore[no-untyped-def]
        nothing = zero_like(active)
        found = where_greater(latest, negligible * size, active, nothing)
        if count > 1:
            by_last = where_greater(latest * latest, negligible * size * change, found, nothing)
            found = where_greater(latest * change, negligible * size * before, found, by_last)
        if count >= FEW:
            shrinking = where_greater(change, latest, found, nothing)
            found = where_greater(latest, small * size, found, shrinking)
        return where_greater(nothing + IN_VAIN, vain, found, nothing)

    return going


def missing(*, extended: bool) -> Any:
    """Return ``missed(active, size, before, change, latest, count)``: 1 where a step that ends so is not solved, or 0.

    ``active`` is the result of :func:`continuing`, whose arguments the others are; ``size`` is here the larger of the
    first two forces, as the guess of a step that starts at an equilibrium is 0.
    """
    negligible, small, solved = NEGLIGIBLE[extended], SMALL[extended], SOLVED[extended]

    @compiled
    def missed(active, size, before, change, latest, count):  # type: ignore[no-untyped-def]
        nothing = zero_like(size)
        allowed = where_zero(active, solved * size, small * size)
        found = where_greater(latest, allowed, nothing + 1.0, nothing)
        if count > 1:
            by_last = where_greater(latest * latest, negligible * size * change, found, nothing)
            found = where_greater(latest * change, negligible * size * before, found, by_last)
        return found

    return missed


@compiled
def counted(least, vain, latest):  # type: ignore[no-untyped-def]
    """The least change, and the number of changes since it, with the latest one; far above it, no more are needed."""
    nothing = zero_like(vain)
    worse = where_greater(latest, HOPELESS * least, nothing + IN_VAIN, vain + 1.0)
    return where_greater(least, latest, latest, least), where_greater(least, latest, nothing, worse)


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
        least, vain, scale = nothing + inf, nothing, size
        count, several = 0, _lanes() > 1
        while True:
            found = forces_behind(f, step, parameters)
            latest = apart(found, f)
            if count == 0:
                scale = larger(size, largest(found))
            # A single lane is active until the loop ends; to ask would be longer than the chain of an iteration.
            f = kept(active, f, found) if several else found
            made = made + active
            least, vain = counted(least, vain, latest)
            still = going(active, size, before, change, latest, count, vain)
            over = missed(still, scale, before, change, latest, count)
            failed = where_zero(active, failed, over) if several else over
            before = where_zero(active, before, change) if several else change
            change = where_zero(active, change, latest) if several else latest
            active = still
            count += 1
            if count >= MOST_ITERATIONS or all_zero(active):
                break
        return f, made, failed

    return solve
