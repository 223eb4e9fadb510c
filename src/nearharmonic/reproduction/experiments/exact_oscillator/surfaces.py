"""Starts on energy surfaces of the Henon-Heiles system, small ones and large ones alike."""

from __future__ import annotations

import numpy as np

from nearharmonic.math import cos, sin
from nearharmonic.numerics.quasi_random import quasi_random
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.henon_heiles import SYSTEM


def radius(energy: float) -> float:
    """Return the largest |q| on the bounded part of V <= ``energy``, where r^2/2 - r^3/3 = ``energy`` and r <= 1."""
    lowest, highest = 0.0, 1.0
    for _ in range(60):
        r = (lowest + highest) / 2
        lowest, highest = (r, highest) if r * r / 2 - r * r * r / 3 < energy else (lowest, r)
    return highest


def starts_on(energy: float, count: int, seed: int) -> Floats:
    """Return starts (count, 8), laid out for the kernel, in the microcanonical measure of H = ``energy``.

    The position is uniform where V < ``energy``, the direction of the momentum uniform on the circle. Surfaces of
    different energies have nearly the same points, in units of their radius.

    Parameters
    ----------
    energy : float
        Above 0 and at most 1/6, the energy of escape.
    count : int
        Number of starts.
    seed : int
        Chooses the quasi-random points.
    """
    side = radius(energy)
    u = quasi_random(8 * count + 64, 3, seed)  # at least 1/4 of the square is inside
    x, y = ((2 * u[:, k] - 1) * side for k in range(2))
    kinetic = energy - SYSTEM.V((x, y))
    kept = np.flatnonzero((kinetic > 0) & (x * x + y * y <= side * side))[:count]
    momentum, angle = np.sqrt(2 * kinetic[kept]), 2 * np.pi * u[kept, 2]
    starts = np.zeros((count, 8))
    starts[:, 0], starts[:, 1] = x[kept], y[kept]
    starts[:, 4], starts[:, 5] = momentum * cos(angle), momentum * sin(angle)
    return starts
