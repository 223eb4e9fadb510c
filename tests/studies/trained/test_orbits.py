"""Random Kepler orbits: energy, eccentricity vector and Kepler's equation, and the distributions of their elements."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import atan2, cos, mp, mpf, sin, sqrt

from nearharmonic_studies.trained.problems import orbit_ensemble

BOUNDS = (0.02, 0.35)


def drawn(count=1000, seed=1, eccentricities=BOUNDS):
    return orbit_ensemble(count, seed, eccentricities=eccentricities, orbits=20)


def states(ensemble):
    start = ensemble.start.reshape(-1, 4, 2)
    assert (start[:, [1, 3]] == 0).all()
    return start[:, 0], start[:, 2]


def elements(ensemble):
    """Energy and eccentricity vector of each orbit, from its state alone."""
    q, p = states(ensemble)
    r = np.linalg.norm(q, axis=1)
    moment = q[:, 0] * p[:, 1] - q[:, 1] * p[:, 0]
    vector = np.stack([p[:, 1] * moment, -p[:, 0] * moment], axis=1) - q / r[:, None]
    return (p**2).sum(axis=1) / 2 - 1 / r, vector


@pytest.mark.parametrize("eccentricities", [BOUNDS, (0.0, 1e-3), (0.8, 0.89)])
def test_energy_follows_from_axis_one_and_eccentricity_from_draw(eccentricities):
    ensemble = drawn(eccentricities=eccentricities)
    energy, vector = elements(ensemble)
    # 1/r reaches 10 for the largest eccentricities.
    assert np.abs(energy + 0.5).max() < 2e-14
    assert np.abs(np.linalg.norm(vector, axis=1) - ensemble.strength).max() < 2e-14
    assert eccentricities[0] <= ensemble.strength.min()
    assert ensemble.strength.max() <= eccentricities[1]


def test_orbits_run_against_the_clock():
    q, p = states(drawn())
    assert (q[:, 0] * p[:, 1] > q[:, 1] * p[:, 0]).all()


@pytest.mark.parametrize("eccentricities", [BOUNDS, (0.8, 0.89)])
def test_positions_solve_keplers_equation_for_mean_anomaly_that_was_drawn(eccentricities):
    ensemble = drawn(50, eccentricities=eccentricities)
    random = np.random.default_rng([1, 50])
    random.uniform(*eccentricities, 50)
    M, turn = random.uniform(0.0, 2 * np.pi, (2, 50))
    q, _ = states(ensemble)
    for m in range(50):
        with mp.workdps(40):
            e, angle = mpf(ensemble.strength[m]), mpf(turn[m])
            x, y = map(mpf, q[m])
            along, across = cos(angle) * x + sin(angle) * y, cos(angle) * y - sin(angle) * x
            E = atan2(across / sqrt(1 - e * e), along + e)
            assert abs(sin((E - e * sin(E) - mpf(M[m])) / 2)) < mpf(10) ** -14 / 2
    _, vector = elements(ensemble)
    turned = np.arctan2(vector[:, 1], vector[:, 0])
    assert np.abs(np.angle(np.exp(1j * (turned - turn)))).max() < 1e-12


def test_runs_cover_given_periods_with_unit_mass():
    ensemble = drawn(3)
    assert ensemble.t_end == pytest.approx(40 * np.pi, rel=1e-15)
    assert next(iter(ensemble.system.parameters)) == "GM"
    assert ensemble.parameters.reshape(-1)[0] == 1.0
    assert ensemble.name == "Kepler, e 0.02 to 0.35"


def test_one_seed_gives_same_orbits_and_another_none_of_them():
    one, again, other = drawn(50, 1), drawn(50, 1), drawn(50, 2)
    assert one.start.tobytes() == again.start.tobytes()
    assert not np.isin(one.strength, other.strength).any()
    assert not np.isin(one.strength, drawn(51, 1).strength).any()
