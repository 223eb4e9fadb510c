"""Rings of masses as model crystals: their potential, phonons, and the distributions that they are drawn from."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from scipy.stats import kstest, norm

from nearharmonic_studies.trained.problems import SITES, ring_ensemble

BAND = (0.01, 0.15)


def drawn(count=400, seed=1, band=BAND, t_end=50.0):
    return ring_ensemble(count, seed, band=band, t_end=t_end)


def parts(ensemble):
    """Inverse roots of masses and strengths of bonds (problems, sites), and quartic coefficients (problems,)."""
    values = ensemble.parameters.reshape(ensemble.size, -1, 2)
    assert (values[:, :, 1] == 0).all()
    return values[:, :SITES, 0], values[:, SITES : 2 * SITES, 0], values[:, -1, 0]


def states(ensemble):
    """Positions and momenta (problems, sites)."""
    start = ensemble.start.reshape(-1, 4, SITES)
    assert (start[:, [1, 3]] == 0).all()
    return start[:, 0], start[:, 2]


def phonons(w, k):
    """Squared frequencies and modes by LAPACK, of the matrix that the bonds have by hand."""
    bonds = np.zeros((SITES, SITES))
    for i in range(SITES):
        bonds[i, i], bonds[i, (i + 1) % SITES] = -w[i], w[(i + 1) % SITES]
    return np.linalg.eigh(bonds.T @ np.diag(k) @ bonds)


def test_the_potential_is_the_one_that_the_docstring_writes():
    ensemble, random = drawn(4), np.random.default_rng(2)

    def potential(q, w, k, c):
        x = w * q
        d = np.append(x[1:], x[0]) - x
        return np.sum(k * (d**2 / 2 - d**3 / 2 + c * d**4))

    for w, k, c in zip(*parts(ensemble), strict=True):
        q, given = random.normal(size=SITES), (*w, *k, c)
        assert ensemble.system.V(tuple(q), *given) == pytest.approx(potential(q, w, k, c), rel=1e-13)
        slope = ensemble.system.grad_V(tuple(q), *given)
        for i, e in enumerate(np.eye(SITES)):
            # An imaginary step differentiates to all digits.
            assert slope[i] == pytest.approx(potential(q + 1e-40j * e, w, k, c).imag / 1e-40, rel=1e-12, abs=1e-12)


def test_quartic_coefficient_lies_between_morse_and_lennard_jones():
    # V = (1 - exp(-x))^2 is x^2 - x^3 + 7/12 x^4. V = r^-12 - 2 r^-6 at r = 1 + x is 36 x^2 - 252 x^3 + 1113 x^4.
    # In lengths for which the cubic term is half of the quadratic one, both quadratic terms being 1/2:
    morse, lennard_jones = 7 / 12 / 2, (1113 / 72) / (252 / 72 / 0.5) ** 2
    c = parts(drawn())[2]
    assert kstest(c, "uniform", args=(morse, lennard_jones - morse)).pvalue > 1e-3


def test_highest_frequency_is_one_and_one_mode_is_free():
    w, k, _ = parts(drawn(50))
    for row in zip(w, k, strict=True):
        squares, _ = phonons(*row)
        # 1e-12: Jacobi's rotations and LAPACK round differently.
        assert squares[-1] == pytest.approx(1.0, abs=1e-12)
        assert squares[0] == pytest.approx(0.0, abs=1e-12)
        assert squares[1] > 1e-3


def test_masses_take_turns_and_bonds_vary_as_stated():
    w, k, _ = parts(drawn())
    masses = w**-2.0
    assert masses[:, ::2] == pytest.approx(np.repeat(masses[:, :1], SITES // 2, axis=1), rel=1e-13)
    assert masses[:, 1::2] == pytest.approx(np.repeat(masses[:, 1:2], SITES // 2, axis=1), rel=1e-13)
    assert kstest(np.log(masses[:, 1] / masses[:, 0]), "uniform", args=(0, np.log(4))).pvalue > 1e-3
    assert kstest(np.log(k.ravel()), "uniform", args=(np.log(0.7), np.log(2))).pvalue > 1e-3


def test_strength_is_rms_change_of_bonds_in_equilibrium():
    ensemble = drawn(60)
    assert kstest(np.log(drawn().strength), "uniform", args=(np.log(0.01), np.log(15))).pvalue > 1e-3
    (w, k, _), (q, p) = parts(ensemble), states(ensemble)
    shares = []
    for i in range(ensemble.size):
        squares, modes = phonons(w[i], k[i])
        coordinates, momenta = (modes[:, 1:].T @ x[i] for x in (q, p))
        # Equilibrium at a temperature: the covariance of the bonds is that of the modes, temperature over squares.
        changes = np.roll(w[i][:, None] * modes[:, 1:], -1, axis=0) - w[i][:, None] * modes[:, 1:]
        root = ensemble.strength[i] / sqrt(np.mean(changes**2 @ (1 / squares[1:])))
        shares += [*(coordinates * np.sqrt(squares[1:]) / root), *(momenta / root)]
        assert p[i] @ (1 / w[i]) == pytest.approx(0.0, abs=1e-13)  # the total momentum
    assert kstest(shares, norm.cdf).pvalue > 1e-3


def test_one_seed_gives_same_rings_and_others_none_of_them():
    one, again, other = drawn(20, 1), drawn(20, 1), drawn(20, 2)
    for name in ("start", "parameters", "strength"):
        assert getattr(one, name).tobytes() == getattr(again, name).tobytes()
        assert not (getattr(one, name)[:, None] == getattr(other, name)[None]).reshape(20, 20, -1).all(axis=2).any()
