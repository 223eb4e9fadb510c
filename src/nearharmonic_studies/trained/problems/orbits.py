"""Kepler orbits of random eccentricity, in the plane, of semi-major axis 1 and period 2 pi."""

from __future__ import annotations

import numpy as np

from nearharmonic.engine.numbers import parameter_array
from nearharmonic.math import cos, sin
from nearharmonic.systems import kepler
from nearharmonic.training.population import Ensemble

#: Number of Newton steps that solve Kepler's equation to double precision from E = M, for e below 0.9.
ITERATIONS = 12


def orbit_ensemble(count: int, seed: int, *, eccentricities: tuple[float, float], orbits: float) -> Ensemble:
    """Return ``count`` orbits that start anywhere on their ellipses, over ``orbits`` periods.

    The eccentricity is uniform between the bounds ``eccentricities``.
    """
    random = np.random.default_rng([seed, count])
    e = random.uniform(*eccentricities, count)
    M, turn = random.uniform(0.0, 2 * np.pi, (2, count))
    E = M.copy()
    for _ in range(ITERATIONS):
        E -= (E - e * sin(E) - M) / (1 - e * cos(E))
    b, rate = np.sqrt(1 - e * e), 1 / (1 - e * cos(E))
    q, p = (cos(E) - e, b * sin(E)), (-sin(E) * rate, b * cos(E) * rate)
    cosine, sine = cos(turn), sin(turn)
    start = np.zeros((count, 4, 2))
    for row, (x, y) in ((0, q), (2, p)):
        start[:, row] = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
    return Ensemble(
        name=f"Kepler, e {eccentricities[0]:g} to {eccentricities[1]:g}", system=kepler.SYSTEM,
        start=start.reshape(count, -1), parameters=parameter_array(kepler.SYSTEM, {"GM": 1}),
        t_end=2 * np.pi * orbits, strength=e,
    )  # fmt: skip
