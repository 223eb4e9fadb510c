"""Curves of work against precision, and where they cross an error that is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import exp, inf, isfinite, isnan, log, nan
from typing import Literal

#: The errors that a curve is read against, as the names of a :class:`Point`'s fields.
MEASURES = {"max": "max_energy_error", "mean": "mean_energy_error", "position": "position_error"}
#: What readers call the measures.
NAMES = {
    "max": "maximum of |H - H0|/|H0|",
    "mean": "mean of |H - H0|/|H0|",
    "position": "position error at the end, relative",
}

#: What a timed call does: one trajectory; many at once in SIMD lanes; one whose energy is measured at every step.
MODES = ("trajectory", "lanes", "energy")

#: Errors that tables tell the cost of.
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(kw_only=True)
class Point:
    """One setting of one method: what it costs and how far off it is.

    ``tau`` is the step (NaN if the method chooses its own), ``tolerance`` the other way round; ``evaluations`` of the
    force, NaN if unknown. ``compensated`` is 1 or 0 as the sums are compensated or plain, NaN for other libraries.
    Errors as in a cube; infinite where the run failed. ``members`` is the number of trajectories that a call in lanes
    integrates. ``calls`` holds what is to be timed, by mode, and ``times`` the seconds of each repeat, per trajectory.
    """

    tau: float = nan
    tau_per_stage: float = nan
    tolerance: float = nan
    steps: float = nan
    evaluations: float = nan
    compensated: float = nan
    members: float = nan
    max_energy_error: float = inf
    mean_energy_error: float = inf
    position_error: float = nan
    calls: dict[str, Callable[[], object]] = field(default_factory=dict)
    times: dict[str, list[float]] = field(default_factory=dict)


@dataclass(kw_only=True)
class Curve:
    """The points of one method, from the cheapest to the most expensive; ``status`` "ok", or why there are none.

    ``kind`` is "splitting" for the methods of this package, "peer" for what others offer; ``setup`` the seconds that a
    call of a prepared problem takes for one step, ``sweep`` those for all points at once in lanes, energies measured at
    every step.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: str = "ok"
    version: str = ""
    setup: float = nan
    sweep: float = nan
    points: list[Point] = field(default_factory=list)


#: What one interval of a system has to show: (t_end, measures, curves).
Part = tuple[str, Sequence[str], Sequence[Curve]]


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """Point where a curve reaches an error.

    ``status`` is "reached", "below throughout" (the coarsest setting is good enough already, and its cost an upper
    bound) or "not reached"; cost and setting there are NaN where there is none.
    """

    status: Literal["reached", "below throughout", "not reached"]
    time: float = nan
    evaluations: float = nan
    tau: float = nan
    tolerance: float = nan


def cross(errors: Sequence[float], columns: Sequence[Sequence[float]], target: float) -> tuple[str, tuple[float, ...]]:
    """Each of ``columns`` where ``errors``, from coarse to fine, falls to ``target`` for good; and the status there.

    "For good" as in :func:`for_good`, so that neither a lucky zero of a signed error nor a gap between step-size
    resonances counts. Between the last point above and the first at or below, logarithms of error and column are
    joined by a straight line; a point above that is not finite is no end for a line, and the first below counts as it
    stands. Where a finer point costs less, in the first of ``columns``, that point is taken: adaptive methods may get
    more expensive as their tolerance gets coarser.
    """
    none = (nan,) * len(columns)
    settled = for_good(errors)
    if not settled or settled[-1] > target:
        return "not reached", none
    i = next(i for i, error in enumerate(settled) if error <= target)
    at = tuple(float(column[i]) for column in columns)
    above, below = (errors[i - 1], errors[i]) if i else (inf, errors[0])
    if isfinite(above) and below > 0:
        weight = (log(above) - log(target)) / (log(above) - log(below))
        at = tuple(_between(column[i - 1], column[i], weight) for column in columns)
    finer = [tuple(column[j] for column in columns) for j in range(i, len(errors)) if errors[j] <= target]
    return "reached" if i else "below throughout", min([at, *finer], key=lambda row: row[0])


#: How far rounding lifts a curve again beyond its least error; what rises further was not that low but by luck.
ROUNDING_RISE = 100


def for_good(errors: Sequence[float]) -> list[float]:
    """For each of ``errors``, from coarse to fine, the largest from there to the least of all; NaN counts as infinite.

    What comes after the least error is dropped: there rounding makes curves rise again, which is no fault of a coarser
    setting. An error that finer settings exceed by more than :data:`ROUNDING_RISE` is not the least but a lucky one.
    """
    usable = [inf if isnan(error) else error for error in errors]
    if not usable:
        return []
    beyond = [*list(accumulate(reversed(usable[1:]), max))[::-1], 0.0]
    borne_out = [i for i, worst in enumerate(beyond) if worst <= ROUNDING_RISE * usable[i]]
    end = min(borne_out, key=usable.__getitem__, default=len(usable) - 1)
    return list(accumulate(reversed(usable[: end + 1]), max))[::-1]


def _between(first: float, second: float, weight: float) -> float:
    if not (first > 0 and second > 0):
        return float(second)
    return exp((1 - weight) * log(first) + weight * log(second))


def crossing(curve: Curve, measure: str, target: float, mode: str = "trajectory") -> Crossing:
    """Find where ``curve`` reaches ``target`` in ``measure`` (key of :data:`MEASURES`), by least times in ``mode``."""
    points = [point for point in curve.points if point.times.get(mode) or not isfinite(point.max_energy_error)]
    columns = [
        [min(point.times.get(mode, ()), default=nan) for point in points],
        [point.evaluations for point in points],
        [point.tau for point in points],
        [point.tolerance for point in points],
    ]
    status, values = cross([getattr(point, MEASURES[measure]) for point in points], columns, target)
    names = ("time", "evaluations", "tau", "tolerance")
    return Crossing(status=status, **dict(zip(names, values, strict=True)))  # type: ignore[arg-type]


def ranking(
    curves: Sequence[Curve], measure: str, target: float, mode: str = "trajectory"
) -> list[tuple[Curve, Crossing]]:
    """``curves`` with their crossings, the fastest first; those that do not reach ``target`` last, in their order."""
    found = [(curve, crossing(curve, measure, target, mode)) for curve in curves]
    return sorted(found, key=lambda pair: pair[1].time if isfinite(pair[1].time) else inf)


def ns_per_evaluation(curve: Curve, mode: str = "trajectory") -> float:
    """Least nanoseconds per evaluation of the force among the points of ``curve``; NaN if it was not timed."""
    each = [min(p.times[mode]) / p.evaluations for p in curve.points if p.times.get(mode) and p.evaluations > 0]
    return 1e9 * min(each, default=nan)
