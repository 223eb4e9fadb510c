"""Sites of crystals, and pairs of neighbours as fixed vectors between sites.

Forces depend on displacements u from the sites: the distance of two neighbours is that of their sites plus the
difference of their displacements. The lists are made once, because atoms of a crystal do not leave their sites.
"""

from __future__ import annotations

from itertools import product
from math import factorial, ldexp
from typing import NamedTuple

import numpy as np

from nearharmonic.numerics.compiled import compiled
from nearharmonic.numerics.types import Floats

FCC = ((0.0, 0.0, 0.0), (0.0, 0.5, 0.5), (0.5, 0.0, 0.5), (0.5, 0.5, 0.0))
DIAMOND = (*FCC, *((x + 0.25, y + 0.25, z + 0.25) for x, y, z in FCC))


class Pairs(NamedTuple):
    """Pairs of neighbours: their first coordinates 3i and 3j, and the vectors from site i to site j."""

    i: np.ndarray
    j: np.ndarray
    vector: Floats


def cubic(basis: tuple[tuple[float, float, float], ...], constant: float, cells: int) -> Floats:
    """Return the sites (N, 3) of cells^3 cubic cells with an edge ``constant``."""
    corners = np.array(list(product(range(cells), repeat=3)), float)
    sites: Floats = (corners[:, None, :] + np.array(basis)).reshape(-1, 3) * constant
    return sites


def pairs_within(sites: Floats, edge: float, reach: float, *, both: bool = False) -> Pairs:
    """Return the pairs of sites in a periodic cube whose distance is at most ``reach``, images included.

    Each pair is listed once, or once for each of its sites if ``both``.
    """
    images = range(-int(reach / edge) - 1, int(reach / edge) + 2)
    found = []
    for image in product(images, repeat=3):
        vector = sites[None, :, :] + edge * np.array(image) - sites[:, None, :]
        square = vector[..., 0] ** 2 + vector[..., 1] ** 2 + vector[..., 2] ** 2
        for i, j in zip(*np.nonzero((square <= reach * reach) & (square > 0)), strict=True):
            if both or i < j or (i == j and image > (0, 0, 0)):
                found.append((3 * i, 3 * j, *vector[i, j]))
    found.sort()
    rows = np.array(found)
    # Unsigned, or each access would first ask whether an index counts from the end.
    first, second = (rows[:, c].astype(np.uint64) for c in (0, 1))
    return Pairs(first, second, np.ascontiguousarray(rows[:, 2:]))


#: ln 2 in two parts; a multiple below 2^20 of the first is exact. Powers of two from 2^-1023 on.
_LN2 = (0.6931471803691238, 1.9082149292705877e-10)
_POWERS = np.array([ldexp(1.0, k) for k in range(-1023, 1024)])
_F = tuple(1 / factorial(k) for k in range(14))


@compiled
def exponential(x):  # type: ignore[no-untyped-def]
    """Return exp(x) to about 1 ulp, 0 or infinity beyond 700; its bits, unlike those of libm, are equal everywhere."""
    if not -700.0 <= x <= 700.0:  # or no number
        return 0.0 if x < 0.0 else np.inf
    whole = np.floor(x * 1.4426950408889634 + 0.5)
    r = (x - whole * _LN2[0]) - whole * _LN2[1]
    square = r * r
    total = _F[12] + r * _F[13]
    total = _F[10] + r * _F[11] + square * total
    total = _F[8] + r * _F[9] + square * total
    total = _F[6] + r * _F[7] + square * total
    total = _F[4] + r * _F[5] + square * total
    total = _F[2] + r * _F[3] + square * total
    return (1.0 + (r + square * total)) * _POWERS[int(whole) + 1023]
