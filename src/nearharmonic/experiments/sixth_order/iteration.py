"""Compiled text: solutions from many points, a descent of the criterion along the solutions, and their merits.

The arguments are described in :mod:`nearharmonic.experiments.sixth_order.kernels`.
"""

from __future__ import annotations

from typing import Any

from nearharmonic.core.compile import strict
from nearharmonic.core.levenberg_marquardt import DampingRule, levenberg_marquardt, levenberg_step
from nearharmonic.experiments.sixth_order.word_sums import merit, residuals

#: Norm of the residuals at which an iteration ends. They are in units of kappa, of which rounding leaves about 1e-13.
ENOUGH = 1e-12

RULE = DampingRule(
    step=levenberg_step,
    less=lambda damping: damping * 0.15,
    more=lambda damping: damping * 4.0,
    most=1e10,
    iterations=150,
    enough=ENOUGH,
    with_residuals=True,
)

#: Descent: length of the first random step, the factors after success and failure, and Newton steps per projection.
FIRST_LENGTH, LONGER, SHORTER = 0.05, 1.6, 0.85
MOST_PROJECTIONS = 8

solve = levenberg_marquardt(residuals, RULE)


@strict
def within(x: Any, bound: Any) -> Any:
    """Whether ``x`` is within [-bound, bound]."""
    inside = True
    for u in range(len(x)):
        inside = inside and abs(x[u]) <= bound
    return inside


@strict
def project(system: Any, x: Any, work: Any, scratch: Any) -> Any:
    """Move ``x`` to the solution next to it, by Newton's method with the shortest steps; whether that was reached."""
    F, _, J, _, matrix, step, _ = work
    for _ in range(MOST_PROJECTIONS):
        size = residuals(system, x, F, J, scratch)
        if size < ENOUGH:
            return True
        if not size < 1.0:
            break
        levenberg_step(F, J, 0.0, matrix, step)
        for u in range(len(x)):
            x[u] -= step[u]
    return False


@strict
def descend(system: Any, criterion: Any, bound: Any, noise: Any, x: Any, work: Any, scratch: Any) -> None:
    """Lower J for each of ``x``, solutions, by ``noise``, in place.

    A random step, projected back on the solutions, is kept if J gets less; its length adapts to success.
    """
    trial = work[-1]
    for walk in range(x.shape[0]):
        length, least = FIRST_LENGTH, merit(system, criterion, x[walk], scratch)[4]
        for step in range(noise.shape[1]):
            for u in range(len(trial)):
                trial[u] = x[walk, u] + length * noise[walk, step, u]
            better = False
            if project(system, trial, work, scratch) and within(trial, bound):
                value = merit(system, criterion, trial, scratch)[4]
                better = value < least
            if better:
                for u in range(len(trial)):
                    x[walk, u] = trial[u]
                least = value
                length *= LONGER
            else:
                length *= SHORTER
            # A walk that has come to rest begins again at a coarse scale: gaps of stability make cliffs.
            if length < 1e-7:
                length = FIRST_LENGTH


@strict
def assess(system: Any, criterion: Any, x: Any, merits: Any, scratch: Any) -> None:
    """What :func:`~nearharmonic.experiments.sixth_order.word_sums.merit` says of each of ``x``, into ``merits``."""
    for i in range(x.shape[0]):
        merits[i, 0], merits[i, 1], merits[i, 2], merits[i, 3], merits[i, 4] = merit(system, criterion, x[i], scratch)
