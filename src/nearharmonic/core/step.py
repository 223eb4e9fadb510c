"""Steps of splitting methods: moves, rotations, and their forces, for states that are points or in memory.

Functions of a system and of its lanes are linked by name: see :mod:`nearharmonic.core.emission`.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.arithmetic import dd_add, dd_mul, fma
from nearharmonic.core.layout import BLOCK, DRIFT, KICK, PRODUCT, REST, SQUARE, TURNS, Form, Motion
from nearharmonic.core.reals import (
    POINT,
    REAL,
    VOID,
    all_zero,
    largest_modulus,
    linked,
    linked_number,
    load_point,
    load_real,
    store,
    store_rest,
    where_zero,
    zero_like,
)

# --- The definition of a step.
#
# A step is a sequence of kicks p -= k dV/dq and drifts q += e dT/dp. A kick and the next drift are one *move*, from
# the force at a position to the next position. If T is quadratic, with dT/dp = v(p) and the acceleration a(f) by a
# force f, the new position is (q + e v(p)) + (e k) a(f). The sum in brackets is ready before the force, so that only
# one operation follows the force. This shortens the chain of operations that bounds the time of one trajectory. The
# product e k is rounded once, and differs from the product of the rounded e and k. This rounding would break
# symplecticity and make the energy drift, so the difference, ``rest``, is added one move later. The chain does not
# bound the time of double-double operations. For these, and for T that is not quadratic, the momentum is computed
# first.
#
# A state is (q, q_low, p, p_low, late): positions and momenta, their low parts (carries of compensated sums, low halves
# of double-doubles), and the rest that the next move adds. All are points (:mod:`nearharmonic.core.reals`).
# Coefficients of kicks carry the minus sign of dp/dt = -dV/dq.
#
# The functions below return a ``move(state, row, force, parameters)`` for the formulas of a system:
# ``row`` holds the coefficients of the move, and ``force`` is the force at the position of the state.


def compensated(y: Any, carry: Any, c: Any, rate: Any) -> Any:
    """y += c rate; the rounding error goes into the carry (Kahan 1965, doi:10.1145/363707.363723)."""
    increment = fma(c, rate, carry)
    total = y + increment
    return total, increment + (y - total)


def plain(y: Any, carry: Any, c: Any, rate: Any) -> Any:
    """y += c rate; the carry stays 0."""
    return fma(c, rate, y), carry


def double_double(y: Any, low: Any, c: Any, rate: Any) -> Any:
    """y += c rate, each a pair."""
    return dd_add((y, low), dd_mul(c, rate))


def update_of(form: Form) -> Any:
    """Return the addition of a form: one of the three functions above."""
    return double_double if form.extended else compensated if form.compensated else plain


def ahead_compensated(velocity: Any, acceleration: Any) -> Any:
    """A move whose position is ready one operation after the force, with compensated sums."""

    def move(state, row, f, parameters):
        (q, q_low, p, p_low, late), (kick, drift, product, rest) = state, row
        v, a = velocity(p, parameters), acceleration(f, parameters)
        q, q_low = compensated(q, fma(drift, v, late) + q_low, product, a)
        p, p_low = compensated(p, p_low, kick, f)
        return q, q_low, p, p_low, rest * a

    return move


def ahead_plain(velocity: Any, acceleration: Any) -> Any:
    """A move whose position is ready one operation after the force, with plain sums."""

    def move(state, row, f, parameters):
        (q, q_low, p, p_low, late), (kick, drift, product, _) = state, row
        ahead = fma(drift, velocity(p, parameters), q)
        return fma(product, acceleration(f, parameters), ahead), q_low, fma(kick, f, p), p_low, late

    return move


def momentum_first(velocity: Any, update: Any) -> Any:
    """A kick and then a drift, by :func:`compensated`, :func:`plain` or :func:`double_double`."""

    def move(state, row, f, parameters):
        (q, q_low, p, p_low, late), (kick, drift) = state, row
        p, p_low = update(p, p_low, kick, f)
        q, q_low = update(q, q_low, drift, velocity(p, p_low, parameters))
        return q, q_low, p, p_low, late

    return move


def move_of(form: Form, velocity: Any, acceleration: Any) -> Any:
    """Return the move of a form: one of the three above."""
    if not form.ahead:
        return momentum_first(velocity, update_of(form))
    return (ahead_compensated if form.compensated else ahead_plain)(velocity, acceleration)


def modified(form: Form, move: Any) -> Any:
    """A move with the force k V' + m grad |V'|^2 of a modified potential, in double rounded once per component.

    Momentum and position use the same rounded number, so that the map is symplectic up to the rounding of the sums.
    """
    extended, ahead = form.extended, form.ahead

    def modified_move(state, row, forces, parameters):
        (kick, drift, m), (f, g) = row, forces
        if extended:
            return move(state, ((1.0, 0.0), drift), dd_add(dd_mul(kick, f), dd_mul(m, g)), parameters)
        return move(state, (1.0, drift, drift, 0.0) if ahead else (1.0, drift), fma(m, g, kick * f), parameters)

    return modified_move


# --- The move of a system with an exactly solved oscillator: a kick by the rest of V, then a rotation.
#
# A coordinate of frequency w rotates by an angle x in its phase plane. A rotation is three shears: with T = w
# tan(x/2) and S = sin(x)/w, p -= T q, q += S p, p -= T q. The last shear of one move, the kick, and the first shear
# of the next move are at the same position. Together they are one kick k f + b q with b = -(T + T'). The move is
# therefore a kick and a drift again, with a force that has a linear part. Rounded coefficients give a slightly
# different map. It still consists of shears and is symplectic, so the energy does not drift. The new position is (q +
# S p + S b q) + (S k) f, as above. The rounding errors of S k and S b are added one move later.
#
# Between moves the momentum lacks the shear that is part of the next kick. The first move of a run and the output state
# at the end of a step have a separate shear.


def rotated_compensated(state, row, f, parameters):
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, rest, linear_rest, _ = row
    ahead = fma(S, p, fma(linear_product, q, late)) + q_low
    behind = fma(linear_rest, q, rest * f)
    p, p_low = compensated(p, fma(b, q, p_low), kick, f)
    q, q_low = compensated(q, ahead, product, f)
    return q, q_low, p, p_low, behind


def rotated_plain(state, row, f, parameters):
    q, q_low, p, p_low, late = state
    kick, b, S, product, linear_product, _, _, _ = row
    ahead = fma(S, p, fma(linear_product, q, q))
    p = fma(kick, f, fma(b, q, p))
    return fma(product, f, ahead), q_low, p, p_low, late


def rotated_double_double(state, row, f, parameters):
    q, q_low, p, p_low, late = state
    kick, b, S, _ = row
    p, p_low = double_double(p, p_low, kick, f)
    p, p_low = double_double(p, p_low, b, (q, q_low))
    q, q_low = double_double(q, q_low, S, (p, p_low))
    return q, q_low, p, p_low, late


def rotated(form: Form) -> Any:
    """Return the rotation of a form: one of the three functions above."""
    return rotated_double_double if form.extended else rotated_compensated if form.compensated else rotated_plain


def sheared(form: Form) -> Any:
    """Return ``sheared(state, row)``: the state after the shear p += ... q that follows the move of a row."""
    update, extended = update_of(form), form.extended

    def shear(state, row):
        q, q_low, p, p_low, late = state
        if extended:
            p, p_low = update(p, p_low, row[-1], (q, q_low))
        else:
            p, p_low = update(p, p_low, row[-1], q)
        return q, q_low, p, p_low, late

    return shear


def rotation_loader(*, extended: bool) -> Any:
    """Return ``load(moves, row)``: the kick (a real), and b, S, S k, S b, the two rests and the shear (points)."""
    columns = tuple(linked(f"turn{column}", POINT) for column in range(6 if extended else TURNS))
    if extended:
        b, b_low, S, S_low, shear, shear_low = columns

        def load(moves, row):
            return (
                (load_real(moves, row), load_real(moves, row + 1)), (b(moves, row), b_low(moves, row)),
                (S(moves, row), S_low(moves, row)), (shear(moves, row), shear_low(moves, row)),
            )  # fmt: skip

        return load
    linear, drift, product, linear_product, rest, linear_rest, sheared = columns

    def load_doubles(moves, row):
        return (
            load_real(moves, row), linear(moves, row), drift(moves, row), product(moves, row),
            linear_product(moves, row), rest(moves, row), linear_rest(moves, row), sheared(moves, row),
        )  # fmt: skip

    return load_doubles


# --- States that are points: the moves of a step, and the energies, for a form.

#: Indices of rows: of coordinates, of the coefficients of a move, and of the running state.
_dimension, _columns, _running = (linked_number(name) for name in ("dimension", "columns", "running"))
#: ``_moved(new, old)``: coordinates that can move are taken from ``new``, the others from ``old``.
#: ``_timed(time, others)``: a coordinate that is the time is taken from ``time``.
_moved, _timed = linked("moved", POINT), linked("timed", POINT)


def _rates(form: Form) -> Any:
    return (POINT, POINT) if form.extended else POINT


def load_state(rows, at):
    d = _dimension()
    return load_point(rows, at), load_point(rows, at + d), load_point(rows, at + 2 * d), load_point(rows, at + 3 * d)


def store_state(rows, at, q, q_low, p, p_low):
    d = _dimension()
    store(rows, at, q)
    store(rows, at + d, q_low)
    store(rows, at + 2 * d, p)
    store(rows, at + 3 * d, p_low)


def _pair(moves, at):
    return load_real(moves, at), load_real(moves, at + 1)


def row_loader(form: Form) -> Any:
    """Return ``load(moves, row)``, the coefficients of a move for :mod:`nearharmonic.core.step`."""
    if form.stages:
        return lambda moves, at: (load_real(moves, at), load_real(moves, at + 1), moves, at)
    if form.turning:
        return rotation_loader(extended=form.extended)
    load, parts = _pair if form.extended else load_real, form.parts
    if form.modified:
        return lambda moves, at: (load(moves, at), load(moves, at + parts), load(moves, at + SQUARE * parts))
    if form.ahead:
        return lambda moves, at: (
                load_real(moves, at + KICK), load_real(moves, at + DRIFT), load_real(moves, at + PRODUCT),
                load_real(moves, at + REST),
            )  # fmt: skip
    return lambda moves, at: (load(moves, at), load(moves, at + parts))


def with_time(q, q_low, before, low_before, drift):
    """The positions after a drift from those before, with a compensated sum for the one that is the time."""
    time, low = compensated(before, low_before, drift, zero_like(before) + 1.0)
    return _timed(time, q), _timed(low, q_low)


def _move(form: Form) -> Any:
    """The move of a form."""
    if form.turning:
        return rotated(form)
    rates = _rates(form)
    move = move_of(form, linked("velocity", rates), linked("acceleration", rates))
    if form.modified:
        move = modified(form, move)
    resting, timed = form.resting, form.timed
    if not (resting or timed):
        return move

    def move_some(state, row, f, parameters):
        q, q_low, p, p_low, late = move(state, row, f, parameters)
        if timed:
            q, q_low = with_time(q, q_low, state[0], state[1], row[DRIFT])
        if resting:
            q, q_low = _moved(q, state[0]), _moved(q_low, state[1])
        return q, q_low, p, p_low, late

    return move_some


def _closed(form: Form, move: Any) -> Any:
    """``closed(state, row, f, parameters)``: the state at the end of a step, one move after ``state``."""
    shear, turning = sheared(form), form.turning
    late_by = form.compensated and form.ahead

    def closed(state, row, f, parameters):
        state = move(state, row, f, parameters)
        if turning:
            state = shear(state, row)
        q, q_low, p, p_low, late = state
        if late_by:
            q_low = q_low + late
        return q, q_low, p, p_low

    return closed


def _without(form: Form) -> Any:
    """``without(coefficient, rates)``: 0 in the lanes where the coefficient is 0."""
    if form.extended:
        return lambda c, f: (where_zero(c, 0.0, f[0]), where_zero(c, 0.0, f[1]))
    return lambda c, f: where_zero(c, 0.0, f)


def _forces(form: Form) -> tuple[Any, Any, Any]:
    """``first(state, moves, parameters)`` and ``behind(state, moves, row, parameters)``: the forces that moves take.

    The third function, ``last``, is ``behind`` with V as a second result. If no kick comes first, the first force has
    no effect and need not exist. For kicks of a modified potential, the gradient of the square follows the force if a
    lane needs it.
    """
    modified, m = form.modified, SQUARE * form.parts
    force, square = linked("force", _rates(form)), linked("square", _rates(form))
    force_and_potential, without = linked("force_and_potential", (POINT, REAL)), _without(form)

    def squared(state, f, needed, parameters):
        g = zero_like(f)
        if not all_zero(needed):
            g = without(needed, square(state[0], state[1], parameters))
        return g

    def with_square(state, f, moves, row, parameters):
        if modified:
            return f, squared(state, f, load_real(moves, row + _columns() - 1), parameters)
        return f

    def first(state, moves, parameters):
        c, f = load_real(moves, KICK), force(state[0], state[1], parameters)
        if modified:
            return without(c, f), without(c, squared(state, f, load_real(moves, m), parameters))
        return without(c, f)

    def behind(state, moves, row, parameters):
        return with_square(state, force(state[0], state[1], parameters), moves, row, parameters)

    def last(state, moves, row, parameters):
        f, V = force_and_potential(state[0], state[1], parameters)
        return with_square(state, f, moves, row, parameters), V

    return first, behind, last


def _opened(form: Form, row_of: Any, move: Any) -> Any:
    """``opened(state, moves)``: the state after a separate first move, in the lanes that have one.

    Such a move has no kick by the force, and ends with a shear. It is complete here: its coefficients are then reset.
    """
    if not form.turning:
        return lambda state, moves, parameters: state
    shear, extended = sheared(form), form.extended

    def opened(state, moves, parameters):
        row = row_of(moves, 0)
        size = largest_modulus(row[-1][0] if extended else row[-1])
        nothing = zero_like((state[0], state[0]) if extended else state[0])
        turned = shear(move(state, row, nothing, parameters), row)
        for column in range(_columns()):
            x = load_real(moves, column)
            store(moves, column, where_zero(size, x, zero_like(x)))
        q, q_low, p, p_low, late = state
        return (
            where_zero(size, q, turned[0]), where_zero(size, q_low, turned[1]), where_zero(size, p, turned[2]),
            where_zero(size, p_low, turned[3]), where_zero(size, late, turned[4]),
        )  # fmt: skip

    return opened


def motion(form: Form) -> Motion:
    """Return the functions that :func:`nearharmonic.core.loops.advance` calls."""
    if form.large:
        return _motion_in_memory(form)
    move = _move(form)
    opened = _opened(form, row_loader(form), move)
    first, behind, last = _forces(form)

    def load(rows, moves, parameters):
        running = _running()
        q, q_low, p, p_low = load_state(rows, running)
        late = load_point(rows, running + 4 * _dimension())
        return opened((q, q_low, p, p_low, late), moves, parameters), load_state(rows, 0)

    def save(rows, state, seen):
        q, q_low, p, p_low, late = state
        store_state(rows, _running(), q, q_low, p, p_low)
        store(rows, _running() + 4 * _dimension(), late)
        q, q_low, p, p_low = seen
        store_state(rows, 0, q, q_low, p, p_low)

    return Motion(load, first, move, behind, last, _closed(form, move), save)


# --- States of many coordinates in memory, which advance eight coordinates at a time.
#
# The state is the address of the rows. If masses are not 1, a move computes the kick, the velocity and the drift one
# after the other: the number of operations bounds the time of such states, not the longest chain.

_force_at, _force_plane, _velocity_at, _velocity_plane = (
    linked_number(name) for name in ("force_at", "force_plane", "velocity_at", "velocity_plane")
)


def _put(rows, at, first, value):
    """Replace a block of coordinates, or the coordinates behind the last full block."""
    if first + BLOCK <= _dimension():
        store(rows, at + first, value)
    else:
        store_rest(rows, at + first, value)


def _load(rows, first):
    """A block of the running state."""
    at = _running() + first
    return (*load_state(rows, at), load_point(rows, at + 4 * _dimension()))


def _kept(at: Any, plane: Any, *, extended: bool) -> Any:
    """Return ``load(rows, i)``, which loads a block of rates that are stored from ``at`` on."""
    if extended:
        return lambda rows, i: (load_point(rows, at() + i), load_point(rows, at() + plane() + i))
    return lambda rows, i: load_point(rows, at() + i)


def _move_of_unit_masses(form: Form) -> Any:
    """``moved(rows, row, to)``: a move from the running state to the rows from ``to`` on."""
    same, extended = lambda x, parameters: x, form.extended
    velocity = same if form.ahead else lambda p, low, parameters: (p, low) if extended else p
    move = move_of(form, velocity, same)
    force = _kept(_force_at, _force_plane, extended=form.extended)
    late_by = form.compensated and form.ahead

    def moved(rows, row, to):
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
    update, timed = update_of(form), form.timed
    force = _kept(_force_at, _force_plane, extended=form.extended)
    velocity = _kept(_velocity_at, _velocity_plane, extended=form.extended)
    velocities = linked("velocities", VOID)

    def moved(rows, row, to):
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
            time, low = compensated(time, low, drift, 1.0)
            store(rows, to + d - 1, time)
            store(rows, to + 2 * d - 1, low)

    return moved


def load_rows(rows, moves, parameters):
    """The running state and the output state, which are both in the rows."""
    return rows, rows


def save_rows(rows, state, seen):
    """Both are there already."""


def _motion_in_memory(form: Form) -> Motion:
    """As :func:`motion`, for states in memory."""
    moved = _move_of_unit_masses(form) if form.unit_masses else _move_of_masses(form)
    force, force_and_potential = linked("force", VOID), linked("force_and_potential", REAL)
    parts = form.parts

    def first(rows, moves, parameters):
        force(rows)
        nothing = load_real(moves, KICK)
        if all_zero(nothing):
            for part in range(parts):
                for i in range(_dimension()):
                    store(rows, _force_at() + part * _force_plane() + i, zero_like(nothing))
        return 0

    def move(rows, row, f, parameters):
        moved(rows, row, _running())
        return rows

    def behind(rows, moves, row, parameters):
        force(rows)
        return 0

    def last(rows, moves, row, parameters):
        return 0, force_and_potential(rows)

    def closed(rows, row, f, parameters):
        moved(rows, row, 0)
        return rows

    return Motion(load_rows, first, move, behind, last, closed, save_rows)


def measured(name: str, *, large: bool) -> Any:
    """Return ``f(seen, parameters)``, an energy of an output state that is of points or in memory.

    "energy" is H as a pair; "energies" are H as a pair, T, and 0; "rounding" is the rounding error of H in double,
    absolute and relative; "potential" and "kinetic" are V and T in double.
    """
    numbers = {"potential": 1, "kinetic": 1, "energies": 4}.get(name, 2)
    function = linked(name, REAL if numbers == 1 else (REAL,) * numbers)
    if large:
        return lambda rows, parameters: function(rows)
    if name == "potential":
        return lambda seen, parameters: function(seen[0], seen[1], parameters)
    if name == "kinetic":
        return lambda seen, parameters: function(seen[2], parameters)
    return lambda seen, parameters: function(*seen, parameters)
