"""Compiled text of a queue of runs through the lanes of a kernel: a lane that is done takes the next run.

One compilation serves all kernels, which are called by address. The text uses loops over flat arrays only, which the
caller allocates: slices, reshapes and allocations would pull numba's array library into the compilation and treble its
time. ``width`` lanes, states of ``size`` doubles.
"""

from __future__ import annotations

import numpy as np

from nearharmonic.core.compile import call_at, strict
from nearharmonic.core.layout import (
    ADVANCE,
    BEGIN,
    ENERGY,
    ENERGY_LOW,
    FAR,
    LATEST,
    LIMIT,
    NEVER,
    PROGRESS,
    SAMPLES,
    STOP,
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
)

#: An energy below this part of the kinetic energy is 0 to the rounding of double-doubles.
NEGLIGIBLE = 2.0**-98

_advance, _begin = call_at(ADVANCE), call_at(BEGIN)


@strict
def _fill(rows, drifts, kicks, lane, width, size, start, parameters, drift, kick):  # type: ignore[no-untyped-def]
    """The lane takes up the state ``start``, the parameters and the coefficients of its run."""
    _place(rows, lane, width, size, start, parameters)
    for i in range(drift.shape[0]):
        for part in range(drift.shape[1]):
            place = (i * drift.shape[1] + part) * width + lane
            drifts[place], kicks[place] = drift[i, part], kick[i, part]


@strict
def _place(rows, lane, width, size, start, parameters):  # type: ignore[no-untyped-def]
    for k in range(size):
        rows[k * width + lane] = start[k]
    for k in range(size, size + TALLY):
        rows[k * width + lane] = 0.0
    for k in range(parameters.size):
        rows[(size + TALLY + k) * width + lane] = parameters[k]
    rows[(size + LIMIT) * width + lane] = np.inf


@strict
def _idle(rows, drifts, kicks, lane, width, size, start, parameters):  # type: ignore[no-untyped-def]
    """The lane stands still at ``start``, a regular point: a NaN in an idle lane would stop the others."""
    _place(rows, lane, width, size, start, parameters)
    for place in range(lane, drifts.size, width):
        drifts[place] = kicks[place] = 0.0


@strict
def _record(rows, lane, width, size, sample, states, energy_error, worst, total):  # type: ignore[no-untyped-def]
    """One sample of the lane, and what its block of steps since the last sample came to."""
    for k in range(size):
        states[sample, k] = rows[k * width + lane]
    tally = size * width + lane
    energy_error[sample] = rows[tally + LATEST * width]
    worst[sample] = rows[tally + WORST * width]
    total[sample] = rows[tally + TOTAL * width] + rows[tally + TOTAL_CARRY * width]
    rows[tally + WORST * width] = rows[tally + TOTAL * width] = rows[tally + TOTAL_CARRY * width] = 0.0


@strict
def _refill(  # type: ignore[no-untyped-def]
    order, queued, scheme, start, parameters, drift, kick, rows, drifts, kicks, runs, at, mark, width, size
):
    """Lanes without a run take the next ones of the queue; how many have left the queue by then."""
    for lane in range(width):
        if runs[lane] < 0 and queued < order.size:
            r = order[queued]
            queued += 1
            runs[lane], at[lane], mark[lane] = r, 0, 0
            given = parameters[min(r, parameters.shape[0] - 1)]
            _fill(rows, drifts, kicks, lane, width, size, start[r], given, drift[scheme[r]], kick[scheme[r]])
    return queued


@strict
def _allow(rows, lane, width, size, limit, scale, reference):  # type: ignore[no-untyped-def]
    """Make the limit of the lane absolute: relative to |H0|, to |T| if H0 = 0, or to ``scale`` if that is not 0."""
    tally = size * width + lane
    if reference[0] == reference[0]:
        rows[tally + LATEST * width] = (rows[tally + ENERGY * width] - reference[0]) + (
            rows[tally + ENERGY_LOW * width] - reference[1]
        )
        rows[tally + ENERGY * width], rows[tally + ENERGY_LOW * width] = reference[0], reference[1]
    kinetic, H = rows[tally + LIMIT * width], abs(rows[tally + ENERGY * width])
    if NEGLIGIBLE * kinetic >= H:
        rows[tally + ENERGY * width] = rows[tally + ENERGY_LOW * width] = H = 0.0
    unit = scale if scale != 0 else H if H != 0 else kinetic
    rows[tally + LIMIT * width] = limit * unit if unit != 0 else np.inf


