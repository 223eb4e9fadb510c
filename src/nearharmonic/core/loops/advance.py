"""The loops of the inner kernel: steps of one trajectory, or of one in each lane, and the energy after each step.

:func:`advance` and :func:`begin` return the functions of :data:`nearharmonic.core.layout.ADVANCE` and ``BEGIN`` for a
:class:`~nearharmonic.core.layout.Form`. States are :mod:`~nearharmonic.core.points` or in memory
(:mod:`nearharmonic.core.large.state`). Rows of arrays are described in :mod:`nearharmonic.core.loops.kernel`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nearharmonic.core import points
from nearharmonic.core.arithmetic import two_sum
from nearharmonic.core.collocation import in_memory as collocation_in_memory
from nearharmonic.core.collocation import motion as collocation
from nearharmonic.core.large import state as in_memory
from nearharmonic.core.layout import (
    CONDITION,
    ENERGY,
    ENERGY_LOW,
    INNER,
    LATEST,
    LIMIT,
    MERGED,
    NEAR,
    TOTAL,
    TOTAL_CARRY,
    WORST,
    Form,
    Measured,
)
from nearharmonic.core.machine.reals import (
    absolute,
    all_greater,
    all_within,
    compiled,
    larger,
    linked_number,
    load_parameters,
    load_real,
    store,
    where_greater,
    zero_like,
)

#: Rows: of coefficients of a move; the first of the tally, and of the parameters.
_columns, _tally, _parameters = (linked_number(name) for name in ("columns", "tally", "parameters"))
#: 1 if the energy is measured, else 0; 1 if it is measured after every step, 0 if after the last one.
_measuring, _at_every_step = linked_number("measuring"), linked_number("at_every_step")


@compiled
def _load_tally(rows, at):  # type: ignore[no-untyped-def]
    """The errors up to now, H0 as a pair, the rounding error of H in double, and the limit."""
    errors = load_real(rows, at + WORST), load_real(rows, at + TOTAL), load_real(rows, at + TOTAL_CARRY)
    H0 = load_real(rows, at + ENERGY), load_real(rows, at + ENERGY_LOW)
    rounding = load_real(rows, at + NEAR), load_real(rows, at + CONDITION)
    return (*errors, load_real(rows, at + LATEST)), H0, rounding, load_real(rows, at + LIMIT)


@compiled
def _store_errors(rows, at, worst, total, carry, latest):  # type: ignore[no-untyped-def]
    store(rows, at + WORST, worst)
    store(rows, at + TOTAL, total)
    store(rows, at + TOTAL_CARRY, carry)
    store(rows, at + LATEST, latest)


@compiled
def _tallied(worst, total, carry, latest):  # type: ignore[no-untyped-def]
    """The maximum and the sum of the energy errors, updated by the latest one."""
    size = absolute(latest)
    carried = carry + size
    new = total + carried
    return larger(size, worst), new, carried + (total - new)


def _measure(form: Form, given: Measured) -> Any:
    """``measure(seen, height, kick_first, H0, rounding, parameters)``: H - H0, in double if that is accurate enough.

    ``height`` is V at the position of the last force: the final position if the step ends with a kick.
    """
    energy, potential, kinetic = given.energy, given.potential, given.kinetic

    @compiled
    def difference(high, low, H0):  # type: ignore[no-untyped-def]
        return (high - H0[0]) + (low - H0[1])

    @compiled
    def exact(seen, height, kick_first, H0, rounding, parameters):  # type: ignore[no-untyped-def]
        high, low = energy(seen, parameters)
        return difference(high, low, H0)

    @compiled
    def quick(seen, height, kick_first, H0, rounding, parameters):  # type: ignore[no-untyped-def]
        V = height if kick_first else potential(seen, parameters)
        T = kinetic(seen, parameters)
        high, low = two_sum(T, V)
        latest = difference(high, low, H0)
        bound = rounding[0] + rounding[1] * (absolute(T) + absolute(V))
        if not all_greater(absolute(latest), bound):
            latest = where_greater(absolute(latest), bound, latest, exact(seen, V, True, H0, rounding, parameters))
        return latest

    return quick if form.quick else exact


def advance(form: Form) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.ADVANCE`, to be compiled."""
    room = in_memory if form.large else points
    motion = room.motion
    if form.stages:
        motion = (collocation_in_memory if form.large else collocation).motion
    load, first, move, behind, last, closed, save = motion(form)
    row_of, measure = points.row_loader(form), _measure(form, room.measured())
    quick = form.quick

    def advance(count, stages, kick_first, moves, rows):  # type: ignore[no-untyped-def]
        tally, columns, parameters = _tally(), _columns(), load_parameters(rows, _parameters())
        state, seen = load(rows, moves, parameters)
        (worst, total, carry, latest), H0, rounding, limit = _load_tally(rows, tally)
        f, height = first(state, moves, parameters), zero_like(limit)
        done, opening = 0, 0
        while True:
            row = opening
            for i in range(stages - 1 if quick else stages):
                state = move(state, row_of(moves, row), f, parameters)
                f = behind(state, moves, row, parameters)
                row = row + columns if i > 0 else INNER * columns
            if quick:
                state = move(state, row_of(moves, row), f, parameters)
                f, height = last(state, moves, row, parameters)
            done += 1
            if done >= count or _at_every_step() != 0:
                seen = closed(state, row_of(moves, (stages + 1) * columns), f, parameters)
                if _measuring() != 0:
                    latest = measure(seen, height, kick_first, H0, rounding, parameters)
                    worst, total, carry = _tallied(worst, total, carry, latest)
                    if not all_within(absolute(latest), limit):
                        break
            if done >= count:
                break
            opening = MERGED * columns
        save(rows, state, seen)
        _store_errors(rows, tally, worst, total, carry, latest)
        for column in range(columns):
            store(moves, column, load_real(moves, MERGED * columns + column))
        return done

    return advance


def begin(*, large: bool, quick: bool) -> Callable[..., Any]:
    """Return the function of :data:`nearharmonic.core.layout.BEGIN`, to be compiled."""
    given = (in_memory if large else points).measured()
    energies, rounding, load_state = given.energies, given.rounding, points.load_state

    def begin(rows):  # type: ignore[no-untyped-def]
        tally, parameters = _tally(), load_parameters(rows, _parameters())
        seen = rows if large else load_state(rows, 0)
        H, H_low, T, zero = energies(seen, parameters)
        near, condition = rounding(seen, parameters) if quick else (zero, zero)
        for entry in range(LIMIT):
            store(rows, tally + entry, zero)
        store(rows, tally + ENERGY, H)
        store(rows, tally + ENERGY_LOW, H_low)
        store(rows, tally + LIMIT, absolute(T))
        store(rows, tally + NEAR, near)
        store(rows, tally + CONDITION, condition)

    return begin
