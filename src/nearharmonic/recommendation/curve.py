"""Curves of work against precision, and the points where they reach a given error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import exp, inf, isfinite, isnan, log, nan
from typing import Literal

#: Fields of :class:`Point` with the error of each measure.
MEASURES = {"max": "max_energy_error", "mean": "mean_energy_error", "position": "position_error"}
#: Names of the measures in texts.
NAMES = {
    "max": "maximum of |H - H0|/|H0|",
    "mean": "mean of |H - H0|/|H0|",
    "position": "position error at the end, relative",
}

#: Modes of a timed call: one trajectory; many in SIMD lanes; one with the energy measured at every step.
MODES = ("trajectory", "lanes", "energy")

#: Errors at which tables list the cost.
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(kw_only=True)
class Point:
    """One setting of one method: its cost and its errors.

    ``tau``: step size, NaN for adaptive methods. ``tolerance``: requested tolerance, NaN for fixed-step methods.
    ``evaluations`` of the force, NaN if unknown. ``compensated``: 1 for compensated sums, 0 for plain, NaN for other
    libraries. Errors are those of a cube, infinite where the run failed. ``members``: trajectories of a call in lanes.
    ``calls``: functions to be timed, by mode. ``times``: seconds of each repeat, per trajectory, by mode.
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
    """Points of one method, from the cheapest to the most expensive.

    ``status``: "ok", or the reason for an empty curve. ``kind``: "splitting" for methods of this package, "peer" for
    other libraries. ``setup``: seconds of a call of a prepared problem for one step. ``sweep``: seconds of one call for
    all points in lanes, with the energy measured at every step.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: str = "ok"
    version: str = ""
    setup: float = nan
    sweep: float = nan
    points: list[Point] = field(default_factory=list)


#: Curves of one interval of a system: (t_end, measures, curves).
Part = tuple[str, Sequence[str], Sequence[Curve]]


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """Point where a curve reaches an error.

    ``status``: "reached"; "below throughout" (the coarsest setting meets the error, and its cost is an upper bound); or
    "not reached", with NaN for cost and setting.
    """

    status: Literal["reached", "below throughout", "not reached"]
    time: float = nan
    evaluations: float = nan
    tau: float = nan
    tolerance: float = nan


def cross(errors: Sequence[float], columns: Sequence[Sequence[float]], target: float) -> tuple[str, tuple[float, ...]]:
    """Return the status, and each of ``columns`` where ``errors``, from coarse to fine, falls to ``target`` for good.

    "For good" is defined by :func:`for_good`, so that neither a zero of a signed error nor a gap between step-size
    resonances counts. Between the last point above and the first at or below, logarithms of error and column are
    interpolated linearly; if the point above is not finite, the first point below is taken. If a finer point costs
    less, in the first of ``columns``, that point is taken: adaptive methods may be more expensive at a coarser
    tolerance.
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


#: Largest rise of a curve by rounding beyond its smallest error; if it rises further, that error is accidental.
ROUNDING_RISE = 100


def for_good(errors: Sequence[float]) -> list[float]:
    """Return for each of ``errors``, from coarse to fine, the largest error from there to the smallest of all.

    NaN counts as infinite. Errors after the smallest are dropped: there curves rise again by rounding. An error that
    finer settings exceed by more than :data:`ROUNDING_RISE` is accidental, and not taken as the smallest.
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
    """Return ``curves`` with their crossings, the fastest first, and last the curves that do not reach ``target``."""
    found = [(curve, crossing(curve, measure, target, mode)) for curve in curves]
    return sorted(found, key=lambda pair: pair[1].time if isfinite(pair[1].time) else inf)


def ns_per_evaluation(curve: Curve, mode: str = "trajectory") -> float:
    """Return the least nanoseconds per evaluation of the force on ``curve``; NaN if it was not timed."""
    each = [min(p.times[mode]) / p.evaluations for p in curve.points if p.times.get(mode) and p.evaluations > 0]
    return 1e9 * min(each, default=nan)
