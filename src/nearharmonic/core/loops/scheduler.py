"""Scheduler: feeds a queue of runs to the SIMD lanes of a kernel; an idle lane takes the next run.

The scheduler is compiled once for all kernels and calls them by address. Rows of lanes are described in
:mod:`nearharmonic.core.loops.kernel`.
"""

from __future__ import annotations

from math import inf, isnan

from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    ENERGY,
    ENERGY_LOW,
    FAR,
    LATEST,
    LIMIT,
    MERGED,
    NEVER,
    PROGRESS,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
)
from nearharmonic.core.machine.reals import at_address, compiled

#: An energy below this fraction of the kinetic energy is 0 within the rounding of double-doubles.
NEGLIGIBLE = 2.0**-98
#: States of a lane without a run: it takes the next run; the queue is empty.
FREE, IDLE = -1, -2

advance_at, begin_at = at_address(ADVANCE), at_address(BEGIN)


@compiled
def begin_tally(rows, fresh, lane, width, size, limit, scale, reference):  # type: ignore[no-untyped-def]
    """Start the tally of a lane with that of ``fresh``, and make its limit absolute.

    The given limit is relative to |H0|, to |T| if H0 = 0, or to ``scale`` if that is not 0.
    """
    at = size * width + lane
    for entry in range(TALLY):
        rows[at + entry * width] = fresh[at + entry * width]
    high, low, kinetic = rows[at + ENERGY * width], rows[at + ENERGY_LOW * width], rows[at + LIMIT * width]
    if kinetic * NEGLIGIBLE >= abs(high):
        high = low = 0.0
    if not isnan(reference[0]):
        rows[at + LATEST * width] = (high - reference[0]) + (low - reference[1])
        high, low = reference[0], reference[1]
    rows[at + ENERGY * width], rows[at + ENERGY_LOW * width] = high, low
    unit = scale if scale != 0 else abs(high) if high != 0 else kinetic
    rows[at + LIMIT * width] = limit * unit if unit != 0 else inf


@compiled
def latest_error(rows, lane, width, size, measured):  # type: ignore[no-untyped-def]
    """|H - H0| of a lane; if no energy is measured, 0, or NaN for a state that is not finite."""
    if measured != NEVER:
        return abs(rows[(size + LATEST) * width + lane])
    found = 0.0
    for k in range(size):
        found += rows[k * width + lane] * 0.0
    return found


@compiled
def measure_alone(rows, lane, width, size, latest):  # type: ignore[no-untyped-def]
    """Set the tally to the latest error, if the energy is measured only at the samples."""
    at = size * width + lane
    rows[at + WORST * width] = rows[at + TOTAL * width] = latest
    rows[at + TOTAL_CARRY * width] = 0.0


@compiled
def record_errors(rows, lane, width, size, at, latest, energy_error, worst, total):  # type: ignore[no-untyped-def]
    """Record the errors of the block of steps since the last sample, and start a new block."""
    first = size * width + lane
    energy_error[at] = latest
    worst[at] = rows[first + WORST * width]
    total[at] = rows[first + TOTAL * width] + rows[first + TOTAL_CARRY * width]
    rows[first + WORST * width] = rows[first + TOTAL * width] = rows[first + TOTAL_CARRY * width] = 0.0


@compiled
def _record(rows, lane, width, size, at, states, energy_error, worst, total):  # type: ignore[no-untyped-def]
    for k in range(size):
        states[at * size + k] = rows[k * width + lane]
    latest = rows[(size + LATEST) * width + lane]
    record_errors(rows, lane, width, size, at, latest, energy_error, worst, total)


@compiled
def _place(rows, lane, shape, start, r, parameters, row):  # type: ignore[no-untyped-def]
    """Load the state and the parameters of a run into a lane."""
    width, size, running_rows, first, parameter_columns = shape
    for k in range(running_rows):
        rows[(first + k) * width + lane] = 0.0
    for k in range(size):
        rows[k * width + lane] = rows[(first + k) * width + lane] = start[r * size + k]
    for entry in range(TALLY):
        rows[(size + entry) * width + lane] = 0.0
    rows[(size + LIMIT) * width + lane] = inf
    for k in range(parameter_columns):
        rows[(size + TALLY + k) * width + lane] = parameters[row * parameter_columns + k]


