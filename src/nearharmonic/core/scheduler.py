"""A queue of runs through the lanes of a kernel: a lane that finishes, or whose run has left, takes the next run.

The compiled text below uses loops over flat arrays only, which the caller allocates: slices, reshapes and allocations
would pull numba's array library into the compilation and treble its time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nearharmonic.core.cache import strict
from nearharmonic.core.layout import ENERGY, ENERGY_LOW, FAR, LATEST, LIMIT, TALLY, TOTAL, TOTAL_CARRY, WORST


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


def lane_scheduler(
    size: int, width: int, advance: Callable[..., Any], begin: Callable[..., Any]
) -> Callable[..., None]:
    """Python text of ``run``, to be compiled around a kernel's ``advance`` and ``begin``.

    Arguments of ``run``, for R runs of S samples with states of ``size`` = 4 d doubles: ``order`` (R,) the queue;
    ``marks`` (R, S) steps at which to sample, first 0, padded with -1; ``scheme`` (R,) rows of the coefficient arrays;
    ``start`` (R, size); ``limit`` largest relative energy error; ``look`` most steps at a stretch: a kernel that does
    not measure every step looks at the energy that often; ``stages``; ``kick_first``; ``drift`` and ``kick`` (schemes,
    stages + 1, parts) with the step size multiplied in. Results, filled in place: ``states`` (R, S, size);
    ``energy_error`` (R, S) signed H - H0; ``worst`` and ``total`` (R, S) of |H - H0| over the steps since the last
    sample; ``energy`` (R, 2) H0 as a pair; ``left_at`` (R,) the step at which a run left its energy surface, or 0.
    Then the arrays of
    :func:`nearharmonic.core.layout.workspace`.
    """

    def run(  # type: ignore[no-untyped-def]
        order, marks, scheme, start, limit, look, stages, kick_first, drift, kick,
        states, energy_error, worst, total, energy, left_at,
        rows, fresh, drifts, kicks, runs, at, mark,
    ):  # fmt: skip
        rest = start[order[0]]
        queued = 0
        for lane in range(width):
            runs[lane] = -1
            _idle(rows, drifts, kicks, lane, width, size, rest)
        while True:
            before = queued
            for lane in range(width):
                if runs[lane] < 0 and queued < order.size:
                    r = order[queued]
                    queued += 1
                    runs[lane], at[lane], mark[lane] = r, 0, 0
                    _fill(rows, drifts, kicks, lane, width, size, start[r], drift[scheme[r]], kick[scheme[r]], limit)
            if queued > before:
                for place in range(rows.size):
                    fresh[place] = rows[place]
                begin(fresh)
                for lane in range(width):
                    r = runs[lane]
                    if r >= 0 and mark[lane] == 0:
                        for place in range(size * width + lane, rows.size, width):
                            rows[place] = fresh[place]
                        energy[r, 0] = rows[(size + ENERGY) * width + lane]
                        energy[r, 1] = rows[(size + ENERGY_LOW) * width + lane]
                        _record(rows, lane, width, size, 0, states[r], energy_error[r], worst[r], total[r])
                        mark[lane] = 1
            count = FAR
            for lane in range(width):
                if runs[lane] >= 0:
                    count = min(count, marks[runs[lane], mark[lane]] - at[lane])
            if count == FAR:
                return
            done = advance(min(count, look), stages, kick_first, drifts, kicks, rows)
            for lane in range(width):
                r, m = runs[lane], mark[lane]
                if r < 0:
                    continue
                at[lane] += done
                if not abs(rows[(size + LATEST) * width + lane]) <= rows[(size + LIMIT) * width + lane]:
                    left_at[r] = at[lane]
                    finished = True
                elif at[lane] == marks[r, m]:
                    _record(rows, lane, width, size, m, states[r], energy_error[r], worst[r], total[r])
                    mark[lane] = m + 1
                    finished = m + 1 == marks.shape[1] or marks[r, m + 1] < 0
                else:
                    finished = False
                if finished:
                    runs[lane] = -1
                    _idle(rows, drifts, kicks, lane, width, size, rest)

    return run
