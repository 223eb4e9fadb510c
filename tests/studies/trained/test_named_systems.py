"""Systems with a name: their formulas against closed forms and published numbers, their starts, their units."""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt

import numpy as np
import pytest

from nearharmonic.training.objective import Ensemble
from nearharmonic_studies.trained.problems import (
    ALPHA,
    ATOMS,
    BETA,
    CHAIN_SITES,
    NAMED,
    RING,
    WELL,
    anharmonicities,
    hessians,
    named_ensemble,
)

BY_NAME = {one.name: one for one in NAMED}


def potential(name, q):
    """V by the formulas of textbooks, in numpy."""
    wall = np.diff(np.concatenate([[0], q, [0]]))
    r6 = (1 + wall) ** -6.0
    return {
        "pendulum": 1 - cos(q[0]),
        "morse": 1 - 2 * exp(-q[0]) + exp(-2 * q[0]),
        "quartic_well": (q @ q) / 2 + WELL * (q @ q) ** 2,
        "henon_heiles": (q @ q) / 2 + q[0] ** 2 * q[-1] - q[-1] ** 3 / 3,
        "toda": (np.exp(q - np.roll(q, -1)) - 1).sum(),
        "lennard_jones": (r6 * r6 - 2 * r6 + 1).sum() / 72,
        "fput_alpha": (wall**2 / 2 + ALPHA * wall**3 / 3).sum(),
        "fput_beta": (wall**2 / 2 + BETA * wall**4 / 4).sum(),
    }[name]


#: The largest frequency of small oscillations: of springs between fixed ends 2 cos(pi / (2 n + 2)), of a ring 2.
FASTEST = {
    "pendulum": 1.0, "morse": sqrt(2), "quartic_well": 1.0, "henon_heiles": 1.0, "toda": 2.0,
    "lennard_jones": 2 * cos(pi / (2 * ATOMS + 2)), "fput_alpha": 2 * cos(pi / (2 * CHAIN_SITES + 2)),
    "fput_beta": 2 * cos(pi / (2 * CHAIN_SITES + 2)),
}  # fmt: skip


@pytest.mark.parametrize("name", BY_NAME)
def test_potentials_are_those_of_textbooks_and_rest_at_0(name):
    one = BY_NAME[name]
    random = np.random.default_rng(3)
    for scale in (0.0, 0.05, 0.2):
        q = random.normal(size=one.dimension) * scale
        assert one.system().V(tuple(q)) == pytest.approx(potential(name, q), rel=1e-9, abs=1e-15)
    here = np.zeros(one.dimension)
    h = 1e-5
    for i in range(one.dimension):
        step = h * np.eye(one.dimension)[i]
        assert abs(potential(name, here + step) - potential(name, here - step)) < 1e-14


@pytest.mark.parametrize("name", BY_NAME)
def test_hessians_are_second_differences_of_the_potential(name):
    """Error of fourth order in the spacing, h^4 times sixth derivatives, and rounding of V over h^2: 1e-6."""
    one = BY_NAME[name]
    q = np.random.default_rng(4).normal(size=one.dimension) * 0.05
    found, h = hessians(one.system(), q[None, :])[0], 2e-3
    unit = np.eye(one.dimension) * h
    for i in range(one.dimension):
        for j in range(one.dimension):
            shifted = [
                a * b * potential(name, q + a * unit[i] * s + b * unit[j] * s)
                for s in (1, 2) for a in (1, -1) for b in (1, -1)
            ]  # fmt: skip
            near, far = sum(shifted[:4]) / (4 * h * h), sum(shifted[4:]) / (16 * h * h)
            assert found[i, j] == pytest.approx((4 * near - far) / 3, abs=2e-5), (i, j)


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NAME)
def test_unit_of_time_is_radian_of_fastest_small_oscillation(name):
    ensemble = named_ensemble(BY_NAME[name], 4, 1, 100.0)
    assert ensemble.unit * FASTEST[name] == pytest.approx(1, rel=1e-12)
    assert ensemble.t_end == pytest.approx(100 / FASTEST[name], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NAME)
def test_starts_have_energies_that_are_log_uniform_in_stated_range(name):
    """The largest distance of 400 sorted uniform numbers from the diagonal exceeds 0.08 once in a hundred draws."""
    one, count = BY_NAME[name], 400
    ensemble = named_ensemble(one, count, 5, 100.0)
    start = ensemble.start.reshape(count, 4, -1)
    assert not start[:, [1, 3]].any()
    energy = np.array([potential(name, q) + (p @ p) / 2 for q, p in zip(start[:, 0], start[:, 2], strict=True)])
    low, high = np.log(one.energies)
    share = np.sort((np.log(energy) - low) / (high - low))
    assert share[0] >= -1e-9
    assert share[-1] <= 1 + 1e-9
    assert np.abs(share - (np.arange(count) + 0.5) / count).max() < 0.08


@pytest.mark.slow
def test_starts_are_first_places_on_their_ray_with_their_energy():
    """On the way there H is below: beyond the saddles of Henon-Heiles are places with the same energy."""
    for name in ("henon_heiles", "morse", "lennard_jones"):
        ensemble = named_ensemble(BY_NAME[name], 50, 6, 100.0)
        for row in ensemble.start.reshape(50, 4, -1):
            q, p = row[0], row[2]
            rays = [potential(name, s * q) + s * s * (p @ p) / 2 for s in np.linspace(0, 1, 200)]
            assert (np.diff(rays) > 0).all(), name


def test_directions_fill_the_energy_surface_of_small_oscillations_evenly():
    """Each of the 2 d squares of normalised coordinates is 1/2d in the mean, to 4 deviations of 2000 draws."""
    one = BY_NAME["fput_alpha"]
    ensemble = named_ensemble(one, 2000, 7, 100.0)
    start = ensemble.start.reshape(2000, 4, -1)
    modes = np.array(
        [[sin(pi * i * k / (CHAIN_SITES + 1)) for i in range(1, CHAIN_SITES + 1)] for k in range(1, CHAIN_SITES + 1)]
    )
    modes *= sqrt(2 / (CHAIN_SITES + 1))
    frequencies = 2 * np.sin(pi * np.arange(1, CHAIN_SITES + 1) / (2 * CHAIN_SITES + 2))
    parts = np.concatenate([(start[:, 0] @ modes.T * frequencies) ** 2, (start[:, 2] @ modes.T) ** 2], axis=1)
    share = (parts / parts.sum(axis=1, keepdims=True)).mean(axis=0)
    assert share == pytest.approx(1 / (2 * CHAIN_SITES), abs=4 * sqrt(2) / (2 * CHAIN_SITES) / sqrt(2000))


def test_ring_of_toda_has_neither_momentum_nor_displacement_of_whole():
    start = named_ensemble(BY_NAME["toda"], 20, 8, 100.0).start.reshape(20, 4, RING)
    assert np.abs(start.sum(axis=2)).max() < 1e-13


def single(system, q0):
    """delta of a run from rest over 100 periods."""
    start = np.zeros((1, 4))
    start[0, 0] = q0
    given = np.empty((1, 0))
    return anharmonicities(Ensemble(name="", system=system, start=start, parameters=given, t_end=400.0))[0]


@pytest.mark.slow
def test_anharmonicity_of_small_oscillation_follows_from_its_fourth_derivative():
    """V'' = 1 - q^2/2 on q = a cos t: rms of a^2 cos(2 t)/4 over 1, to the relative order a^2."""
    assert single(BY_NAME["pendulum"].system(), 0.05) == pytest.approx(0.05**2 / 4 / sqrt(2), rel=5e-3)
