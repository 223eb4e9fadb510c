"""Kernels: Levenberg and Marquardt's iteration from many starts, and a descent of a criterion along the solutions."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64, int64, types

from nearharmonic.core.cache import compiled, core_digest, named, strict
from nearharmonic.search.ranking import merit
from nearharmonic.search.word_sums import residuals, smallest_step

#: Levenberg-Marquardt: damping to begin with, the factors by which it changes, and when to give up.
FIRST_DAMPING, LESS, MORE, MOST_DAMPING = 1e-2, 0.15, 4.0, 1e10
MOST_ITERATIONS = 150
#: Norm of the residuals at which an iteration ends, and below which it counts as solved. The residuals are in units of
#: kappa, of which rounding leaves up to about 1e-13.
ENOUGH, SOLVED = 1e-12, 1e-10

#: Descent: length of the first random step, the factors after success and failure, and Newton steps per projection.
FIRST_LENGTH, LONGER, SHORTER = 0.05, 1.6, 0.85
MOST_PROJECTIONS = 8


def solve(system: Any, starts: Any, bound: Any, solutions: Any, solved: Any) -> None:
    """The solution that the iteration reaches from each of ``starts`` (start, unknown).

    Fills ``solutions`` (start, unknown) and ``solved`` (start). An iteration that leaves [-bound, bound] is given up.
    """
    for start in range(starts.shape[0]):
        x, damping = starts[start].copy(), FIRST_DAMPING
        F, J, size = residuals(system, x)
        for _ in range(MOST_ITERATIONS):
            if not size > ENOUGH or damping > MOST_DAMPING or np.max(np.abs(x)) > bound:
                break
            # Damping that falls with the residual does not spoil the quadratic end.
            trial = x - smallest_step(F, J, damping * min(size, 1.0))
            trial_F, trial_J, trial_size = residuals(system, trial)
            if trial_size < size:
                x, F, J, size = trial, trial_F, trial_J, trial_size
                damping *= LESS
            else:
                damping *= MORE
        solutions[start] = x
        solved[start] = size < SOLVED and np.max(np.abs(x)) <= bound


@strict
def projected(system: Any, x: Any) -> Any:
    """The solution next to ``x``, by Newton's method with the shortest steps, and whether it was reached."""
    y = x.copy()
    for _ in range(MOST_PROJECTIONS):
        F, J, size = residuals(system, y)
        if size < ENOUGH:
            return y, True
        if not size < 1.0:
            break
        y -= smallest_step(F, J, 0.0)
    return y, False


def descend(system: Any, criterion: Any, bound: Any, noise: Any, x: Any) -> None:
    """Lower J for each of ``x`` (walk, unknown), solutions, by ``noise`` (walk, step, unknown), in place.

    A random step, projected back on the solutions, is kept if J gets less; its length adapts to success.
    """
    for walk in range(x.shape[0]):
        length, least = FIRST_LENGTH, merit(system, criterion, x[walk])[4]
        for step in range(noise.shape[1]):
            trial, found = projected(system, x[walk] + length * noise[walk, step])
            better = False
            if found and np.max(np.abs(trial)) <= bound:
                value = merit(system, criterion, trial)[4]
                better = value < least
            if better:
                x[walk], least = trial, value
                length *= LONGER
            else:
                length *= SHORTER
            # A walk that has come to rest begins again at a coarse scale: gaps of stability make cliffs.
            if length < 1e-7:
                length = FIRST_LENGTH


def assess(system: Any, criterion: Any, x: Any, merits: Any) -> None:
    """Fill ``merits`` (solution, 5) with what :func:`~nearharmonic.search.ranking.merit` says of each of ``x``."""
    for i in range(x.shape[0]):
        merits[i] = merit(system, criterion, x[i])


class Kernels(NamedTuple):
    """The compiled entry points."""

    solve: Callable[..., None]
    descend: Callable[..., None]
    assess: Callable[..., None]


@cache
def kernels() -> Kernels:
    """The entry points, compiled, or from the cache on disk if they are there."""
    sources = [Path(__file__).with_name(f"{name}.py") for name in ("word_sums", "ranking", "iteration")]
    digest = sha256("".join([core_digest(), *(path.read_text(encoding="utf-8") for path in sources)]).encode())
    ints, row, plane = types.Array(int64, 1, "C"), float64[::1], float64[:, ::1]
    table = types.UniTuple(ints, 2)
    system = types.Tuple((table, ints, plane, row, plane, row))
    criterion = types.Tuple((table, plane, row, types.Array(int64, 2, "C")))
    signatures: dict[Callable[..., None], Any] = {
        solve: types.void(system, plane, float64, plane, boolean[::1]),
        descend: types.void(system, criterion, float64, float64[:, :, ::1], plane),
        assess: types.void(system, criterion, plane, plane),
    }
    key = digest.hexdigest()
    return Kernels(*(compiled(named(function, key), signature, key) for function, signature in signatures.items()))
