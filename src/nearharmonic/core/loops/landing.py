"""Sequential runs in a fictitious time, with samples at given physical times.

A regularised system (:mod:`nearharmonic.systems.formulas`) is integrated in equal steps of a fictitious
time s. A sample at the time t is the end of one shorter step from the last state before t. Newton's method finds the
length of this step from dt/ds = r. The run itself does not take this step, except for the last sample.

States at the start and at samples are physical positions and momenta, mapped in double-double. The step in s is the
physical step size over the semi-major axis of the start, so that an orbit takes as many steps as in physical time.
There is one lane, so that a row is a number. The last row of ``moves`` is the step size.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

from nearharmonic.core.arithmetic import dd_add_double, dd_mul, fma
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    COLUMNS,
    COUNTERS,
    ENERGY,
    ENERGY_LOW,
    LATEST,
    LIMIT,
    NEVER,
    PROGRESS,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    WORST,
)
from nearharmonic.core.loops.scheduler import begin_tally, latest_error, measure_alone, record_errors
from nearharmonic.core.machine.reals import at_address, compiled, linked, linked_number, types

#: Largest number of Newton iterations. Four suffice in double, six in double-double; they end when no iteration comes
#: nearer.
MOST_REPEATS = 12
#: Fraction of the way to a sample that is advanced at once: a perturbed orbit may have a farther apoapsis than the
#: start's.
SAFETY = 0.98
#: Number of steps over which time grows, unless a method with negative coefficients is far beyond its stability limit.
ADVANCING = 8
#: Doubles in a row of coefficients: pairs of the kick, the drift and their product, for a step of scale 1.
PIECES = 6
#: A number of steps that no call makes.
MANY = 2.0**52

_advance_at, _begin_at = at_address(ADVANCE), at_address(BEGIN)
#: Number of coordinates of the regularised system, the first row of its running state, and that of its counters.
_dimension, _running, _counters = map(linked_number, ("dimension", "running", "counters"))
#: ``_departed(start, first, rows, to)`` computes the state x, y of a physical start, the scale of its steps as a pair,
#: and the largest |dt/ds| times a step of scale 1. ``_physical(state, to, first)``: the physical state.
_departed, _physical = linked("departed", types.void), linked("physical", types.void)


@compiled
def _copy(source, to, count):  # type: ignore[no-untyped-def]
    for k in range(count):
        to[k] = source[k]


@compiled
def _gap(rows, target):  # type: ignore[no-untyped-def]
    """The time from a state to a target, divided by 4: the last momentum of a state is -t/4."""
    D = _dimension()
    return (rows[3 * D - 1] + target[0]) + (rows[4 * D - 1] + target[1])


@compiled
def _radius(rows):  # type: ignore[no-untyped-def]
    """|u|^2."""
    total = rows[0] * rows[0]
    for k in range(1, _dimension() - 1):
        total = fma(rows[k], rows[k], total)
    return total


def _coefficients(*, extended: bool) -> Any:
    """``coefficients(lanes, moves, first, rows, scale)``: those of a step ``scale`` times as long."""

    @compiled
    def coefficients(lanes, moves, first, rows, scale):  # type: ignore[no-untyped-def]
        square = dd_mul(scale, scale)
        for i in range(rows):
            at, to = first + PIECES * i, COLUMNS * i
            kick, drift = dd_mul((moves[at], moves[at + 1]), scale), dd_mul((moves[at + 2], moves[at + 3]), scale)
            product = dd_mul((moves[at + 4], moves[at + 5]), square)[0]
            lanes[to], lanes[to + 1] = kick[0], kick[1] if extended else drift[0]
            lanes[to + 2] = drift[0] if extended else product
            lanes[to + 3] = drift[1] if extended else fma(kick[0], drift[0], -product)

    return coefficients


@compiled
def _set_out(start, first, parameters, row, count, rows, numbers, trial, keep):  # type: ignore[no-untyped-def]
    """Fill the rows at the start of a run; return the scale of its steps, and the largest |dt/ds| times the step."""
    D, running = _dimension(), _running()
    for k in range(numbers):
        rows[k] = 0.0
    rows[4 * D + LIMIT] = inf
    for k in range(count):
        rows[4 * D + TALLY + k] = parameters[row + k]
    _departed(start, first, rows, trial)
    for k in range(4 * D):
        rows[k] = rows[running + k] = trial[k] * (keep if k // D % 2 else 1.0)
    return (trial[4 * D], trial[4 * D + 1]), trial[4 * D + 2]


@compiled
def _steps(advance, count, form, lanes, rows):  # type: ignore[no-untyped-def]
    stages, kick_first, coefficients, numbers = form
    return _advance_at(advance, count, stages, kick_first, lanes, coefficients, rows, numbers)


@compiled
def _approach(advance, form, target, tau, reach, look, control, rows, lanes, trial, trial_lanes):  # type: ignore[no-untyped-def]
    """Make all steps before a target; return their number, that with trial steps, and if the run diverged."""
    stretch, measured = look
    limited = measured < SAMPLES or measured == NEVER
    at, made, size = 0, 0, 4 * _dimension()
    direction = -1.0 if tau < 0 else 1.0
    while control[STOP] == 0:
        gap = direction * _gap(rows, target)
        if not gap > 0:
            break
        ahead = gap / (abs(tau) * 0.25 * reach) * SAFETY
        steps = int(ahead if ahead < MANY else MANY)
        if steps > 0:
            moved = _steps(advance, min(steps, stretch), form, lanes, rows)
            made += moved
        else:  # one step, unless it passes the target; a NaN does not pass it, and the run has diverged
            _copy(rows, trial, form[3])
            _copy(lanes, trial_lanes, form[2])
            made += _steps(advance, 1, form, trial_lanes, trial)
            if direction * _gap(trial, target) < 0:
                break
            _copy(trial, rows, form[3])
            _copy(trial_lanes, lanes, form[2])
            moved = 1
        at += moved
        control[PROGRESS] += moved
        left = limited and not latest_error(rows, 0, 1, size, measured) <= rows[size + LIMIT]
        # A run that does not approach the target never reaches it.
        if left or (moved >= ADVANCING and not direction * _gap(rows, target) < gap):
            return at, made, True
    return at, made, False


@compiled
def _conclude(ends, first, count, state, at, made, rows):  # type: ignore[no-untyped-def]
    """Record the steps of a run, and the counters of an implicit method, which follow a state of so many rows."""
    ends[first], ends[first + 1] = at, made
    if count > state:
        for k in range(COUNTERS):
            ends[first + count - COUNTERS + k] = rows[_counters() + k]


def _landing(coefficients: Any) -> Any:
    """``land(...)``: one step from ``rows`` to the target, into ``trial``; return the number of trial steps."""

    @compiled
    def land(look, form, moves, first, count, scale, target, rows, trial, lanes):  # type: ignore[no-untyped-def]
        D, running = _dimension(), _running()
        unit = moves[first + PIECES * count] * 0.25 * scale[0]
        part = (_gap(rows, target) / (unit * _radius(rows)), 0.0)
        before, repeats = inf, 0
        while True:
            _copy(rows, trial, form[3])
            for k in range(5 * D):
                trial[running + k] = trial[k] if k < 4 * D else 0.0
            coefficients(lanes, moves, first, count, dd_mul(scale, part))
            _steps(look, 1, form, lanes, trial)
            gap = _gap(trial, target)
            repeats += 1
            if repeats >= MOST_REPEATS or not abs(gap) < before or gap == 0:
                return repeats
            before = abs(gap)
            part = dd_add_double(part, gap / (unit * _radius(trial)))

    return land


def land(*, extended: bool, compensated: bool) -> Callable[..., None]:
    """Return the function of :data:`nearharmonic.core.layout.LAND`, to be compiled.

    :func:`nearharmonic.core.formulas.emission.maps_module` writes the functions of the regularised system.
    """
    coefficients, keep = _coefficients(extended=extended), 1.0 if compensated else 0.0
    land_on = _landing(coefficients)

    def land(  # type: ignore[no-untyped-def]
        advance, look, begin, measured, order, queued, marks, samples, scheme, start, size, parameters, parameter_sets,
        parameter_columns, limit, scale, reference, stretch, stages, kick_first, moves, move_rows, columns, control,
        states, energy_error, worst, total, energy, ends, running_rows, left_at, rows, numbers, lanes,
        coefficient_count, trial, trial_lanes,
    ):  # fmt: skip
        d, count, tally = size // 4, move_rows - 1, 4 * _dimension()
        form = stages, kick_first, coefficient_count, numbers
        for i in range(queued):
            if control[STOP] != 0:
                break
            r, at, made = order[i], 0, 0
            first = scheme[r] * move_rows * columns
            tau, tau_low = moves[first + count * columns], moves[first + count * columns + 1]
            row = min(r, parameter_sets - 1) * parameter_columns
            step, reach = _set_out(start, r * size, parameters, row, parameter_columns, rows, numbers, trial, keep)
            coefficients(lanes, moves, first, count, step)
            if measured != NEVER:
                _begin_at(begin, rows, numbers)
                begin_tally(rows, rows, 0, 1, tally, limit, scale, reference)
            energy[2 * r], energy[2 * r + 1] = rows[tally + ENERGY], rows[tally + ENERGY_LOW]
            for sample in range(r * samples, (r + 1) * samples):
                if marks[sample] < 0:
                    break
                target = dd_mul((tau * 0.25, tau_low * 0.25), (float(marks[sample]), 0.0))
                more, tried, left = _approach(
                    advance, form, target, tau, reach, (stretch, measured), control, rows, lanes, trial, trial_lanes
                )
                at, made = at + more, made + tried
                if left:
                    left_at[r] = at
                    break
                last = sample + 1 == (r + 1) * samples or marks[sample + 1] < 0
                _copy(rows, trial, numbers)
                lands = _gap(rows, target) < 0 if tau < 0 else _gap(rows, target) > 0
                if lands:
                    made += land_on(look, form, moves, first, count, step, target, rows, trial, trial_lanes)
                latest = abs(trial[tally + LATEST])
                if lands and last:
                    at += 1
                    if measured != NEVER:
                        rows[tally + WORST] = latest if latest > rows[tally + WORST] else rows[tally + WORST]
                        rows[tally + TOTAL] += latest
                if measured == SAMPLES:
                    measure_alone(rows, 0, 1, tally, latest)
                if measured != NEVER and not latest <= trial[tally + LIMIT]:
                    left_at[r] = at if last else at + 1
                    break
                _physical(trial, states, sample * size)
                for k in range(d):
                    states[sample * size + d + k] *= keep
                    states[sample * size + 3 * d + k] *= keep
                record_errors(rows, 0, 1, tally, sample, trial[tally + LATEST], energy_error, worst, total)
            _conclude(ends, r * running_rows, running_rows, 5 * d, at, made, rows)

    return land
