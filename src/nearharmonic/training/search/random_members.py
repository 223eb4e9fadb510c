"""Members of a family near random points, for families with so many equations that a projection hardly ever converges.

The method of Levenberg and Marquardt (Marquardt 1963, J. SIAM 11, 431) lowers the sum of the squared residuals. Points
that stay behind others are given up early.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family

#: Number of points whose equations are evaluated together.
AT_ONCE = 250


@dataclass(frozen=True, kw_only=True)
class Pursuit:
    """Settings of the way from random points to members.

    Attributes
    ----------
    batch, steps : int
        Points that are followed together, and steps from each.
    spreads : tuple of float
        Standard deviations of the unknowns around 1/s, one for each batch in turn.
    longest, largest : float
        Largest change of an unknown per step, and largest unknown of a point that is followed.
    kept : tuple of (int, float)
        Numbers of steps, counted from 0, after which only this share of the points with the smallest residuals is
        followed on; members always are.
    met : float
        Sum of the squared residuals from which a projection converges.
    """

    batch: int = 2000
    steps: int = 60
    spreads: tuple[float, ...] = (0.5, 0.7)
    longest: float = 0.5
    largest: float = 3.0
    kept: tuple[tuple[int, float], ...] = ((10, 0.5), (20, 0.5), (30, 0.4), (45, 0.4))
    met: float = 1e-16


def random_members(family: Family, count: int, random: np.random.Generator, settings: Pursuit = Pursuit()) -> Floats:
    """Return members (N, n) of a family near ``count`` random points; N may be 0."""
    found = [np.zeros((0, family.unknowns))]
    for turn, begin in enumerate(range(0, count, settings.batch)):
        size = min(settings.batch, count - begin), family.unknowns
        spread = settings.spreads[turn % len(settings.spreads)]
        points = _pursued(family, random.normal(1 / family.stages, spread, size), settings)
        members, inside = family.project(points)
        found.append(members[inside])
    return np.concatenate(found)


def _pursued(family: Family, x: Floats, settings: Pursuit) -> Floats:
    """Return the points whose residuals became small."""
    with np.errstate(all="ignore"):
        values, slopes, cost = _linearised(family, x)
        damping, kept = np.full(len(x), 0.01), dict(settings.kept)
        for step in range(settings.steps):
            moved = x + _steps(values, slopes, damping, settings.longest)
            there = _linearised(family, moved)
            better = there[2] < cost
            x[better] = moved[better]
            for now, new in zip((values, slopes, cost), there, strict=True):
                now[better] = new[better]
            damping = np.where(better, np.maximum(damping / 5, 1e-12), np.minimum(damping * 5, 1e6))
            if step in kept:
                ahead = cost <= max(settings.met, float(np.quantile(cost, kept[step])))
                ahead &= np.abs(x).max(axis=1) < settings.largest
                x, values, slopes, cost, damping = (one[ahead] for one in (x, values, slopes, cost, damping))
            if not len(x):
                break
    return x[cost < settings.met]


def _linearised(family: Family, x: Floats) -> tuple[Floats, Floats, Floats]:
    """Residuals (C, e), their derivatives (C, e, n), and the sum of the squared residuals (C,), infinite for NaN."""
    # Arrays of so many points stay in the cache of a processor.
    parts = [family.linearised(x[i : i + AT_ONCE].T) for i in range(0, len(x), AT_ONCE)]
    values, slopes = np.concatenate([v.T for v, _ in parts]), np.concatenate([one for _, one in parts])
    cost = (values * values).sum(axis=1)
    return values, slopes, np.where(np.isfinite(cost), cost, np.inf)


def _steps(values: Floats, slopes: Floats, damping: Floats, longest: float) -> Floats:
    """Return the damped Gauss-Newton steps (C, n), no unknown of which changes by more than ``longest``."""
    transposed = slopes.transpose(0, 2, 1)
    square = transposed @ slopes
    size = 1e-3 + np.trace(square, axis1=1, axis2=2)
    square += (damping * size)[:, None, None] * np.eye(square.shape[1])
    step: Floats = -np.nan_to_num(np.linalg.solve(square, transposed @ values[..., None])[..., 0])
    shorter: Floats = step * np.minimum(1, longest / np.maximum(np.abs(step).max(axis=1), 1e-300))[:, None]
    return shorter
