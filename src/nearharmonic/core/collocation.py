"""Steps of a collocation method, for states that are points or in memory: one move is a whole step."""

from __future__ import annotations

from math import inf, nan
from typing import Any

from nearharmonic.core.arithmetic import dd_add, dd_mul, fma
from nearharmonic.core.layout import FAILED, ITERATIONS, READY, Form, Motion
from nearharmonic.core.reals import (
    POINT,
    REAL,
    STAGES,
    VOID,
    absolute,
    all_greater,
    all_zero,
    larger,
    largest_modulus,
    linked,
    linked_number,
    load_real,
    load_stages,
    store,
    where_greater,
    where_zero,
    zero_like,
)
from nearharmonic.core.step import compensated, load_rows, load_state, plain, save_rows, store_state, with_time

# --- Fixed-point iteration on the forces at the stages of a step, to the rounding of the arithmetic.
#
# Changes shrink by about the same factor from iteration to iteration, so that the next one is known before it is
# made. A lane stops when that is below the rounding of the forces, or when the changes no longer shrink. A change
# that is far above the rounding of doubles may grow for once and shrink again in a long step: only if none of several
# is a new least one, it is the rounding of forces that cancel. What a lane computes is independent of the other
# lanes.

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

    def going(active, size, before, change, latest, count, vain):
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

    def missed(active, size, before, change, latest, count):
        nothing = zero_like(size)
        allowed = where_zero(active, solved * size, small * size)
        found = where_greater(latest, allowed, nothing + 1.0, nothing)
        if count > 1:
            by_last = where_greater(latest * latest, negligible * size * change, found, nothing)
            found = where_greater(latest * change, negligible * size * before, found, by_last)
        return found

    return missed


def counted(least, vain, latest):
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

    def largest(f):
        return largest_modulus(f[0] if extended else f)

    def apart(f, g):
        if extended:
            return largest_modulus((f[0] - g[0]) + (f[1] - g[1]))
        return largest_modulus(f - g)

    def kept(active, f, g):
        if extended:
            return where_zero(active, f[0], g[0]), where_zero(active, f[1], g[1])
        return where_zero(active, f, g)

    def solve(f, step, parameters):
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


# --- Steps for states that are points.
#
# A state is (q, q_low, p, p_low, f, ready, iterations, failed): with f, the forces at the stages of the last step,
# which are extrapolated to the next step where ``ready`` is 1. Coefficients and conditions of symplecticity are in
# :mod:`nearharmonic.core.layout`.
#
# For f = -w^2 q - n(q) with declared frequencies w, the oscillator can be part of the equations, so that only n is
# iterated. With A the matrix of the method, G = (I + (h w A)^2)^-1 and B = G A A, the stages are Q = G (q + h c v) -
# h^2 B n(Q). One iteration on all forces follows: it removes the rounding of G and B, which would not be symplectic.

_dimension, _running, _counters = (linked_number(name) for name in ("dimension", "running", "counters"))
_at_stages, _summed = linked("at_stages", STAGES), linked("summed", POINT)
_weights, _times_nodes, _times_rest = (linked(name, STAGES) for name in ("weights", "times_nodes", "times_rest"))
_by_position, _by_momentum, _by_guess = (linked(f"by_{name}", STAGES) for name in ("position", "momentum", "guess"))
_PAIR, _PAIRS = (POINT, POINT), (STAGES, STAGES)


def _by_accelerations(form: Form) -> tuple[Any, Any, Any]:
    """The three functions of a step for T of degree 2, where positions follow from forces alone.

    ``begun(q, p, row, parameters)`` returns the numbers that the iterations of a step share, ``forces_behind`` is
    used by :func:`iteration`, and ``ended(state, f, step, parameters)`` returns the last (q, q_low, p, p_low).
    """
    velocity, acceleration = linked("velocity", POINT), linked("stage_acceleration", STAGES)
    force, add = linked("stage_force", STAGES), compensated if form.compensated else plain

    def begun(state, row, parameters):
        h, v = row[0], velocity(state[2], parameters)
        return _weights(-h), h, v, fma(h, _times_nodes(_at_stages(v)), _at_stages(state[0]))

    def forces_behind(f, step, parameters):
        weights, h, _, ahead = step
        Q = fma(h, _by_position(acceleration(weights * f, parameters)), ahead)
        return force(Q, Q, parameters)

    def ended(state, f, step, parameters):
        (q, q_low, p, p_low), (weights, h, v, _) = state, step
        increments = weights * f
        p, p_low = add(p, p_low, 1.0, _summed(increments))
        q, q_low = add(q, q_low, h, v + _summed(_times_rest(acceleration(increments, parameters))))
        return q, q_low, p, p_low

    return begun, forces_behind, ended


