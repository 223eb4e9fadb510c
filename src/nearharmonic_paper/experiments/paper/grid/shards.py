"""Shards: the step sizes of one method on one system, cut into jobs of about equal cost.

A job computes the ends of its own shard only, in closed form, and in decimal arithmetic, so that jobs on unlike
processors cut a grid at the same places.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import replace
from decimal import Decimal
from functools import cache
from math import ceil

from nearharmonic.engine.settings import Sweep, exact_decimal, grid_points, tau_range
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import decades
from nearharmonic.systems import System, systems

#: Seconds of a force evaluation with its share of a step, and of a run apart from its steps. They are rough: only the
#: number of jobs depends on them.
PER_EVALUATION = {"double": Decimal("2e-9"), "extended": Decimal("1.2e-8")}
PER_RUN = Decimal("1e-4")
#: Bytes of the trajectories in one job; the job needs about twice this memory.
MOST_BYTES = 4 * 10**8
#: Run files of one method that the job of the cube reads itself; more are reduced by a job for each method.
REDUCED_AT_ONCE = 10


def bytes_of(system: System, samples: int) -> int:
    """Return the bytes of the trajectory of one run: t, q, p, and three numbers of each block."""
    return samples * (3 + 2 * system.dimension) * 8


def suitable_shards(sweep: Sweep, job_seconds: float) -> int:
    """Return the number of shards of a sweep whose jobs take about ``job_seconds``, and hold few enough bytes."""
    points = points_of(sweep)
    shards = max(1, min(points, ceil(_cost(sweep, points) / Decimal(repr(float(job_seconds))))))
    while shards < points and (size := largest_job(replace(sweep, shards=shards))) > MOST_BYTES:
        shards = min(points, ceil(shards * size / MOST_BYTES))
    return shards


def largest_job(sweep: Sweep) -> int:
    """Return the bytes of the trajectories in the last shard: its runs are the shortest, and the most."""
    points = points_of(sweep)
    count = min(sweep.shards, points)
    return (points - _cut(sweep, count - 1, count)) * bytes_of(systems[sweep.system], sweep.samples)


def points_of(sweep: Sweep) -> int:
    """Return the number of step sizes of a sweep."""
    return grid_points(sweep.lowest, sweep.highest, sweep.points_per_decade)


def shards_of(sweep: Sweep, integrator: str) -> int:
    """Return the number of files of one method's runs: ``sweep.shards``, or fewer if there are fewer different runs."""
    points = points_of(sweep)
    most, least = (_steps(sweep, integrators[integrator], index) for index in (0, points - 1))
    return min(sweep.shards, points, most - least + 1)


def shard_range(sweep: Sweep, integrator: str, index: int) -> range:
    """Return the step sizes of shard ``index``, by their numbers in the grid.

    Shards are neighbours and cost the same, as nearly as whole runs can. Step sizes with equal numbers of steps, which
    share one computation, share a shard; a shard that would begin and end among them is empty.
    """
    count = shards_of(sweep, integrator)
    begin, end = (_first(sweep, integrators[integrator], _cut(sweep, each, count)) for each in (index, index + 1))
    return range(begin, end)


def _cut(sweep: Sweep, index: int, count: int) -> int:
    """Return the number of the step size at which shard ``index`` of ``count`` begins."""
    points = points_of(sweep)
    share = _cost(sweep, points) * index / count
    # Every shard has a step size, whatever the costs.
    return min(max(bisect_left(range(points), share, key=lambda i: _cost(sweep, i)), index), points - count + index)


def _first(sweep: Sweep, tableau: Tableau, cut: int) -> int:
    """Return the first step size from ``cut`` on that does not share the computation of the one before."""
    if cut == 0:
        return 0
    before = _steps(sweep, tableau, cut - 1)
    return bisect_right(range(points_of(sweep)), -before, lo=cut, key=lambda i: -_steps(sweep, tableau, i))


def _steps(sweep: Sweep, tableau: Tableau, index: int) -> int:
    """Return the steps of a run with step size ``index``."""
    (tau,) = tau_range(sweep.lowest, sweep.points_per_decade, index, index + 1)
    return tableau.steps(tau, exact_decimal(sweep.t_end))


@cache
def _cost(sweep: Sweep, count: int) -> Decimal:
    """Return the estimated seconds of the first ``count`` runs, those of the smallest step sizes.

    Evaluations of a method of s stages are t_end / (tau / s), whatever the method: those of neighbours have a fixed
    ratio. Extended precision may leave out large step sizes, which cost little.
    """
    (ratio,) = decades(1.0, -sweep.points_per_decade, 1, 2)
    (left,) = decades(1.0, -sweep.points_per_decade, count, count + 1)
    largest = Decimal(sweep.t_end) / Decimal(repr(sweep.lowest))
    evaluations = largest * (1 - left) / (1 - ratio)
    return sum((PER_EVALUATION[each] * evaluations + PER_RUN * count for each in sweep.precision), Decimal(0))
