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
    TALLY,
    TOTAL,
    TOTAL_CARRY,
    WORST,
)

_advance, _begin = call_at(ADVANCE), call_at(BEGIN)


@strict
def _fill(rows, drifts, kicks, lane, width, size, start, drift, kick, limit):  # type: ignore[no-untyped-def]
    """The lane takes up the state ``start`` and the coefficients of its run."""
    for k in range(size):
        rows[k * width + lane] = start[k]
    for k in range(size, size + TALLY):
        rows[k * width + lane] = 0.0
    rows[(size + LIMIT) * width + lane] = limit
    for i in range(drift.shape[0]):
        for part in range(drift.shape[1]):
            place = (i * drift.shape[1] + part) * width + lane
            drifts[place], kicks[place] = drift[i, part], kick[i, part]


@strict
def _idle(rows, drifts, kicks, lane, width, size, start):  # type: ignore[no-untyped-def]
    """The lane stands still at ``start``, a regular point: a NaN in an idle lane would stop the others."""
    for k in range(size):
        rows[k * width + lane] = start[k]
    for k in range(size, size + TALLY):
        rows[k * width + lane] = 0.0
    rows[(size + LIMIT) * width + lane] = np.inf
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
    order, queued, scheme, start, limit, drift, kick, rows, drifts, kicks, runs, at, mark, width, size
):
    """Lanes without a run take the next ones of the queue; how many have left the queue by then."""
    for lane in range(width):
        if runs[lane] < 0 and queued < order.size:
            r = order[queued]
            queued += 1
            runs[lane], at[lane], mark[lane] = r, 0, 0
            _fill(rows, drifts, kicks, lane, width, size, start[r], drift[scheme[r]], kick[scheme[r]], limit)
    return queued


@strict
def _record_starts(  # type: ignore[no-untyped-def]
    fresh, rows, runs, mark, width, size, states, energy_error, worst, total, energy
):
    """The first sample of each run that has none yet, whose lane of ``fresh`` has its energy as H0."""
    for lane in range(width):
        r = runs[lane]
        if r >= 0 and mark[lane] == 0:
            for place in range(size * width + lane, rows.size, width):
                rows[place] = fresh[place]
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
def _settle(  # type: ignore[no-untyped-def]
    lane, marks, rows, at, mark, r, width, size, states, energy_error, worst, total, left_at
):
    """Record the sample of run ``r`` if one is due, or that the run has left; whether the run is finished."""
    m = mark[lane]
    if not abs(rows[(size + LATEST) * width + lane]) <= rows[(size + LIMIT) * width + lane]:
        left_at[r] = at[lane]
        return True
    if at[lane] < marks[r, m]:
        return False
    _record(rows, lane, width, size, m, states[r], energy_error[r], worst[r], total[r])
    mark[lane] = m + 1
    return m + 1 == marks.shape[1] or marks[r, m + 1] < 0


@strict
def run(  # type: ignore[no-untyped-def]
    advance, begin,
    order, marks, scheme, start, limit, look, stages, kick_first, drift, kick,
    states, energy_error, worst, total, energy, left_at,
    rows, fresh, drifts, kicks, runs, at, mark,
):  # fmt: skip
    """All runs of the queue ``order``; the arguments are those of :data:`nearharmonic.core.layout.RUN`."""
    width, size, rest = runs.size, start.shape[1], start[order[0]]
    queued = np.int64(0)  # numba would compile what takes it twice: for the literal, and for an integer
    for lane in range(width):
        runs[lane] = -1
        _idle(rows, drifts, kicks, lane, width, size, rest)
    while True:
        before = queued
        queued = _refill(
            order, queued, scheme, start, limit, drift, kick, rows, drifts, kicks, runs, at, mark, width, size
        )
        if queued > before:
            for place in range(rows.size):
                fresh[place] = rows[place]
            _begin(begin, (fresh,))
            _record_starts(fresh, rows, runs, mark, width, size, states, energy_error, worst, total, energy)
        count = _next_stretch(marks, runs, at, mark, width)
        if count == FAR:
            return
        done = _advance(advance, (min(count, look), stages, kick_first, drifts, kicks, rows))
        for lane in range(width):
            r = runs[lane]
            if r < 0:
                continue
            at[lane] += done
            if _settle(lane, marks, rows, at, mark, r, width, size, states, energy_error, worst, total, left_at):
                runs[lane] = -1
                _idle(rows, drifts, kicks, lane, width, size, rest)