def _by_oscillators(form: Form) -> tuple[Any, Any, Any]:
    """The three functions of a step for T = p.p / 2 and exactly known oscillators; forces are those beside them.

    ``ended`` makes the last iteration, on all forces.
    """
    force, add = linked("stage_force", STAGES), compensated if form.compensated else plain
    turned, by_oscillators, with_oscillators = (
        linked(name, STAGES) for name in ("turned", "by_oscillators", "with_oscillators")
    )

    def begun(state, row, parameters):
        (q, _, p, _), (h, _, moves, at) = state, row
        return _weights(-h), h, p, moves, at, turned(moves, at, _at_stages(q), _at_stages(h * p))

    def forces_behind(n, step, parameters):
        _, _, _, moves, at, ahead = step
        Q = ahead - by_oscillators(moves, at, n)
        return force(Q, Q, parameters)

    def ended(state, n, step, parameters):
        (q, q_low, p, p_low), (weights, h, v, moves, at, ahead) = state, step
        f = with_oscillators(moves, at, ahead - by_oscillators(moves, at, n), n)
        free = fma(h, _times_nodes(_at_stages(v)), _at_stages(q))
        Q = fma(h, _by_position(weights * f), free)
        increments = weights * with_oscillators(moves, at, Q, force(Q, Q, parameters))
        p, p_low = add(p, p_low, 1.0, _summed(increments))
        q, q_low = add(q, q_low, h, v + _summed(_times_rest(increments)))
        return q, q_low, p, p_low

    return begun, forces_behind, ended


def _by_momenta(form: Form) -> tuple[Any, Any, Any]:
    """The three functions of a step for any T: positions follow from momenta, and these from forces."""
    velocity, force = linked("stage_velocity", STAGES), linked("stage_force", STAGES)
    add = compensated if form.compensated else plain

    def begun(state, row, parameters):
        h = row[0]
        return _weights(-h), _weights(h), _at_stages(state[0]), _at_stages(state[2])

    def moved(f, step, parameters):
        kicks, drifts, _, p = step
        P = p + _by_momentum(kicks * f)
        return drifts * velocity(P, P, parameters)

    def forces_behind(f, step, parameters):
        Q = step[2] + _by_momentum(moved(f, step, parameters))
        return force(Q, Q, parameters)

    def ended(state, f, step, parameters):
        q, q_low, p, p_low = state
        p, p_low = add(p, p_low, 1.0, _summed(step[0] * f))
        q, q_low = add(q, q_low, 1.0, _summed(moved(f, step, parameters)))
        return q, q_low, p, p_low

    return begun, forces_behind, ended


def _in_pairs(form: Form) -> tuple[Any, Any, Any]:
    """The three functions of a step in double-double, for any T."""
    velocity, pull = linked("stage_velocity", _PAIRS), linked("stage_force", _PAIRS)
    with_oscillators, turning = linked("with_oscillators_pairs", _PAIRS), form.turning
    weights, by_momentum = linked("weights_pairs", _PAIRS), linked("by_momentum_pairs", _PAIRS)
    summed = linked("summed_pairs", _PAIR)

    def begun(state, row, parameters):
        (q, q_low, p, p_low), (h, h_low, moves, at) = state, row
        x, y = (_at_stages(q), _at_stages(q_low)), (_at_stages(p), _at_stages(p_low))
        return weights(-h, -h_low), weights(h, h_low), x, y, moves, at

    def force(Q, step, parameters):
        found = pull(Q[0], Q[1], parameters)
        if turning:
            found = with_oscillators(step[4], step[5], Q[0], Q[1], found[0], found[1])
        return found

    def moved(f, step, parameters):
        kicks, drifts, _, p, _, _ = step
        increments = dd_mul(kicks, f)
        P = dd_add(p, by_momentum(increments[0], increments[1]))
        return dd_mul(drifts, velocity(P[0], P[1], parameters))

    def forces_behind(f, step, parameters):
        increments = moved(f, step, parameters)
        Q = dd_add(step[2], by_momentum(increments[0], increments[1]))
        return force(Q, step, parameters)

    def ended(state, f, step, parameters):
        q, q_low, p, p_low = state
        kicks, drifts = dd_mul(step[0], f), moved(f, step, parameters)
        p, p_low = dd_add((p, p_low), summed(kicks[0], kicks[1]))
        q, q_low = dd_add((q, q_low), summed(drifts[0], drifts[1]))
        return q, q_low, p, p_low

    return begun, forces_behind, ended


