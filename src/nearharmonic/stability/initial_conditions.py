"""Quasi-random initial conditions: the same seed gives the same bits on every machine."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from nearharmonic.errors import bad_setting
from nearharmonic.systems.henon_heiles import V

Floats = NDArray[np.float64]

#: The energy of the three saddle points of the Henon-Heiles potential: above it, the exact motion may escape.
ESCAPE_ENERGY = Fraction(1, 6)

#: Box around the triangle whose corners are the saddle points: |x| up to sqrt(3)/2, and y from -1/2 to 1.
_WIDTH, _HEIGHT, _LOWEST = 3**0.5, 1.5, -0.5


def quasi_random(count: int, dimension: int, seed: int) -> Floats:
    """``count`` points (count, dimension) of the additive recurrence x_n = x_0 + n alpha mod 1, in [0, 1).

    alpha_k = 1/phi^k with phi the root of phi^(dimension + 1) = phi + 1 (Roberts 2018, "The unreasonable effectiveness
    of quasirandom sequences"); ``seed`` chooses x_0. Computed in whole numbers modulo 2^64, hence exactly.
    """
    offset = np.array([_mixed(seed * dimension + k) for k in range(dimension)], dtype=np.uint64)
    index = np.arange(1, count + 1, dtype=np.uint64)[:, None]
    points = offset + index * np.array(_generators(dimension), dtype=np.uint64)  # wraps, as it should
    return np.asarray((points >> np.uint64(11)).astype(np.float64) / 2.0**53)


@cache
def _generators(dimension: int) -> tuple[int, ...]:
    """alpha_k 2^64 rounded to odd whole numbers, so that no power of two is a period."""
    with localcontext(prec=40):
        phi = Decimal(2)
        for _ in range(120):  # the iteration gains at least half a digit a time
            phi = (1 + phi) ** (Decimal(1) / (dimension + 1))
        return tuple(int(2**64 / phi ** (k + 1)) | 1 for k in range(dimension))


def _mixed(number: int) -> int:
    """64 well-mixed bits of a whole number: splitmix64 (Steele, Lea & Flood 2014, doi:10.1145/2660193.2660195)."""
    mask = 2**64 - 1
    z = (number + 1) * 0x9E3779B97F4A7C15 & mask
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & mask
    z = (z ^ z >> 27) * 0x94D049BB133111EB & mask
    return z ^ z >> 31


def henon_heiles_surface(energy: Fraction, count: int, seed: int) -> Floats:
    """``count`` starts (count, 8), laid out for the kernel, on the bounded part of the surface H = ``energy``.

    (x, y) is uniform in the area inside the zero-velocity curve, the direction of the momentum uniform on the circle,
    and |p| = sqrt(2 (energy - V)). In two dimensions this is the microcanonical (Liouville) measure, since
    integrating delta(p^2/2 + V - energy) p dp leaves 1 wherever V < energy.

    Raises:
        SettingError: ``energy`` is not above 0 and at most 1/6, the energy of escape.
    """
    if not 0 < energy <= ESCAPE_ENERGY:
        raise bad_setting("energy", str(energy), f"above 0 and at most {ESCAPE_ENERGY}, the energy of escape")
    drawn = 4 * count
    while True:
        u = quasi_random(drawn, 3, seed)
        x, y = (u[:, 0] - 0.5) * _WIDTH, u[:, 1] * _HEIGHT + _LOWEST
        kinetic = float(energy) - V((x, y))
        # V = 1/6 on the sides of the triangle and more beyond a single side; less again only beyond the box.
        inside = np.flatnonzero(kinetic > 0)
        if inside.size >= count:
            break
        drawn *= 2
    kept = inside[:count]
    momentum, angle = np.sqrt(2 * kinetic[kept]), 2 * np.pi * u[kept, 2]
    starts = np.zeros((count, 8))
    starts[:, 0], starts[:, 1] = x[kept], y[kept]
    starts[:, 4], starts[:, 5] = momentum * np.cos(angle), momentum * np.sin(angle)
    return starts


def kepler_apoapsis(eccentricity: Floats, orientation: Floats | float = 0.0) -> Floats:
    """Starts (n, 8) at the apoapsis of orbits of semi-major axis 1 with GM = 1 and the given ``eccentricity`` (n,).

    ``orientation`` (rad) is the direction from the centre to the apoapsis.
    """
    e = np.asarray(eccentricity, dtype=np.float64)
    cosine, sine = np.cos(orientation), np.sin(orientation)
    distance, speed = 1 + e, np.sqrt((1 - e) / (1 + e))
    starts = np.zeros((e.size, 8))
    starts[:, 0], starts[:, 1] = distance * cosine, distance * sine
    starts[:, 4], starts[:, 5] = -speed * sine, speed * cosine
    return starts
