"""Frequencies along orbits, which bound the step sizes with which a method is linearly stable.

The squared frequencies at a point are the eigenvalues of T'' V''. Products with both Hessians are differences of the
gradients that kernels compute, so that they need no expression and no code of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, quasi_random
from nearharmonic.systems.system import System

#: A kick by the gradient of V, then a drift; its other role begins with the drift.
KICK = Tableau(name="kick", order=1, first="kick", kick=("1", "0"), drift=("1",), source="Euler", digits=30)
#: Method of the orbits, for any T: near a saddle leapfrog would leave for where an orbit of the system does not go.
ACCURATE = "blanes_moan_s6o4"
#: Sizes of differences of gradients relative to the extent of an orbit, whose truncation and rounding are alike.
DIFFERENCE = 2.0**-17
#: Smallest extent of a coordinate in a difference, relative to that of all coordinates.
LEAST_EXTENT = 2.0**-10
#: Products with a Hessian at most, after which the largest eigenvalue is known within the error that is added to it.
PRODUCTS = 24
#: Relative size below which a vector is rounding.
NOTHING = 1e-7
#: Points of all orbits at most, and numbers in all of them.
POINTS, NUMBERS = 4096, 2**14


@dataclass(frozen=True)
class Orbits:
    """Orbits of an accurate method with small steps.

    ``extents`` (2, D) are the largest moduli of positions and momenta, or a small part of that of all coordinates.
    ``frequency`` is the largest frequency at their points, 0 without oscillations or for a regularised system, whose
    steps are of another time.
    """

    extents: Floats
    frequency: float


def orbits(system: System, t_end: Fraction, start: Floats, evaluations: int) -> Orbits:
    """Return the orbits from the states ``start`` (K, 4 D), with so many evaluations of the force together."""
    members, D = len(start), start.shape[1] // 4
    tableau = integrators[ACCURATE]
    steps = max(1, evaluations // members // tableau.stages)
    paths = integrate_batch(
        system, tableau, t_end=t_end, steps=[steps] * members, start=start,
        samples=max(17, min(POINTS, NUMBERS // D) // members), numerics=Numerics(energy="samples"),
    )  # fmt: skip
    points = np.stack([paths.q, paths.p]).reshape(2, -1, D)
    points = points[:, np.isfinite(points).all(axis=(0, 2))]
    largest = np.abs(points).max(axis=1, initial=0.0)
    extents = np.maximum(largest, LEAST_EXTENT * largest.max(axis=1, keepdims=True))
    extents[extents == 0] = 1.0
    frequency = 0.0
    if system.regularisation is None and points.size:
        with np.errstate(all="ignore"):  # a gradient beside a singularity may be infinite
            frequency = float(np.sqrt(np.maximum(_largest_eigenvalues(system, points, extents), 0)).max(initial=0))
    return Orbits(extents, frequency)


def _largest_eigenvalues(system: System, points: Floats, extents: Floats) -> Floats:
    """Return the largest eigenvalues of T'' V'' at ``points`` (2, M, D) by the Lanczos algorithm, each with its error.

    T'' V'' is symmetric in the inner product of the inverse of T'': vectors x = T'' z are kept with their z.
    """
    M, D = points.shape[1:]
    count = min(D, PRODUCTS)
    diagonal, beside = np.zeros((count, M)), np.zeros((count, M))
    zs, xs = np.zeros((2, count, M, D))
    z = np.tile(quasi_random(1, D, 0) - 0.5, (M, 1))
    size = np.zeros(M)
    for k in range(count):
        x = _hessian_times(system, points, extents, 1, z)
        length = np.sqrt(np.maximum((z * x).sum(axis=1), 0))
        if k:
            beside[k - 1] = length
        usable = length > NOTHING * size
        zs[k], xs[k] = (np.where(usable[:, None], one / np.where(usable, length, 1)[:, None], 0) for one in (z, x))
        z = _hessian_times(system, points, extents, 0, xs[k])
        diagonal[k] = (xs[k] * z).sum(axis=1)
        for _ in range(2):  # a second time for what rounding leaves
            z = z - np.einsum("jmd,jm->md", zs[: k + 1], np.einsum("jmd,md->jm", xs[: k + 1], z))
        size = np.maximum(size, np.abs(diagonal[k]))
    x = _hessian_times(system, points, extents, 1, z)
    beside[-1] = np.sqrt(np.maximum((z * x).sum(axis=1), 0))
    matrices = np.zeros((M, count, count))
    matrices[:, range(count), range(count)] = diagonal.T
    for k in range(1, count):
        matrices[:, k, k - 1] = matrices[:, k - 1, k] = beside[k - 1]
    usable = np.isfinite(matrices).all(axis=(1, 2)) & np.isfinite(beside[-1])
    values, vectors = np.linalg.eigh(matrices[usable])
    found: Floats = values[:, -1] + beside[-1, usable] * np.abs(vectors[:, -1, -1])
    return found


def _hessian_times(system: System, points: Floats, extents: Floats, which: int, vectors: Floats) -> Floats:
    """Return V'' (``which`` 0) or T'' (1) at ``points`` (2, M, D) times ``vectors`` (M, D).

    A step of length 1 of :data:`KICK`, or of its other role, adds the gradient to the momentum or to the position.
    """
    M, D = vectors.shape
    size = np.abs(vectors / extents[which]).max(axis=1, keepdims=True)
    change = DIFFERENCE * vectors / np.where(size > 0, size, 1)
    rows = np.zeros((2, M, 4, D))
    rows[:, :, 2 * which] = points[which]
    rows[0, :, 2 * which] += change
    rows[1, :, 2 * which] -= change
    paths = integrate_batch(
        system, KICK.role("drift") if which else KICK, t_end=Fraction(1), steps=[1] * (2 * M), samples=1,
        start=rows.reshape(2 * M, -1), numerics=Numerics(energy="none", summation="plain"),
    )  # fmt: skip
    ahead, behind = (paths.q if which else -paths.p).reshape(2, M, D)
    found: Floats = (ahead - behind) / (2 * DIFFERENCE) * np.where(size > 0, size, 1)
    return found