@compiled
def _resume(rows, lanes, lane, shape, resumed, r, merged, columns):  # type: ignore[no-untyped-def]
    """Load the running state of a continued run into a lane, with the coefficients of a merged first move."""
    width, _, running_rows, first, _ = shape
    for k in range(running_rows):
        rows[(first + k) * width + lane] = resumed[r * running_rows + k]
    for column in range(columns):
        lanes[column * width + lane] = lanes[(merged * columns + column) * width + lane]


@compiled
def _steps_to_next_sample(runs, at, mark, width, marks, samples):  # type: ignore[no-untyped-def]
    """Return the smallest number of steps of a lane to its next sample; :data:`FAR` if all lanes are idle."""
    count = FAR
    for lane in range(width):
        if runs[lane] >= 0:
            count = min(count, marks[runs[lane] * samples + mark[lane]] - at[lane])
    return count


def run(  # type: ignore[no-untyped-def]  # noqa: PLR0912 (what a lane goes through, in order)
    advance, begin, measured, order, queued, marks, samples, scheme, start, size, resumed, resumptions, parameters,
    parameter_sets, parameter_columns, limit, scale, reference, stretch, stages, kick_first, moves, move_rows, columns,
    control, states, energy_error, worst, total, energy, running, running_rows, left_at, rows, numbers, fresh, lanes,
    coefficient_count, runs, width, at, mark,
):  # fmt: skip
    """The function of :data:`nearharmonic.core.layout.RUN`, to be compiled.

    An idle lane stays at a regular point, the start of the first run: a NaN in it would stop the other lanes. A run has
    diverged when its energy error exceeds its limit; if no energy is measured, when its state is not finite.
    """
    taken, per_run, first = 0, move_rows * columns, size + TALLY + max(1, parameter_columns)
    shape = width, size, running_rows, first, parameter_columns
    for lane in range(width):
        runs[lane] = FREE
    while control[STOP] == 0:
        before = taken
        for lane in range(width):
            if runs[lane] == FREE:
                idle = taken == queued
                r = order[0] if idle else order[taken]
                taken += not idle
                runs[lane], at[lane], mark[lane] = IDLE if idle else r, 0, 0
                _place(rows, lane, shape, start, r, parameters, min(r, parameter_sets - 1))
                for i in range(per_run):
                    lanes[i * width + lane] = 0.0 if idle else moves[scheme[r] * per_run + i]
                if resumptions > 0 and not idle:
                    _resume(rows, lanes, lane, shape, resumed, r, MERGED, columns)
        if taken > before and measured != NEVER:
            for i in range(numbers):
                fresh[i] = rows[i]
            begin_at(begin, fresh, numbers)
        for lane in range(width):
            r = runs[lane]
            if r >= 0 and mark[lane] == 0:
                if measured != NEVER:
                    begin_tally(rows, fresh, lane, width, size, limit, scale, reference)
                energy[2 * r] = rows[(size + ENERGY) * width + lane]
                energy[2 * r + 1] = rows[(size + ENERGY_LOW) * width + lane]
                _record(rows, lane, width, size, r * samples, states, energy_error, worst, total)
                mark[lane] = 1
        count = _steps_to_next_sample(runs, at, mark, width, marks, samples)
        if count == FAR:
            break
        done = advance_at(advance, min(count, stretch), stages, kick_first, lanes, coefficient_count, rows, numbers)
        for lane in range(width):
            r = runs[lane]
            if r < 0:
                continue
            at[lane] += done
            control[PROGRESS] += done
            sample, over = r * samples + mark[lane], False
            due = at[lane] >= marks[sample]
            # An energy that is measured only at the samples must not depend on the sample times of other lanes.
            if due or measured < SAMPLES:
                latest = latest_error(rows, lane, width, size, measured)
                if not latest <= rows[(size + LIMIT) * width + lane]:
                    left_at[r], over = at[lane], True
                if measured == SAMPLES:
                    measure_alone(rows, lane, width, size, latest)
            if due and not over:
                _record(rows, lane, width, size, sample, states, energy_error, worst, total)
                mark[lane] += 1
                over = mark[lane] == samples or marks[sample + 1] < 0
            if over:
                runs[lane] = FREE
                for k in range(running_rows):
                    running[r * running_rows + k] = rows[(first + k) * width + lane]
