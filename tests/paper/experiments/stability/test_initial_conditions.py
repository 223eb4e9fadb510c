"""Initial conditions against the recurrence in multiprecision, the energy's own formula, and quadrature."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from mpmath import findroot, mpf

from nearharmonic.numerics.portable import quasi_random
from nearharmonic_paper.experiments.stability.run import henon_heiles_surface, kepler_apoapsis

SURFACES = [Fraction(1, 24), Fraction(1, 12), Fraction(1, 8), Fraction(1, 6)]


def potential(x, y):
    return 0.5 * (x**2 + y**2) + x**2 * y - y**3 / 3


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_points_follow_the_recurrence_of_the_generalised_golden_ratio(dimension):
    points = quasi_random(1000, dimension, seed=3)
    phi = findroot(lambda x: x ** (dimension + 1) - x - 1, 1.5)
    for k in range(dimension):
        for n in (1, 10, 999):
            expected = (mpf(points[0, k]) + n * phi ** -(k + 1)) % 1
            # Points are cut to 53 bits, alpha is odd in the 64th: 2^-53 at either end, n 2^-63 between.
            assert abs(points[n, k] - expected) < mpf(2) ** -52 + n * mpf(2) ** -62


def test_same_seed_gives_same_points_and_another_seed_others():
    assert np.array_equal(quasi_random(50, 3, 7), quasi_random(50, 3, 7))
    assert np.array_equal(quasi_random(50, 3, 7), quasi_random(80, 3, 7)[:50])
    assert np.abs(quasi_random(50, 3, 7) - quasi_random(50, 3, 8)).min() > 1e-6


def test_points_fill_the_interval_more_evenly_than_random_ones():
    """Star discrepancy of 4096 points: random ones have 0.9/sqrt(n) = 0.013, the recurrence a few log(n)/n = 0.002."""
    points = np.sort(quasi_random(4096, 3, 1), axis=0)
    rank = np.arange(4096)[:, None]
    discrepancy = np.maximum((rank + 1) / 4096 - points, points - rank / 4096).max(axis=0)
    assert (points >= 0).all()
    assert (points < 1).all()
    assert discrepancy.max() < 0.004


@pytest.mark.parametrize("energy", SURFACES)
def test_starts_lie_on_the_bounded_part_of_their_energy_surface(energy):
    x, y, _, _, u, v, _, _ = henon_heiles_surface(energy, 2000, 1).T
    # H is a sum of a dozen terms below 1/2, each rounded: 12 * 1.1e-16 / 2.
    assert np.abs((u**2 + v**2) / 2 + potential(x, y) - float(energy)).max() < 7e-16
    # The triangle of the saddle points (0, 1), (+-sqrt(3)/2, -1/2).
    assert (y >= -0.5).all()
    assert (np.sqrt(3) * np.abs(x) <= 1 - y).all()


@pytest.mark.parametrize("energy", SURFACES)
def test_starts_have_the_microcanonical_measure(energy):
    """Moments of q by quadrature over the area V < H, a midpoint rule of 1e6 cells; directions by Fourier's modes."""
    x, y, _, _, u, v, _, _ = henon_heiles_surface(energy, 4096, 1).T
    side = np.linspace(-1, 1, 1001)[:-1] + 1 / 1000
    X, Y = np.meshgrid(side, side)
    inside = (potential(X, Y) < float(energy)) & (Y > -0.5) & (np.sqrt(3) * np.abs(X) < 1 - Y)
    for moment in (lambda x, y: x**2, lambda x, y: y**2, potential):
        expected = moment(X, Y)[inside].mean()
        # Random points would miss by 1/sqrt(4096) = 1.6 %; quasi-random ones by ten times less.
        assert moment(x, y).mean() == pytest.approx(expected, rel=4e-3)
    angle = np.arctan2(v, u)  # random directions would average to 1/sqrt(4096) = 0.016
    for mode in (1, 2, 3):
        assert abs(np.exp(1j * mode * angle).mean()) < 8e-3
        assert abs((np.exp(1j * mode * angle) * y).mean()) < 8e-3


def test_kepler_orbits_start_at_apoapsis_with_requested_eccentricity():
    e, orientation = np.array([0.0, 0.3, 0.99]), np.array([0.0, 1.0, 4.0])
    x, y, _, _, u, v, _, _ = kepler_apoapsis(e, orientation).T
    r = np.hypot(x, y)
    assert (u**2 + v**2) / 2 - 1 / r == pytest.approx(-0.5, rel=1e-14)
    assert r == pytest.approx(1 + e, rel=1e-15)
    assert x * u + y * v == pytest.approx(0, abs=1e-15)
    assert x * v - y * u == pytest.approx(np.sqrt(1 - e**2), rel=1e-14)
    assert np.arctan2(y, x) % (2 * np.pi) == pytest.approx(orientation, abs=1e-15)
