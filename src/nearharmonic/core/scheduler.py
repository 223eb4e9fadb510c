"""A queue of runs through the lanes of a kernel: a lane that finishes, or whose run has left, takes the next run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from nearharmonic.core.cache import strict

#: Entries of the tally behind the 4 d rows of the state, in this order.
WORST, TOTAL, TOTAL_CARRY, LATEST, ENERGY, ENERGY_LOW, LIMIT = range(7)
TALLY = 7


@strict
def _idle(rows, drifts, kicks, runs, lane, start):  # type: ignore[no-untyped-def]
    """The lane stands still at ``start``, a regular point: a NaN in an idle lane would stop the others."""
    size = start.size
    runs[lane] = -1
    drifts[:, :, lane] = 0.0
    kicks[:, :, lane] = 0.0
    rows[:size, lane] = start
    rows[size:, lane] = 0.0
    rows[size + LIMIT, lane] = np.inf


@strict
def _assign(rows, drifts, kicks, lane, start, drift, kick, limit):  # type: ignore[no-untyped-def]
    """The lane takes up a run at its start."""
    size = start.size
    rows[:size, lane] = start
    rows[size + LIMIT, lane] = limit
    drifts[:, :, lane] = drift
    kicks[:, :, lane] = kick


@strict
def _record(rows, lane, states, energy_error, worst, total):  # type: ignore[no-untyped-def]
    """One sample of the lane, and what its block of steps since the last sample came to."""
    size = states.size
    states[:] = rows[:size, lane]
    tally = rows[size:, lane]
    energy_error[0] = tally[LATEST]
    worst[0] = tally[WORST]
    total[0] = tally[TOTAL] + tally[TOTAL_CARRY]
    tally[WORST] = tally[TOTAL] = tally[TOTAL_CARRY] = 0.0


def lane_scheduler(
    size: int, parts: int, width: int, advance: Callable[..., Any], begin: Callable[..., Any]
) -> Callable[..., None]:
    """Python text of ``run``, to be compiled around a kernel's ``advance`` and ``begin``.

    Arguments of ``run``, for R runs of S samples with states of ``size`` = 4 d doubles: ``order`` (R,) the queue;
    ``marks`` (R, S) steps at which to sample, first 0, padded with -1; ``scheme`` (R,) rows of the coefficient arrays;
    ``start`` (R, size); ``limit`` largest relative energy error; ``stages``; ``kick_first``; ``drift`` and ``kick``
    (schemes, stages + 1, parts) with the step size multiplied in. Results, filled in place: ``states`` (R, S, size);
    ``energy_error`` (R, S) signed H - H0; ``worst`` and ``total`` (R, S) of |H - H0| over the steps since the last
    sample; ``energy`` (R, 2) H0 as a pair; ``left_at`` (R,) the step at which a run left its energy surface, or 0.
    """
    far = np.iinfo(np.int64).max

    def run(  # type: ignore[no-untyped-def]
        order, marks, scheme, start, limit, stages, kick_first, drift, kick,
        states, energy_error, worst, total, energy, left_at,
    ):  # fmt: skip
        rows, fresh = np.zeros((size + TALLY, width)), np.zeros((size + TALLY, width))
        drifts, kicks = np.zeros((stages + 1, parts, width)), np.zeros((stages + 1, parts, width))
        runs, at, mark = np.full(width, -1), np.zeros(width, np.int64), np.zeros(width, np.int64)
        rest = start[order[0]]
        queued = 0
        for lane in range(width):
            _idle(rows, drifts, kicks, runs, lane, rest)
        while True:
            before = queued
            for lane in range(width):
                if runs[lane] < 0 and queued < order.size:
                    r = order[queued]
                    queued += 1
                    runs[lane], at[lane], mark[lane] = r, 0, 0
                    _assign(rows, drifts, kicks, lane, start[r], drift[scheme[r]], kick[scheme[r]], limit)
            if queued > before:
                fresh[:] = rows
                begin(fresh.reshape(-1))
                for lane in range(width):
                    r = runs[lane]
                    if r >= 0 and mark[lane] == 0:
                        rows[size:, lane] = fresh[size:, lane]
                        energy[r, 0], energy[r, 1] = fresh[size + ENERGY, lane], fresh[size + ENERGY_LOW, lane]
                        _record(rows, lane, states[r, 0], energy_error[r], worst[r], total[r])
                        mark[lane] = 1
            count = far
            for lane in range(width):
                if runs[lane] >= 0:
                    count = min(count, marks[runs[lane], mark[lane]] - at[lane])
            if count == far:
                return
            done = advance(count, stages, kick_first, drifts.reshape(-1), kicks.reshape(-1), rows.reshape(-1))
            for lane in range(width):
                r, m = runs[lane], mark[lane]
                if r < 0:
                    continue
                at[lane] += done
                if not abs(rows[size + LATEST, lane]) <= rows[size + LIMIT, lane]:
                    left_at[r] = at[lane]
                    _idle(rows, drifts, kicks, runs, lane, rest)
                elif at[lane] == marks[r, m]:
                    _record(rows, lane, states[r, m], energy_error[r, m:], worst[r, m:], total[r, m:])
                    mark[lane] = m + 1
                    if m + 1 == marks.shape[1] or marks[r, m + 1] < 0:
                        _idle(rows, drifts, kicks, runs, lane, rest)

    return run
