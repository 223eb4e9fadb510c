"""Random near-harmonic systems: their potential, its lower bound, and the distributions that they are drawn from."""

from __future__ import annotations

from math import comb, erf, sqrt

import numpy as np
import pytest
from scipy.stats import kstest

from nearharmonic_studies.trained.problems import random_ensemble, random_potential

BAND = (0.01, 0.5)


def drawn(dimension, count=2000, seed=1, band=BAND):
    return random_ensemble(dimension, count, seed, band=band, t_end=100.0)


def coefficients(ensemble):
    """Values of all problems, by name."""
    values = ensemble.parameters.reshape(ensemble.size, -1, 2)
    assert (values[:, :, 1] == 0).all()
    return dict(zip(ensemble.system.parameters, values[:, :, 0].T, strict=True))


def potential(of, q):
    """V as the docstring writes it, for q (d, ...) and coefficients of one problem or of all of them."""
    d = len(q)
    total = 0.0
    for i in range(d):
        inner = of[f"a{i}"] / 2
        for j in range(d):
            inner = inner + of[f"c{i}{j}"] * q[j]
        for j in range(i, d):
            inner = inner + of[f"e{i}{j}"] * q[j] ** 2
        total = total + q[i] ** 2 * inner
    if d == 3:
        total = total + of["c012"] * q[0] * q[1] * q[2]
    return total


def normal(x):
    return (1 + np.vectorize(erf)(x / sqrt(2))) / 2


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_there_is_a_coefficient_for_every_term(dimension):
    names = list(random_potential(dimension).parameters)
    terms = dimension + dimension**2 + comb(dimension + 1, 2) + comb(dimension, 3)
    assert len(names) == len(set(names)) == terms


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_potential_is_the_one_that_the_docstring_writes(dimension):
    ensemble = drawn(dimension, 5)
    of = coefficients(ensemble)
    random = np.random.default_rng(2)
    for m in range(5):
        one = {name: values[m] for name, values in of.items()}
        q = random.normal(size=dimension)
        wanted = potential(one, q)
        assert ensemble.system.V(tuple(q), *one.values()) == pytest.approx(wanted, rel=1e-13)
        slope = ensemble.system.grad_V(tuple(q), *one.values())
        for i, e in enumerate(np.eye(dimension)):
            # An imaginary step differentiates to all digits.
            assert slope[i] == pytest.approx(potential(one, q + 1e-40j * e).imag / 1e-40, rel=1e-12, abs=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_every_potential_is_bounded_from_below(dimension):
    ensemble = drawn(dimension, 500, band=(1e-3, 2.0))
    of = coefficients(ensemble)
    directions = np.random.default_rng(3).normal(size=(200, dimension))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for u in [*directions, *np.eye(dimension)]:
        quartic = sum(of[f"e{i}{j}"] * u[i] ** 2 * u[j] ** 2 for i in range(dimension) for j in range(i, dimension))
        # Along a ray V = a r^2 + c r^3 + e r^4 >= (a - c^2 / 4 e) r^2: e is at least s/10 times sum_i u_i^4.
        assert (quartic >= 0.1 * ensemble.strength * (u**4).sum() * (1 - 1e-12)).all()
        far = potential(of, u[:, None] * 1e4)
        assert (far > 0).all()


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_strengths_are_uniform_in_their_logarithm(dimension):
    strength = drawn(dimension).strength
    assert BAND[0] <= strength.min()
    assert strength.max() <= BAND[1]
    assert kstest(np.log(strength), "uniform", args=(np.log(BAND[0]), np.log(BAND[1] / BAND[0]))).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_one_frequency_is_one_and_the_others_are_uniform(dimension):
    of = coefficients(drawn(dimension))
    w = np.sqrt([of[f"a{i}"] for i in range(dimension)])
    assert ((w == 1).sum(axis=0) == 1).all()
    which = np.bincount((w == 1).argmax(axis=0), minlength=dimension) / 2000
    assert which == pytest.approx(1 / dimension, abs=0.05)  # more than four standard deviations
    others = w[w != 1]
    assert kstest(others, "uniform", args=(0.2, 0.8)).pvalue > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_cubic_and_quartic_coefficients_are_normal_times_the_strength(dimension):
    ensemble = drawn(dimension)
    for name, values in coefficients(ensemble).items():
        scaled = values / ensemble.strength
        if name[0] == "c":
            assert kstest(scaled / 0.4, normal).pvalue > 1e-4, name
        if name[0] == "e":
            assert scaled.min() > 0.1 * (1 - 1e-12)
            assert kstest((scaled - 0.1) / 0.4, lambda x: 2 * normal(x) - 1).pvalue > 1e-4, name


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_amplitudes_phases_and_simplex_shares_are_uniform(dimension):
    ensemble = drawn(dimension)
    of = coefficients(ensemble)
    start = ensemble.start.reshape(-1, 4, dimension)
    assert (start[:, [1, 3]] == 0).all()
    w = np.sqrt([of[f"a{i}"] for i in range(dimension)]).T
    q, p = start[:, 0] * np.maximum(w, 0.5), start[:, 2]
    squares = q**2 + p**2
    amplitude = np.sqrt(squares.sum(axis=1))
    assert kstest(amplitude, "uniform", args=(0.4, 0.6)).pvalue > 1e-3
    # A share of the uniform distribution on the simplex exceeds x with the probability (1 - x)^(d - 1).
    for i in range(dimension):
        shares = squares[:, i] / amplitude**2
        assert kstest(shares, lambda x: 1 - (1 - x) ** (dimension - 1)).pvalue > 1e-3
        assert kstest(np.arctan2(p[:, i], q[:, i]), "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 1e-3


def test_one_seed_gives_same_systems_and_others_none_of_them():
    one, again, other = drawn(2, 50, 1), drawn(2, 50, 1), drawn(2, 50, 2)
    for name in ("start", "parameters", "strength"):
        first = getattr(one, name)
        assert first.tobytes() == getattr(again, name).tobytes()
        assert not (first[:, None] == getattr(other, name)[None]).reshape(50, 50, -1).all(axis=2).any()
    assert not np.isin(one.strength, drawn(2, 51, 1).strength).any()
    assert not np.isin(one.strength, drawn(3, 50, 1).strength).any()
