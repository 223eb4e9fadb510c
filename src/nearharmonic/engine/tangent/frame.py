"""Frames of deviations: orthonormal bases that follow a tangent map, and the indicators of chaos that they give.

Deviations of a chaotic orbit turn into one direction, and their differences would be lost in rounding errors. A frame
keeps an orthonormal basis Q instead and the triangular factors R of each part of a run (Benettin, Galgani, Giorgilli &
Strelcyn 1980, Meccanica 15, 9 and 21). The deviations themselves are Q C, with C the product of the factors and its
columns scaled to length 1, so that their volumes are products of diagonal entries, without cancellation.
"""

from __future__ import annotations

from numbers import Integral

import numpy as np

from nearharmonic.engine.numbers.arrays import rows_of
from nearharmonic.errors import bad_setting
from nearharmonic.math import log
from nearharmonic.numerics.quasi_random import quasi_random
from nearharmonic.numerics.types import Floats
from nearharmonic.numerics.written import is_real

#: Smallest part of a deviation of length 1 that is perpendicular to those before it.
INDEPENDENT = 1e-10


def initial_deviations(given: object, dimension: int) -> Floats:
    """Return initial deviations (k, 2 d), q-parts and then p-parts.

    Parameters
    ----------
    given : int or (k, 2 d) array of float
        Deviations; or their number k, for the first k of 2 d orthonormal ones in fixed directions, none of which is
        parallel to a coordinate or to a plane of symmetry.
    dimension : int
        Number of coordinates d.

    Raises
    ------
    SettingError
        Neither a number from 1 to 2 d, nor an array of as many finite, linearly independent rows.
    """
    n = 2 * dimension
    allowed = f"an integer from 1 to {n}, or an array (k, {n}) of {dimension} q-parts and {dimension} p-parts a row"
    if is_real(given) and isinstance(given, Integral):
        if not 1 <= int(given) <= n:
            raise bad_setting("deviations", given, allowed)
        return orthonormal(quasi_random(n, n, 0).T[:, :, None] - 0.5)[0][:, : int(given), 0].T.copy()
    rows = np.ascontiguousarray(rows_of("deviations", given, n, allowed)[..., 0])
    if len(rows) > n:
        raise bad_setting("deviations", f"array of shape {rows.shape}", allowed)
    with np.errstate(all="ignore"):
        triangle = orthonormal(unit_rows(rows).T[:, :, None])[1]
    if not (np.diagonal(triangle[..., 0]) > INDEPENDENT).all():
        raise bad_setting("deviations", f"rows of rank below {len(rows)}", "linearly independent rows")
    return rows


def unit_rows(rows: Floats) -> Floats:
    """Return rows (k, n) scaled to length 1; the squares of numbers of any size do not overflow."""
    scaled = rows / np.abs(rows).max(axis=1, keepdims=True)
    found: Floats = scaled / _lengths(scaled.T)[:, None]
    return found


def orthonormal(vectors: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal basis Q (n, k, M) and the triangular factor R (k, k, M) of ``vectors`` = Q R (n, k, M).

    Modified Gram-Schmidt, in a fixed order of operations: the diagonal of R is positive.
    """
    basis, k = vectors.copy(), vectors.shape[1]
    triangle = np.zeros((k, *vectors.shape[1:]))
    for j in range(k):
        triangle[j, j] = length = _lengths(basis[:, j])
        basis[:, j] /= length
        if j + 1 < k:
            triangle[j, j + 1 :] = along = (basis[:, j, None] * basis[:, j + 1 :]).sum(axis=0)
            basis[:, j + 1 :] -= basis[:, j, None] * along
    return basis, triangle


class Frame:
    """Frame of k deviations of length 1 from each of M orbits in n = 2 d dimensions.

    Parameters
    ----------
    deviations : (k, n) array of float
        Initial deviations of all orbits, which are scaled to length 1.
    members : int
        Number of orbits M.

    Attributes
    ----------
    basis : (n, k, M) array of float
        Orthonormal basis; its first vector is parallel to the first deviation.
    growth : (k, M) array of float
        Logarithm of the factor by which each deviation has grown.
    stretching : (k, M) array of float
        Logarithms of the factors of the volumes: the sum of the first j is that of the volume of j deviations.
    """

    def __init__(self, deviations: Floats, members: int) -> None:
        k = len(deviations)
        units = np.repeat(unit_rows(deviations).T[:, :, None], members, axis=2)
        self.basis, self._columns = orthonormal(units)
        self.growth, self.stretching = np.zeros((k, members)), np.zeros((k, members))

    def advance(self, moved: Floats) -> None:
        """Follow a part of a run, which has mapped the basis to the vectors ``moved`` (n, k, M)."""
        self.basis, triangle = orthonormal(moved)
        columns = sum(triangle[:, j, None] * self._columns[j] for j in range(len(triangle)))
        lengths = _lengths(columns)
        self._columns = columns / lengths
        self.growth += log(lengths)
        self.stretching += log(np.einsum("jjm->jm", triangle))

    @property
    def state(self) -> Floats:
        """Basis, deviations in it, growth and stretching (f, M), from which :meth:`resume` goes on."""
        parts = self.basis, self._columns, self.growth, self.stretching
        return np.concatenate([part.reshape(-1, part.shape[-1]) for part in parts])

    def resume(self, state: Floats) -> None:
        """Go on from a :attr:`state`."""
        n, k, members = self.basis.shape
        parts = np.split(state, np.cumsum([n * k, k * k, k]))
        self.basis, self._columns = parts[0].reshape(n, k, members), parts[1].reshape(k, k, members)
        self.growth, self.stretching = parts[2].copy(), parts[3].copy()

    @property
    def deviations(self) -> Floats:
        """The deviations (n, k, M), scaled to length 1."""
        found: Floats = sum(self.basis[:, j, None] * self._columns[j] for j in range(self.basis.shape[1]))
        return found

    @property
    def sali(self) -> Floats:
        """The smaller of the lengths of the sum and of the difference of the first two deviations of length 1 (M,)."""
        along, across = self._columns[:2, 1]
        found: Floats = across * np.sqrt(2 / (1 + np.abs(along)))
        return found

    @property
    def gali(self) -> Floats:
        """Volumes (k - 1, M) of the parallelepipeds of the first 2, 3, ..., k deviations of length 1."""
        volumes: Floats = np.cumprod(np.einsum("jjm->jm", self._columns), axis=0)
        return volumes[1:]


def _lengths(vectors: Floats) -> Floats:
    """Lengths of vectors along the first axis, summed in a fixed order."""
    found: Floats = np.sqrt((vectors * vectors).sum(axis=0))
    return found
