"""Steps of a collocation method for states of many coordinates in memory.

For each coordinate, its numbers at all stages are neighbours, and products with the matrices of the method are those of
:mod:`nearharmonic.core.collocation.formulas` for one coordinate. Forces and velocities are evaluated for one stage
after the other, at the running state (:mod:`nearharmonic.core.large.state`).
"""

from __future__ import annotations

from math import inf, nan
from typing import Any

from nearharmonic.core.arithmetic import fma
from nearharmonic.core.collocation.motion import MOST_ITERATIONS, continuing, counted, missing
from nearharmonic.core.large.state import load_rows, save_rows
from nearharmonic.core.layout import FAILED, ITERATIONS, READY, Form, Motion
from nearharmonic.core.machine.reals import (
    REAL,
    STAGES,
    absolute,
    all_zero,
    compiled,
    larger,
    linked,
    linked_number,
    load_real,
    load_stages,
    store,
    types,
    zero_like,
)
from nearharmonic.core.step import compensated, plain

_dimension, _running, _counters, _force_at, _velocity_at, _scratch, _stages = map(
    linked_number, ("dimension", "running", "counters", "force_at", "velocity_at", "scratch", "stages")
)
_force, _velocities = linked("force", types.void), linked("velocities", types.void)
_weights, _times_nodes, _times_rest = (linked(name, STAGES) for name in ("weights", "times_nodes", "times_rest"))
_by_position, _by_momentum, _by_guess = (linked(f"by_{name}", STAGES) for name in ("position", "momentum", "guess"))
_summed = linked("summed", REAL)


@compiled
def _copy(rows, source, to):  # type: ignore[no-untyped-def]
    for k in range(_dimension()):
        rows[to + k] = rows[source + k]


@compiled
def _from_stage(rows, stages, j, to):  # type: ignore[no-untyped-def]
    """Copy the numbers of one stage of all coordinates to the rows from ``to`` on."""
    for k in range(_dimension()):
        rows[to + k] = rows[stages + k * _stages() + j]


@compiled
def _to_stage(rows, source, stages, j):  # type: ignore[no-untyped-def]
    for k in range(_dimension()):
        rows[stages + k * _stages() + j] = rows[source + k]


@compiled
def _put(rows, k, q, q_low, p, p_low):  # type: ignore[no-untyped-def]
    at, d = _running() + k, _dimension()
    store(rows, at, q)
    store(rows, at + d, q_low)
    store(rows, at + 2 * d, p)
    store(rows, at + 3 * d, p_low)


@compiled
def _first_guess(rows, at):  # type: ignore[no-untyped-def]
    """Replace the forces of the last step by a guess of those of the next one; they begin at row ``at``."""
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

    @compiled
    def positions(rows, h, at, places, start):  # type: ignore[no-untyped-def]
        weights = _weights(-h)
        for k in range(_dimension()):
            first = k * _stages()
            increments = weights * load_stages(rows, at + first)
            drift = _times_nodes(load_real(rows, start + _dimension() + k) + zero_like(increments))
            store(rows, places + first, fma(h, drift + _by_position(increments), load_real(rows, start + k)))

    @compiled
    def ended(rows, h, at, places, start):  # type: ignore[no-untyped-def]
        d, running, weights = _dimension(), _running(), _weights(-h)
        for k in range(d):
            increments = weights * load_stages(rows, at + k * _stages())
            q, p = load_real(rows, start + k), load_real(rows, start + d + k)
            drift = p + _summed(_times_rest(increments))
            q, q_low = add(q, load_real(rows, running + d + k), h, drift)
            p, p_low = add(p, load_real(rows, running + 3 * d + k), 1.0, _summed(increments))
            _put(rows, k, q, q_low, p, p_low)

    return positions, ended


def _of_masses(form: Form) -> tuple[Any, Any]:
    """``positions`` and ``ended`` as above, for velocities that depend on all momenta."""
    add, timed = compensated if form.compensated else plain, form.timed

    @compiled
    def drifts(rows, h, at, places, start):  # type: ignore[no-untyped-def]
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

    @compiled
    def positions(rows, h, at, places, start):  # type: ignore[no-untyped-def]
        drifts(rows, h, at, places, start)
        for k in range(_dimension()):
            first = places + k * _stages()
            store(rows, first, _by_momentum(load_stages(rows, first)) + load_real(rows, start + k))

    @compiled
    def ended(rows, h, at, places, start):  # type: ignore[no-untyped-def]
        d, running, kicks = _dimension(), _running(), _weights(-h)
        drifts(rows, h, at, places, start)
        for k in range(d):
            first = k * _stages()
            q, p = load_real(rows, start + k), load_real(rows, start + d + k)
            q_low = load_real(rows, running + d + k)
            if timed and k == d - 1:
                q, q_low = compensated(q, q_low, h, 1.0)
            else:
                q, q_low = add(q, q_low, 1.0, _summed(load_stages(rows, places + first)))
            increments = kicks * load_stages(rows, at + first)
            p, p_low = add(p, load_real(rows, running + 3 * d + k), 1.0, _summed(increments))
            _put(rows, k, q, q_low, p, p_low)

    return positions, ended


def _solver(positions: Any) -> Any:
    """``solve(rows, h, at, places, start)``: the number of iterations, and False if they failed."""
    going, missed = continuing(extended=False), missing(extended=False)

    @compiled
    def solve(rows, h, at, places, start):  # type: ignore[no-untyped-def]
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


def motion(form: Form) -> Motion:
    """Return the functions that the loops call."""
    positions, ended = _of_unit_masses(form) if form.unit_masses else _of_masses(form)
    solve = _solver(positions)

    @compiled
    def move(rows, row, f, parameters):  # type: ignore[no-untyped-def]
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

    @compiled
    def first(rows, moves, parameters):  # type: ignore[no-untyped-def]
        return 0

    @compiled
    def behind(rows, moves, row, parameters):  # type: ignore[no-untyped-def]
        return 0

    @compiled
    def last(rows, moves, row, parameters):  # type: ignore[no-untyped-def]
        return 0, zero_like(load_real(rows, 0))

    @compiled
    def closed(rows, row, f, parameters):  # type: ignore[no-untyped-def]
        for part in range(4):
            _copy(rows, _running() + part * _dimension(), part * _dimension())
        return rows

    return Motion(load_rows, first, move, behind, last, closed, save_rows)
