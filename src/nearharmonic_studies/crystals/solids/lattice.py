"""Sites of crystals, and pairs of neighbours as fixed vectors between sites.

Forces depend on displacements u from the sites: the distance of two neighbours is that of their sites plus the
difference of their displacements. The lists are made once, because atoms of a crystal do not leave their sites.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from nearharmonic.numerics.compiled import compiled
from nearharmonic.numerics.portable import Floats

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


@compiled
def pull(out, i, j, slope, vectors, k):  # type: ignore[no-untyped-def]
    """Add the gradient of pair k: ``slope`` times ``vectors[:, k]`` at j, and the opposite at i."""
    for c in range(3):
        out[j + c] += slope * vectors[c, k]
        out[i + c] -= slope * vectors[c, k]