def _step(form: Form) -> Any:
    """``step(state, row, parameters)``: the next state."""
    extended, more, timed = form.extended, 0.0, form.timed
    if extended:
        functions = _in_pairs
    elif form.turning:
        functions, more = _by_oscillators, 1.0
    else:
        functions = _by_accelerations if form.ahead else _by_momenta
    begun, forces_behind, ended = functions(form)
    solve = iteration(form, forces_behind)
    force = linked("force", _PAIR if extended else POINT)

    def at_start(q, q_low, parameters):
        found = force(q, q_low, parameters)
        return _at_stages(found[0] if extended else found)

    def step(state, row, parameters):
        q, q_low, p, p_low, f, ready, iterations, failed = state
        f = _by_guess(f)
        if not all_greater(ready, zero_like(ready)):
            f = where_zero(ready, at_start(q, q_low, parameters), f)
        given = begun((q, q_low, p, p_low), row, parameters)
        found, made, missed = solve((f, zero_like(f)) if extended else f, given, parameters)
        before = q, q_low
        q, q_low, p, p_low = ended((q, q_low, p, p_low), found, given, parameters)
        if timed:
            q, q_low = with_time(q, q_low, before[0], before[1], row[0])
        q = where_zero(missed, q, nan)
        f, ready, iterations = found[0] if extended else found, zero_like(ready) + 1.0, iterations + (made + more)
        return q, q_low, p, p_low, f, ready, iterations, failed + missed

    return step


def _first(state, moves, parameters):
    """No forces: a move finds those at its stages."""
    return 0


def _behind(state, moves, row, parameters):
    return 0


def _last(state, moves, row, parameters):
    return 0, zero_like(load_real(moves, 0))


def motion(form: Form) -> Motion:
    """Return the functions that the loops call."""
    if form.large:
        return _motion_in_memory(form)
    step = _step(form)

    def load(rows, moves, parameters):
        q, q_low, p, p_low = load_state(rows, _running())
        f, at = load_stages(rows, _running() + 5 * _dimension()), _counters()
        counters = load_real(rows, at + READY), load_real(rows, at + ITERATIONS), load_real(rows, at + FAILED)
        return (q, q_low, p, p_low, f, *counters), load_state(rows, 0)

    def move(state, row, f, parameters):
        return step(state, row, parameters)

    def closed(state, row, f, parameters):
        return state[0], state[1], state[2], state[3]

    def save(rows, state, seen):
        q, q_low, p, p_low, f, ready, iterations, failed = state
        store_state(rows, _running(), q, q_low, p, p_low)
        store(rows, _running() + 5 * _dimension(), f)
        at = _counters()
        store(rows, at + READY, ready)
        store(rows, at + ITERATIONS, iterations)
        store(rows, at + FAILED, failed)
        q, q_low, p, p_low = seen
        store_state(rows, 0, q, q_low, p, p_low)

    return Motion(load, _first, move, _behind, _last, closed, save)


# --- Steps for states of many coordinates in memory.
#
# For each coordinate, its numbers at all stages are neighbours, and products with the matrices of the method are those
# for one coordinate. Forces and velocities are evaluated for one stage after the other, at the running state.

_force_at, _velocity_at, _scratch, _stages = map(linked_number, ("force_at", "velocity_at", "scratch", "stages"))
_force, _velocities = linked("force", VOID), linked("velocities", VOID)
_sum_of_stages = linked("summed", REAL)


def _copy(rows, source, to):
    for k in range(_dimension()):
        rows[to + k] = rows[source + k]


def _from_stage(rows, stages, j, to):
    """Copy the numbers of one stage of all coordinates to the rows from ``to`` on."""
    for k in range(_dimension()):
        rows[to + k] = rows[stages + k * _stages() + j]


def _to_stage(rows, source, stages, j):
    for k in range(_dimension()):
        rows[stages + k * _stages() + j] = rows[source + k]


def _first_guess(rows, at):
    """Replace the forces of the last step by a guess of the next forces; they begin at row ``at``."""
    d, s = _dimension(), _stages()
    if rows[_counters() + READY] == 0:
        _force(rows)
        for j in range(s):
            _to_stage(rows, _force_at(), at, j)
        return
    for k in range(d):
        store(rows, at + k * s, _by_guess(load_stages(rows, at + k * s)))


def _of_unit_masses(form: Form) -> tuple[Any, Any]:
    """``positions(rows, h, at, places, start)`` and ``ended(rows, h, at, places, start)`` for T = p.p / 2.

    The first puts the stages of the positions that follow from the forces at row ``at`` into ``places``; the second
    moves the running state, from q and p in the rows from ``start`` on.
    """
    add = compensated if form.compensated else plain

    def positions(rows, h, at, places, start):
        weights = _weights(-h)
        for k in range(_dimension()):
            first = k * _stages()
            increments = weights * load_stages(rows, at + first)
            drift = _times_nodes(load_real(rows, start + _dimension() + k) + zero_like(increments))
            store(rows, places + first, fma(h, drift + _by_position(increments), load_real(rows, start + k)))

    def ended(rows, h, at, places, start):
        d, running, weights = _dimension(), _running(), _weights(-h)
        for k in range(d):
            increments = weights * load_stages(rows, at + k * _stages())
            q, p = load_real(rows, start + k), load_real(rows, start + d + k)
            drift = p + _sum_of_stages(_times_rest(increments))
            q, q_low = add(q, load_real(rows, running + d + k), h, drift)
            p, p_low = add(p, load_real(rows, running + 3 * d + k), 1.0, _sum_of_stages(increments))
            store_state(rows, running + k, q, q_low, p, p_low)

    return positions, ended