@strict
def _record_starts(  # type: ignore[no-untyped-def]
    measured, fresh, rows, runs, mark, width, size, limit, scale, reference, states, energy_error, worst, total, energy
):
    """The first sample of each run that has none yet, whose lane of ``fresh`` has its energy as H0."""
    for lane in range(width):
        r = runs[lane]
        if r >= 0 and mark[lane] == 0:
            if measured != NEVER:
                for place in range(size * width + lane, (size + TALLY) * width, width):
                    rows[place] = fresh[place]
                _allow(rows, lane, width, size, limit, scale, reference)
            energy[r, 0] = rows[(size + ENERGY) * width + lane]
            energy[r, 1] = rows[(size + ENERGY_LOW) * width + lane]
            _record(rows, lane, width, size, mark[lane], states[r], energy_error[r], worst[r], total[r])
            mark[lane] = 1


@strict
def _next_stretch(marks, runs, at, mark, width):  # type: ignore[no-untyped-def]
    """Steps to the next sample of any lane; ``FAR`` if all lanes are idle."""
    count = FAR
    for lane in range(width):
        if runs[lane] >= 0:
            count = min(count, marks[runs[lane], mark[lane]] - at[lane])
    return count


@strict
def _left(rows, lane, width, size, measured):  # type: ignore[no-untyped-def]
    """Whether the energy of the lane is beyond its limit; where none is measured, whether its state is not finite."""
    if measured == NEVER:
        zero = 0.0
        for k in range(size):
            zero += 0.0 * rows[k * width + lane]  # NaN for what is not finite
        return zero != 0.0
    return not abs(rows[(size + LATEST) * width + lane]) <= rows[(size + LIMIT) * width + lane]


@strict
def _settle(  # type: ignore[no-untyped-def]
    measured, lane, marks, rows, at, mark, r, width, size, states, energy_error, worst, total, left_at
):
    """Record the sample of run ``r`` if one is due, or that the run has left; whether the run is finished."""
    m, tally = mark[lane], size * width + lane
    due = at[lane] >= marks[r, m]
    # What is measured at the samples alone must not depend on when the neighbours of a lane are sampled.
    if (due or measured < SAMPLES) and _left(rows, lane, width, size, measured):
        left_at[r] = at[lane]
        return True
    if not due:
        return False
    if measured == SAMPLES:
        rows[tally + WORST * width] = rows[tally + TOTAL * width] = abs(rows[tally + LATEST * width])
        rows[tally + TOTAL_CARRY * width] = 0.0
    _record(rows, lane, width, size, m, states[r], energy_error[r], worst[r], total[r])
    mark[lane] = m + 1
    return m + 1 == marks.shape[1] or marks[r, m + 1] < 0


@strict
def run(  # type: ignore[no-untyped-def]
    advance, begin, measured,
    order, marks, scheme, start, parameters, limit, scale, reference, stretch, stages, kick_first, drift, kick, control,
    states, energy_error, worst, total, energy, left_at,
    rows, fresh, drifts, kicks, runs, at, mark,
):  # fmt: skip
    """All runs of the queue ``order``; the arguments are those of :data:`nearharmonic.core.layout.RUN`."""
    width, size, rest = runs.size, start.shape[1], start[order[0]]
    usual = parameters[min(order[0], parameters.shape[0] - 1)]
    queued = np.int64(0)  # numba would compile what takes it twice: for the literal, and for an integer
    for lane in range(width):
        runs[lane] = -1
        _idle(rows, drifts, kicks, lane, width, size, rest, usual)
    while control[STOP] == 0:
        before = queued
        queued = _refill(
            order, queued, scheme, start, parameters, drift, kick, rows, drifts, kicks, runs, at, mark, width, size
        )
        if queued > before:
            if measured != NEVER:
                for place in range(rows.size):
                    fresh[place] = rows[place]
                _begin(begin, (fresh,))
            _record_starts(
                measured, fresh, rows, runs, mark, width, size, limit, scale, reference,
                states, energy_error, worst, total, energy,
            )  # fmt: skip
        count = _next_stretch(marks, runs, at, mark, width)
        if count == FAR:
            return
        done = _advance(advance, (min(count, stretch), stages, kick_first, drifts, kicks, rows))
        for lane in range(width):
            r = runs[lane]
            if r < 0:
                continue
            at[lane] += done
            control[PROGRESS] += done
            if _settle(
                measured, lane, marks, rows, at, mark, r, width, size, states, energy_error, worst, total, left_at
            ):
                runs[lane] = -1
                _idle(rows, drifts, kicks, lane, width, size, rest, usual)
