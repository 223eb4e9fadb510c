"""Distinct points among many that lie close together; separate because it needs no compiler."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from math import inf

import numpy as np

from nearharmonic.numerics.types import Floats


def distinct(points: Floats, closest: float, *, relative: bool = False, most: float = inf) -> tuple[Floats, list[int]]:
    """Return the points that are far from all the ones before, and how many are near each, itself included.

    Parameters
    ----------
    points : (R, n) array of float
        The points; of near ones the first stands for all.
    closest : float
        Points are near if no unknown differs by more than this.
    relative : bool
        True to multiply ``closest`` by the size of the largest unknown of a point, if this is above 1.
    most : int, optional
        Number of points beyond which no more are kept.
    """
    kept: list[Floats] = []
    hits: list[int] = []
    order: list[tuple[float, int]] = []  # of those that are kept, by the first unknown
    for x in points:
        reach = closest * max(1.0, float(np.abs(x).max())) if relative else closest
        window = order[bisect_left(order, (x[0] - reach, 0)) : bisect_right(order, (x[0] + reach, len(points)))]
        near = [i for _, i in window if np.abs(x - kept[i]).max() <= reach]
        if near:
            hits[min(near)] += 1
        elif len(kept) < most:
            insort(order, (x[0], len(kept)))
            kept.append(x)
            hits.append(1)
    return np.array(kept).reshape(len(kept), points.shape[1]), hits
