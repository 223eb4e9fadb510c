"""Initial conditions of Kepler orbits."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import cos, sin
from nearharmonic.numerics.types import Floats


def kepler_apoapsis(eccentricity: Floats, orientation: Floats | float = 0.0) -> Floats:
    """Return starts (n, 8), laid out for the kernel, at the apoapsis of orbits of semi-major axis 1 with GM = 1.

    Parameters
    ----------
    eccentricity : array of shape (n,)
        Eccentricity of each orbit, at least 0 and below 1.
    orientation : array of shape (n,) or float
        Direction from the centre to the apoapsis in rad.
    """
    e = np.asarray(eccentricity, dtype=np.float64)
    cosine, sine = cos(orientation), sin(orientation)
    distance, speed = 1 + e, np.sqrt((1 - e) / (1 + e))
    starts = np.zeros((e.size, 8))
    starts[:, 0], starts[:, 1] = distance * cosine, distance * sine
    starts[:, 4], starts[:, 5] = -speed * sine, speed * cosine
    return starts
