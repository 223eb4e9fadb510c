"""Starts of a search: their energies, their distance from the orbit, their halves, and the frequency of the orbit."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.errors import SettingError
from nearharmonic.training.question import HALF_EDGE, orbit_of, question, starts_of
from support.methods.own_systems import spring


def drawn(system, **settings):
    """The two halves as (q, p) of shape (M, d) each."""
    asked = question(system, **settings)
    orbit = orbit_of(asked.system)
    d = asked.system.dimension
    halves = starts_of(asked, orbit, 30.0 / orbit.frequency, 0.03 / orbit.frequency)
    return [(rows[:, :d], rows[:, 2 * d : 3 * d]) for rows in halves]


def test_starts_on_a_surface_have_its_energy():
    for energy, wanted in (("same", 0.125), (0.05, 0.05), (1e-4, 1e-4)):
        for q, p in drawn("henon_heiles", energy=energy):
            x, y = q.T
            H = (p * p + q * q).sum(axis=1) / 2 + x * x * y - y**3 / 3
            # rounding of some 80 bisections of a number of order 1, and of H itself
            assert np.abs(H / wanted - 1).max() < 1e-13
            assert len(H) == 32


def test_energy_surface_is_reached_for_non_quadratic_kinetic_energy_too():
    for q, p in drawn("relativistic_oscillator", energy="1.25"):
        H = np.sqrt(1 + p * p) + q * q / 2
        own = nh.systems["relativistic_oscillator"].energy(tuple(q.T), tuple(p.T))
        assert np.abs(own - 1.25).max() < 1e-13
        assert np.ptp(H - own[:, None]) < 1e-13  # the formula, up to the rest energy


def test_starts_of_box_are_near_orbit_and_their_energies_differ():
    for q, p in drawn("sho"):
        radius = np.hypot(q, p)
        # the orbit is the unit circle, the box has an edge of 2 * HALF_EDGE times amplitudes, which samples give to 2 %
        assert np.abs(radius - 1).max() < np.sqrt(2) * HALF_EDGE * 1.02
        assert 0.02 < radius.std() < 0.1


def test_halves_share_no_start_and_seed_gives_same_ones():
    one, two = drawn("henon_heiles", seed=1)
    assert not set(map(tuple, one[0])) & set(map(tuple, two[0]))
    again, _ = drawn("henon_heiles", seed=1)
    other, _ = drawn("henon_heiles", seed=2)
    assert (one[0] == again[0]).all()
    assert not (one[0] == other[0]).any()


def test_given_starts_are_divided_into_halves_by_seed():
    rows = np.column_stack([np.linspace(0.5, 1.5, 9), np.zeros(9)])
    chosen = set()
    for seed in range(4):
        (q, _), (also, _) = drawn("sho", starts=rows, seed=seed)
        assert len(q) == 5
        assert sorted([*q.ravel(), *also.ravel()]) == rows[:, 0].tolist()
        chosen.add(frozenset(q.ravel().tolist()))
    assert len(chosen) > 1


def test_a_given_start_that_leaves_is_named():
    rows = np.tile([0.1, 0.0, 0.0, 0.1], (9, 1))
    rows[5] = 0.0, 2.0, 0.0, 0.0  # behind the saddle at y = 1
    with pytest.raises(SettingError, match="the orbit of start 6 of 9 leaves its energy surface"):
        drawn("henon_heiles", starts=rows)


def test_energy_without_bound_orbits_and_one_below_potential_are_refused():
    with pytest.raises(SettingError, match=r"energy = 5\.0 is not allowed: one at which orbits of henon_heiles"):
        drawn("henon_heiles", energy=5)
    with pytest.raises(SettingError, match=r"energy = -1\.0 is not allowed: above 0\.00"):
        drawn("henon_heiles", energy=-1)


def test_a_start_at_rest_and_one_that_leaves_are_refused():
    with pytest.raises(SettingError, match="a start that moves"):
        orbit_of(spring(q0=("0",)))
    with pytest.raises(SettingError, match="a force that depends on the position"):
        orbit_of(spring(V=lambda q: 0 * q[0], grad_V=None, p0=("1",)))


def test_the_fastest_frequency_is_that_of_the_normal_modes():
    """M^-1 K by numpy's own solver; the products converge as (second / first eigenvalue)^40."""
    K = np.array([[3.0, -1.0, 0.2], [-1.0, 2.0, -0.5], [0.2, -0.5, 9.0]])
    masses = np.array([1.0, 0.5, 4.0])

    def V(q):
        return sum(float(K[i, j]) * q[i] * q[j] for i in range(3) for j in range(3)) / 2

    modes = spring("modes", V=V, grad_V=None, q0=("1", "0", "0.5"), p0=("0",) * 3, masses=("1", "0.5", "4"))
    expected = np.sqrt(np.linalg.eigvals(K / masses[:, None]).real.max())
    assert orbit_of(modes).frequency == pytest.approx(expected, rel=1e-6)


def test_fastest_frequency_is_smaller_for_non_quadratic_kinetic_energy():
    """T'' = (1 + p^2)^(-3/2), V'' = 1: the root of the mean of T'' over the states of the orbit."""
    orbit = orbit_of(nh.systems["relativistic_oscillator"])
    states = orbit.p[:: len(orbit.p) // 12]
    assert orbit.frequency == pytest.approx(np.sqrt(((1 + states**2) ** -1.5).mean()), rel=1e-5)