def _of_masses(form: Form) -> tuple[Any, Any]:
    """``positions`` and ``ended`` as above, for velocities that depend on all momenta."""
    add, timed = compensated if form.compensated else plain, form.timed

    def drifts(rows, h, at, places, start):
        d, s, momentum = _dimension(), _stages(), _running() + 2 * _dimension()
        kicks, lengths = _weights(-h), _weights(h)
        for k in range(d):
            increments = _by_momentum(kicks * load_stages(rows, at + k * s))
            store(rows, places + k * s, increments + load_real(rows, start + d + k))
        for j in range(s):
            _from_stage(rows, places, j, momentum)
            _velocities(rows, _running())
            _to_stage(rows, _velocity_at(), places, j)
        for k in range(d):
            store(rows, places + k * s, lengths * load_stages(rows, places + k * s))

    def positions(rows, h, at, places, start):
        drifts(rows, h, at, places, start)
        for k in range(_dimension()):
            first = places + k * _stages()
            store(rows, first, _by_momentum(load_stages(rows, first)) + load_real(rows, start + k))

    def ended(rows, h, at, places, start):
        d, running, kicks = _dimension(), _running(), _weights(-h)
        drifts(rows, h, at, places, start)
        for k in range(d):
            first = k * _stages()
            q, p = load_real(rows, start + k), load_real(rows, start + d + k)
            q_low = load_real(rows, running + d + k)
            if timed and k == d - 1:
                q, q_low = compensated(q, q_low, h, 1.0)
            else:
                q, q_low = add(q, q_low, 1.0, _sum_of_stages(load_stages(rows, places + first)))
            increments = kicks * load_stages(rows, at + first)
            p, p_low = add(p, load_real(rows, running + 3 * d + k), 1.0, _sum_of_stages(increments))
            store_state(rows, running + k, q, q_low, p, p_low)

    return positions, ended


def _solver(positions: Any) -> Any:
    """``solve(rows, h, at, places, start)``: the number of iterations, and False if they failed."""
    going, missed = continuing(extended=False), missing(extended=False)

    def solve(rows, h, at, places, start):
        d, s = _dimension(), _stages()
        nothing = zero_like(h)
        size, before, change, failed, active, made = nothing, nothing, nothing, nothing, nothing + 1.0, 0
        for i in range(d * s):
            size = larger(absolute(load_real(rows, at + i)), size)
        least, vain, scale = nothing + inf, nothing, size
        while not all_zero(active) and made < MOST_ITERATIONS:
            positions(rows, h, at, places, start)
            latest = nothing
            for j in range(s):
                _from_stage(rows, places, j, _running())
                _force(rows)
                for k in range(d):
                    f = load_real(rows, _force_at() + k)
                    latest = larger(absolute(f - load_real(rows, at + k * s + j)), latest)
                    if made == 0:
                        scale = larger(absolute(f), scale)
                    store(rows, at + k * s + j, f)
            least, vain = counted(least, vain, latest)
            active = going(active, size, before, change, latest, made, vain)
            failed = missed(active, scale, before, change, latest, made)
            made, before, change = made + 1, change, latest
        return made, all_zero(failed)

    return solve


def _motion_in_memory(form: Form) -> Motion:
    """As :func:`motion`, for states in memory."""
    positions, ended = _of_unit_masses(form) if form.unit_masses else _of_masses(form)
    solve = _solver(positions)

    def move(rows, row, f, parameters):
        d, running, places, counters = _dimension(), _running(), _scratch(), _counters()
        at, start = running + 5 * d, places + d * _stages()
        _first_guess(rows, at)
        _copy(rows, running, start)
        _copy(rows, running + 2 * d, start + d)
        made, is_solved = solve(rows, row[0], at, places, start)
        ended(rows, row[0], at, places, start)
        rows[counters + READY] = 1.0
        rows[counters + ITERATIONS] += made
        if not is_solved:
            rows[counters + FAILED] += 1.0
            rows[running] = nan
        return rows

    def closed(rows, row, f, parameters):
        for part in range(4):
            _copy(rows, _running() + part * _dimension(), part * _dimension())
        return rows

    return Motion(load_rows, _first, move, _behind, _last, closed, save_rows)
