"""Model crystals drawn at random: rings of masses in turns, with cubic and quartic bonds, in thermal equilibrium.

    V = sum_i k_i (d_i^2 / 2 - d_i^3 / 2 + c d_i^4),  d_i = w_(i+1) q_(i+1) - w_i q_i

q are coordinates times the square roots of the masses, so that T = p.p/2. The unit of length is the softness of the
bonds, the length for which the cubic term of every pair potential of this form is -d^3/2. Then c is 7/24 for Morse's
bond and 53/168 for that of Lennard-Jones; it is uniform between the two. The ratio of the masses is log-uniform from 1
to 4, and so are all k_i from 0.7 to 1.4. The highest frequency is 1. Every phonon has random coordinates and momenta of
one temperature, which makes the rms change of a bond log-uniform in a band, as long as bonds are harmonic. The total
momentum is 0.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from nearharmonic.math import exp, log
from nearharmonic.numerics.portable import Floats, eigen, product
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.system import System
from nearharmonic.training.population import Ensemble

#: Masses of a ring, the largest ratio of two of them, and the bounds of the strengths of bonds.
SITES, RATIO, BONDS = 8, 4.0, (0.7, 1.4)
#: Coefficient of d^4 for Morse's bond and for that of Lennard-Jones: V''''/V'' over 24, and over (V'''/(3 V''))^2.
QUARTIC = (7 / 24, 53 / 168)


@cache
def ring() -> System:
    """Return the system whose parameters are the inverse roots of the masses, k, and c."""
    names = [*(f"w{i}" for i in range(SITES)), *(f"k{i}" for i in range(SITES)), "c"]

    def V(q: Any, *given: Any) -> Any:
        w, k, c = given[:SITES], given[SITES : 2 * SITES], given[-1]
        places = [a * x for a, x in zip(w, q, strict=True)]
        bonds = zip(k, places, [*places[1:], places[0]], strict=True)
        return sum(strength * _bond(b - a, c) for strength, a, b in bonds)

    point = ("0.25",) * SITES
    return System(
        name="random_ring", label="random ring", V=V, q0=point, p0=point, t_end="100",
        parameters=dict.fromkeys(names, Parameter(value="0.125")),
        source="drawn at random: nearharmonic_studies.trained.problems.rings",
    )  # fmt: skip


def _bond(d: Any, c: Any) -> Any:
    square = d * d
    return square * (0.5 - 0.5 * d + c * square)


def ring_ensemble(count: int, seed: int, *, band: tuple[float, float], t_end: float) -> Ensemble:
    """Return ``count`` rings with their starts.

    ``band`` are the bounds of the rms change of a bond, and ``t_end`` the length of every run, in radians of the
    highest frequency.
    """
    random = np.random.default_rng([seed, SITES, count])
    strength = _log_uniform(random, band, count)
    masses = np.ones((count, SITES))
    masses[:, 1::2] = _log_uniform(random, (1.0, RATIO), (count, 1))
    k = _log_uniform(random, BONDS, (count, SITES))
    w = 1 / np.sqrt(masses)
    squares, modes = eigen(_hessians(w, k))
    w /= np.sqrt(squares[:, -1:])
    frequencies = np.sqrt(squares[:, 1:] / squares[:, -1:])
    start = np.zeros((count, 4, SITES))
    parameters = np.zeros((count, 2 * SITES + 1, 2))
    parameters[:, :, 0] = np.concatenate([w, k, random.uniform(*QUARTIC, (count, 1))], axis=1)
    for i in range(count):
        phonons = modes[i, :, 1:].T
        changes = w[i] * phonons / frequencies[i, :, None]
        rms = np.sqrt(np.mean(np.sum((np.roll(changes, -1, axis=1) - changes) ** 2, axis=0)))
        scaled = strength[i] / rms * random.normal(size=(2, SITES - 1))
        start[i, 0] = product(scaled[0] / frequencies[i], phonons)
        start[i, 2] = product(scaled[1], phonons)
    return Ensemble(
        name=f"rings, {band[0]:g} to {band[1]:g}", system=ring(), start=start.reshape(count, -1),
        parameters=parameters.reshape(count, -1), t_end=t_end, strength=strength,
    )  # fmt: skip


def _log_uniform(random: np.random.Generator, bounds: tuple[float, float], shape: int | tuple[int, ...]) -> Floats:
    low, high = map(log, bounds)
    return np.asarray(exp(random.uniform(low, high, shape)))


def _hessians(w: Floats, k: Floats) -> Floats:
    """Return V'' (count, n, n) at rest."""
    n, after = w.shape[1], np.roll(w, -1, axis=1)
    found = np.zeros((len(w), n, n))
    for i in range(n):
        j = (i + 1) % n
        found[:, i, i] += k[:, i] * w[:, i] ** 2
        found[:, j, j] += k[:, i] * after[:, i] ** 2
        found[:, i, j] -= k[:, i] * w[:, i] * after[:, i]
        found[:, j, i] = found[:, i, j]
    return found
