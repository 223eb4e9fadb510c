"""States that are points: the moves of a step, and the energies, for a form.

Functions of a system and of its lanes are linked by name: see :mod:`nearharmonic.core.formulas.emission`.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core import step
from nearharmonic.core import step as rotation
from nearharmonic.core.layout import DRIFT, KICK, PRODUCT, REST, SQUARE, Form, Measured, Motion
from nearharmonic.core.machine.reals import (
    POINT,
    REAL,
    all_zero,
    compiled,
    largest_modulus,
    linked,
    linked_number,
    load_point,
    load_real,
    store,
    types,
    where_zero,
    zero_like,
)

#: Indices of rows: of coordinates, of the coefficients of a move, and of the running state.
_dimension, _columns, _running = (linked_number(name) for name in ("dimension", "columns", "running"))
#: ``_moved(new, old)``: coordinates that can move are taken from ``new``, the others from ``old``.
#: ``_timed(time, others)``: a coordinate that is the time is taken from ``time``.
_moved, _timed = linked("moved", POINT), linked("timed", POINT)


def _rates(form: Form) -> Any:
    return types.UniTuple(POINT, 2) if form.extended else POINT


@compiled
def load_state(rows, at):  # type: ignore[no-untyped-def]
    d = _dimension()
    return load_point(rows, at), load_point(rows, at + d), load_point(rows, at + 2 * d), load_point(rows, at + 3 * d)


@compiled
def store_state(rows, at, q, q_low, p, p_low):  # type: ignore[no-untyped-def]
    d = _dimension()
    store(rows, at, q)
    store(rows, at + d, q_low)
    store(rows, at + 2 * d, p)
    store(rows, at + 3 * d, p_low)


@compiled
def _pair(moves, at):  # type: ignore[no-untyped-def]
    return load_real(moves, at), load_real(moves, at + 1)


def row_loader(form: Form) -> Any:
    """Return ``load(moves, row)``, the coefficients of a move for :mod:`nearharmonic.core.step`."""
    if form.stages:
        return compiled(lambda moves, at: (load_real(moves, at), load_real(moves, at + 1), moves, at))
    if form.turning:
        return rotation.row_loader(extended=form.extended)
    load, parts = _pair if form.extended else load_real, form.parts
    if form.modified:
        return compiled(lambda moves, at: (load(moves, at), load(moves, at + parts), load(moves, at + SQUARE * parts)))
    if form.ahead:
        return compiled(
            lambda moves, at: (
                load_real(moves, at + KICK), load_real(moves, at + DRIFT), load_real(moves, at + PRODUCT),
                load_real(moves, at + REST),
            )
        )  # fmt: skip
    return compiled(lambda moves, at: (load(moves, at), load(moves, at + parts)))


@compiled
def with_time(q, q_low, before, low_before, drift):  # type: ignore[no-untyped-def]
    """The positions after a drift from those before, with a compensated sum for the one that is the time."""
    time, low = step.compensated(before, low_before, drift, zero_like(before) + 1.0)
    return _timed(time, q), _timed(low, q_low)


def _move(form: Form) -> Any:
    """The move of a form: :mod:`nearharmonic.core.step`, or :mod:`nearharmonic.core.step`."""
    if form.turning:
        rotated = rotation.rotated(form)
        return compiled(lambda state, row, f, parameters: rotated(state, row, f))
    rates = _rates(form)
    move = step.move_of(form, linked("velocity", rates), linked("acceleration", rates))
    if form.modified:
        move = step.modified(form, move)
    resting, timed = form.resting, form.timed
    if not (resting or timed):
        return move

    @compiled
    def move_some(state, row, f, parameters):  # type: ignore[no-untyped-def]
        q, q_low, p, p_low, late = move(state, row, f, parameters)
        if timed:
            q, q_low = with_time(q, q_low, state[0], state[1], row[DRIFT])
        if resting:
            q, q_low = _moved(q, state[0]), _moved(q_low, state[1])
        return q, q_low, p, p_low, late

    return move_some


def _closed(form: Form, move: Any) -> Any:
    """``closed(state, row, f, parameters)``: the state at the end of a step, one move after ``state``."""
    sheared, turning = rotation.sheared(form), form.turning
    late_by = form.compensated and form.ahead

    @compiled
    def closed(state, row, f, parameters):  # type: ignore[no-untyped-def]
        state = move(state, row, f, parameters)
        if turning:
            state = sheared(state, row)
        q, q_low, p, p_low, late = state
        if late_by:
            q_low = q_low + late
        return q, q_low, p, p_low

    return closed


def _without(form: Form) -> Any:
    """``without(coefficient, rates)``: 0 in the lanes where the coefficient is 0."""
    if form.extended:
        return compiled(lambda c, f: (where_zero(c, 0.0, f[0]), where_zero(c, 0.0, f[1])))
    return compiled(lambda c, f: where_zero(c, 0.0, f))


def _forces(form: Form) -> tuple[Any, Any, Any]:
    """``first(state, moves, parameters)`` and ``behind(state, moves, row, parameters)``: the forces that moves take.

    The third function, ``last``, is ``behind`` with V as a second result. If no kick comes first, the first force has
    no effect and need not exist. For kicks of a modified potential, the gradient of the square follows the force if a
    lane needs it.
    """
    without = _without(form)
    force, square = linked("force", _rates(form)), linked("square", _rates(form))
    force_and_potential = linked("force_and_potential", types.Tuple((POINT, REAL)))
    m = SQUARE * form.parts
    if not form.modified:

        @compiled
        def first(state, moves, parameters):  # type: ignore[no-untyped-def]
            return without(load_real(moves, KICK), force(state[0], state[1], parameters))

        @compiled
        def behind(state, moves, row, parameters):  # type: ignore[no-untyped-def]
            return force(state[0], state[1], parameters)

        @compiled
        def last(state, moves, row, parameters):  # type: ignore[no-untyped-def]
            return force_and_potential(state[0], state[1], parameters)

        return first, behind, last

    @compiled
    def squared(state, f, needed, parameters):  # type: ignore[no-untyped-def]
        g = zero_like(f)
        if not all_zero(needed):
            g = without(needed, square(state[0], state[1], parameters))
        return g

    @compiled
    def first_pull(state, moves, parameters):  # type: ignore[no-untyped-def]
        f = force(state[0], state[1], parameters)
        g = squared(state, f, load_real(moves, m), parameters)
        return without(load_real(moves, KICK), f), without(load_real(moves, KICK), g)

    @compiled
    def pull(state, moves, row, parameters):  # type: ignore[no-untyped-def]
        f = force(state[0], state[1], parameters)
        return f, squared(state, f, load_real(moves, row + _columns() - 1), parameters)

    @compiled
    def last_pull(state, moves, row, parameters):  # type: ignore[no-untyped-def]
        f, V = force_and_potential(state[0], state[1], parameters)
        return (f, squared(state, f, load_real(moves, row + _columns() - 1), parameters)), V

    return first_pull, pull, last_pull


def _opened(form: Form, row_of: Any, move: Any) -> Any:
    """``opened(state, moves)``: the state after a separate first move, in the lanes that have one.

    Such a move has no kick by the force, and ends with a shear. It is complete here: its coefficients are then reset.
    """
    if not form.turning:
        return compiled(lambda state, moves, parameters: state)
    sheared, extended = rotation.sheared(form), form.extended

    @compiled
    def opened(state, moves, parameters):  # type: ignore[no-untyped-def]
        row = row_of(moves, 0)
        shear = largest_modulus(row[-1][0] if extended else row[-1])
        nothing = zero_like((state[0], state[0]) if extended else state[0])
        turned = sheared(move(state, row, nothing, parameters), row)
        for column in range(_columns()):
            x = load_real(moves, column)
            store(moves, column, where_zero(shear, x, zero_like(x)))
        q, q_low, p, p_low, late = state
        return (
            where_zero(shear, q, turned[0]), where_zero(shear, q_low, turned[1]), where_zero(shear, p, turned[2]),
            where_zero(shear, p_low, turned[3]), where_zero(shear, late, turned[4]),
        )  # fmt: skip

    return opened


def motion(form: Form) -> Motion:
    """Return the functions that :func:`nearharmonic.core.loops.advance.advance` calls, for states that are points."""
    move = _move(form)
    opened = _opened(form, row_loader(form), move)
    first, behind, last = _forces(form)

    @compiled
    def load(rows, moves, parameters):  # type: ignore[no-untyped-def]
        running = _running()
        q, q_low, p, p_low = load_state(rows, running)
        late = load_point(rows, running + 4 * _dimension())
        return opened((q, q_low, p, p_low, late), moves, parameters), load_state(rows, 0)

    @compiled
    def save(rows, state, seen):  # type: ignore[no-untyped-def]
        q, q_low, p, p_low, late = state
        store_state(rows, _running(), q, q_low, p, p_low)
        store(rows, _running() + 4 * _dimension(), late)
        q, q_low, p, p_low = seen
        store_state(rows, 0, q, q_low, p, p_low)

    return Motion(load, first, move, behind, last, _closed(form, move), save)


def measured() -> Measured:
    """Return the energies of states that are points."""
    pair = types.UniTuple(REAL, 2)
    energy, rounding = linked("energy", pair), linked("rounding", pair)
    energies = linked("energies", types.UniTuple(REAL, 4))
    potential, kinetic = linked("potential", REAL), linked("kinetic", REAL)
    return Measured(
        compiled(lambda seen, parameters: energy(*seen, parameters)),
        compiled(lambda seen, parameters: energies(*seen, parameters)),
        compiled(lambda seen, parameters: rounding(*seen, parameters)),
        compiled(lambda seen, parameters: potential(seen[0], seen[1], parameters)),
        compiled(lambda seen, parameters: kinetic(seen[2], parameters)),
    )
