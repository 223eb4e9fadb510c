"""Near-harmonic systems with cubic potentials, drawn at random.

    V = sum_i w_i^2 q_i^2 / 2 + sum_(i <= j <= k) c_ijk q_i q_j q_k

One frequency is 1, the others are uniform in [0.6, 1]. Along a direction n the potential falls beyond a barrier of the
height w(n)^6 / (54 c(n)^2), with w(n)^2 = sum w_i^2 n_i^2 and c(n) the cubic form. The coefficients are normal, scaled
so that the energy of the start is a fraction of the lowest barrier, log-uniform in a band: no orbit escapes. For the
system of Henon & Heiles (1964), doi:10.1086/109234, the barrier is 1/6. The amplitude is 1, its square distributed over
the coordinates uniformly on the simplex; phases are uniform.
"""

from __future__ import annotations

from functools import cache
from itertools import combinations_with_replacement
from math import prod
from typing import Any

import numpy as np

from nearharmonic.math import cos, exp, log, sin
from nearharmonic.numerics.portable import Floats, product
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.system import System
from nearharmonic.training.population import Ensemble

#: Bounds of the slower frequencies.
CUBIC_FREQUENCIES = (0.6, 1.0)
#: Directions in which the barrier is sought.
DIRECTIONS = 400


def _monomials(dimension: int) -> list[tuple[int, ...]]:
    return list(combinations_with_replacement(range(dimension), 3))


@cache
def cubic_potential(dimension: int) -> System:
    """Return the system whose parameters are squares of frequencies, and cubic coefficients."""
    terms = _monomials(dimension)
    names = [f"a{i}" for i in range(dimension)] + ["c" + "".join(map(str, term)) for term in terms]

    def V(q: Any, *coefficients: Any) -> Any:
        squares, cubic = coefficients[:dimension], coefficients[dimension:]
        total = sum(a * x * x for a, x in zip(squares, q, strict=True)) / 2
        return total + sum(c * prod(q[i] for i in term) for c, term in zip(cubic, terms, strict=True))

    point = ["0.25"] * dimension
    return System(
        name=f"cubic_potential_{dimension}", label=f"cubic potential, d = {dimension}", V=V, q0=tuple(point),
        p0=tuple(point), t_end="100", parameters=dict.fromkeys(names, Parameter(value="0.125")),
        source="drawn at random: nearharmonic_studies.trained.problems.cubic_potentials",
    )  # fmt: skip


def cubic_ensemble(dimension: int, count: int, seed: int, *, band: tuple[float, float], t_end: float) -> Ensemble:
    """Return ``count`` random systems of 2 or 3 coordinates with their starts.

    ``band`` are the bounds of the energy over the lowest barrier, and ``t_end`` the length of every run, in radians of
    the frequency 1.
    """
    system, random = cubic_potential(dimension), np.random.default_rng([seed, dimension, count, 3])
    terms = np.array(_monomials(dimension))
    start = np.zeros((count, 4, dimension))
    parameters = np.zeros((count, len(system.parameters), 2))
    low, high = map(log, band)
    fraction = exp(random.uniform(low, high, count))
    for i, part in enumerate(fraction):
        w: Floats = random.uniform(*CUBIC_FREQUENCIES, dimension)
        w[random.integers(dimension)] = 1.0
        n: Floats = random.normal(size=(DIRECTIONS, dimension))
        cubic: Floats = random.normal(size=len(terms))
        amplitude = np.sqrt(random.dirichlet(np.ones(dimension)))
        phase = random.uniform(0.0, 2 * np.pi, dimension)
        q, p = amplitude * cos(phase) / w, amplitude * sin(phase)
        scale = _scale(n, w * w, terms, cubic, q, part)
        parameters[i, :, 0] = np.concatenate([w**2, scale * cubic])
        start[i, 0], start[i, 2] = q, p
    return Ensemble(
        name=f"d = {dimension}, {band[0]:g} to {band[1]:g}", system=system, start=start.reshape(count, -1),
        parameters=parameters.reshape(count, -1), t_end=t_end, strength=fraction,
    )  # fmt: skip


def _scale(n: Floats, squares: Floats, terms: Any, cubic: Floats, q: Floats, fraction: float) -> float:
    """The factor of the cubic coefficients with which 1/2 + |cubic energy| at the start is ``fraction`` of the barrier.

    The harmonic energy of every start is 1/2.
    """
    along = product(n[:, terms].prod(axis=-1), cubic[:, None])[:, 0]
    lowest = float((product(n * n, squares[:, None])[:, 0] ** 3 / (54 * along**2)).min())
    own = abs(float((cubic * q[terms].prod(axis=-1)).sum()))
    # (1/2 + own s) s^2 = fraction * lowest; Newton's method from above, where the function is convex.
    s: float = (2 * fraction * lowest) ** 0.5
    for _ in range(30):
        s -= ((0.5 + own * s) * s * s - fraction * lowest) / (s + 3 * own * s * s)
    return s
