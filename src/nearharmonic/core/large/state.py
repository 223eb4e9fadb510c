"""States of many coordinates in memory, which advance eight coordinates at a time.

The state is the address of the rows. If masses are not 1, a move computes the kick, the velocity and the drift one
after the other: the number of operations bounds the time of such states, not the longest chain.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core import step
from nearharmonic.core.large.terms import BLOCK
from nearharmonic.core.layout import KICK, Form, Measured, Motion
from nearharmonic.core.machine.reals import (
    REAL,
    all_zero,
    compiled,
    linked,
    linked_number,
    load_point,
    load_real,
    store,
    store_rest,
    types,
    zero_like,
)
from nearharmonic.core.points import load_state

_dimension, _running, _force_at, _force_plane, _velocity_at, _velocity_plane = (
    linked_number(name) for name in ("dimension", "running", "force_at", "force_plane", "velocity_at", "velocity_plane")
)


@compiled
def _put(rows, at, first, value):  # type: ignore[no-untyped-def]
    """Replace a block of coordinates, or the coordinates behind the last full block."""
    if first + BLOCK <= _dimension():
        store(rows, at + first, value)
    else:
        store_rest(rows, at + first, value)


@compiled
def _load(rows, first):  # type: ignore[no-untyped-def]
    """A block of the running state."""
    at = _running() + first
    return (*load_state(rows, at), load_point(rows, at + 4 * _dimension()))


def _kept(at: Any, plane: Any, *, extended: bool) -> Any:
    """Return ``load(rows, i)``, which loads a block of rates that are stored from ``at`` on."""
    if extended:
        return compiled(lambda rows, i: (load_point(rows, at() + i), load_point(rows, at() + plane() + i)))
    return compiled(lambda rows, i: load_point(rows, at() + i))


def _move_of_unit_masses(form: Form) -> Any:
    """``moved(rows, row, to)``: a move from the running state to the rows from ``to`` on."""
    same, extended = compiled(lambda x, parameters: x), form.extended
    velocity = same if form.ahead else compiled(lambda p, low, parameters: (p, low) if extended else p)
    move = step.move_of(form, velocity, same)
    force = _kept(_force_at, _force_plane, extended=form.extended)
    late_by = form.compensated and form.ahead

    @compiled
    def moved(rows, row, to):  # type: ignore[no-untyped-def]
        d, running = _dimension(), _running()
        for first in range(0, d, BLOCK):
            q, q_low, p, p_low, late = move(_load(rows, first), row, force(rows, first), 0)
            if to == running:
                _put(rows, to + 4 * d, first, late)
            elif late_by:
                q_low = q_low + late
            _put(rows, to, first, q)
            _put(rows, to + d, first, q_low)
            _put(rows, to + 2 * d, first, p)
            _put(rows, to + 3 * d, first, p_low)

    return moved


def _move_of_masses(form: Form) -> Any:
    """``moved(rows, row, to)`` as above, for velocities that depend on all momenta."""
    update, timed = step.update_of(form), form.timed
    force = _kept(_force_at, _force_plane, extended=form.extended)
    velocity = _kept(_velocity_at, _velocity_plane, extended=form.extended)
    velocities = linked("velocities", types.void)

    @compiled
    def moved(rows, row, to):  # type: ignore[no-untyped-def]
        d, running, (kick, drift) = _dimension(), _running(), row
        for first in range(0, d, BLOCK):
            _, _, p, p_low, _ = _load(rows, first)
            p, p_low = update(p, p_low, kick, force(rows, first))
            _put(rows, to + 2 * d, first, p)
            _put(rows, to + 3 * d, first, p_low)
        velocities(rows, to)
        time, low = load_real(rows, running + d - 1), load_real(rows, running + 2 * d - 1)
        for first in range(0, d, BLOCK):
            q, q_low, _, _, _ = _load(rows, first)
            q, q_low = update(q, q_low, drift, velocity(rows, first))
            _put(rows, to, first, q)
            _put(rows, to + d, first, q_low)
        if timed:
            time, low = step.compensated(time, low, drift, 1.0)
            store(rows, to + d - 1, time)
            store(rows, to + 2 * d - 1, low)

    return moved


@compiled
def load_rows(rows, moves, parameters):  # type: ignore[no-untyped-def]
    """The running state and the output state, which are both in the rows."""
    return rows, rows


@compiled
def save_rows(rows, state, seen):  # type: ignore[no-untyped-def]
    pass


def motion(form: Form) -> Motion:
    """Return the functions that :func:`nearharmonic.core.loops.advance.advance` calls, for states in memory."""
    moved = _move_of_unit_masses(form) if form.unit_masses else _move_of_masses(form)
    force, force_and_potential = linked("force", types.void), linked("force_and_potential", REAL)
    parts = form.parts

    @compiled
    def first(rows, moves, parameters):  # type: ignore[no-untyped-def]
        force(rows)
        nothing = load_real(moves, KICK)
        if all_zero(nothing):
            for part in range(parts):
                for i in range(_dimension()):
                    store(rows, _force_at() + part * _force_plane() + i, zero_like(nothing))
        return 0

    @compiled
    def move(rows, row, f, parameters):  # type: ignore[no-untyped-def]
        moved(rows, row, _running())
        return rows

    @compiled
    def behind(rows, moves, row, parameters):  # type: ignore[no-untyped-def]
        force(rows)
        return 0

    @compiled
    def last(rows, moves, row, parameters):  # type: ignore[no-untyped-def]
        return 0, force_and_potential(rows)

    @compiled
    def closed(rows, row, f, parameters):  # type: ignore[no-untyped-def]
        moved(rows, row, 0)
        return rows

    return Motion(load_rows, first, move, behind, last, closed, save_rows)


def measured() -> Measured:
    """Return the energies of states in memory."""
    pair = types.UniTuple(REAL, 2)
    found = {
        "energy": pair, "energies": types.UniTuple(REAL, 4), "rounding": pair, "potential": REAL, "kinetic": REAL,
    }  # fmt: skip

    def of_rows(name: str, kind: Any) -> Any:
        function = linked(name, kind)
        return compiled(lambda rows, parameters: function(rows))

    return Measured(**{name: of_rows(name, kind) for name, kind in found.items()})
