"""Random cubic potentials: their barriers, against the closed form for Henon-Heiles and a search by scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from nearharmonic_studies.trained import problems as made

BAND = (0.05, 0.75)


@pytest.fixture(scope="module", params=[2, 3])
def ensemble(request):
    return made.cubic_ensemble(request.param, 24, 11, band=BAND, t_end=30.0)


def test_barrier_of_henon_and_heiles_is_a_sixth():
    terms = made._monomials(2)
    cubic = np.array([{(0, 0, 1): 1.0, (1, 1, 1): -1 / 3}.get(term, 0.0) for term in terms])
    angles = np.linspace(0, np.pi, 720, endpoint=False) + np.pi / 1440  # halves of a degree, but none without a barrier
    n = np.stack([np.cos(angles + np.pi / 1440), np.sin(angles + np.pi / 1440)], axis=1)
    for q in (np.zeros(2), np.array([0.3, 0.1])):
        scale = made._scale(n, np.ones(2), np.array(terms), cubic, q, 0.5)
        own = abs(cubic @ np.prod(q[np.array(terms)], axis=-1))
        # Scaled by s, the barrier is 1 / (6 s^2), which the energy has to be half of.
        assert (0.5 + own * scale) * scale**2 == pytest.approx(0.5 / 6, rel=1e-12)


@pytest.mark.slow
def test_no_orbit_has_the_energy_to_escape(ensemble):
    system, d = ensemble.system, ensemble.system.dimension
    random = np.random.default_rng(2)
    for start, parameters in zip(ensemble.start, ensemble.parameters, strict=True):
        given = parameters[::2]
        q, p = start[:d], start[2 * d : 3 * d]
        energy = p @ p / 2 + system.V(q, *given)

        def barrier(x, given=given):
            n = x / np.linalg.norm(x)
            square, cubic = given[:d] @ n**2, system.V(n, *[0.0] * d, *given[d:])
            return square**3 / (54 * cubic**2)

        lowest = min(minimize(barrier, random.normal(size=d), method="Nelder-Mead").fun for _ in range(12))
        # Directions are 400 random ones: the lowest barrier that they find is a few per cent too high at most.
        assert energy < BAND[1] * 1.1 * lowest
        assert energy > 0


def test_seed_and_size_determine_the_draw():
    one, same, other = (made.cubic_ensemble(2, 5, seed, band=BAND, t_end=30.0) for seed in (1, 1, 2))
    assert np.array_equal(one.parameters, same.parameters)
    assert not np.array_equal(one.parameters, other.parameters)
