"""Ten gravitating bodies, from V alone: energy, momentum and angular momentum by sums of their own, in long doubles."""

from __future__ import annotations

import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.math import sqrt

N = 10
MASSES = [str(1 + i % 4) for i in range(N)]
_ANGLES = 2 * np.pi * np.arange(N) / N
#: A ring that turns, disturbed a little.
_Q = np.stack([3 * np.cos(_ANGLES) + 0.1 * np.sin(5 * _ANGLES), 3 * np.sin(_ANGLES)], axis=1).round(3)
_P = np.stack([-np.sin(_ANGLES), np.cos(_ANGLES)], axis=1).round(3)


def attraction(q, G):
    """Softened by one half."""
    return -G * sum(
        int(MASSES[i]) * int(MASSES[j]) / sqrt((q[2 * i] - q[2 * j]) ** 2 + (q[2 * i + 1] - q[2 * j + 1]) ** 2 + 0.25)
        for i in range(N)
        for j in range(i)
    )


BODIES = nh.System(
    name="ten bodies",
    V=attraction,
    masses=tuple(m for m in MASSES for _ in range(2)),
    q0=tuple(map(str, _Q.ravel().tolist())),
    p0=tuple(map(str, _P.ravel().tolist())),
    t_end="4",
    parameters={"G": "1"},
    invariants={
        "momentum": lambda q, p, G: (sum(p[::2]), sum(p[1::2])),
        "angular_momentum": lambda q, p, G: sum(q[i] * p[i + 1] - q[i + 1] * p[i] for i in range(0, 2 * N, 2)),
    },
)


def sums(q, p):
    """Energy, momentum and angular momentum of states (..., 20)."""
    x, u = (np.asarray(values, np.longdouble).reshape(*np.shape(q)[:-1], N, 2) for values in (q, p))
    m = np.ones_like(x[..., 0]) * np.array(MASSES, float)
    V = 0
    for i in range(N):
        for j in range(i):
            V = V - m[..., i] * m[..., j] / np.sqrt(((x[..., i, :] - x[..., j, :]) ** 2).sum(-1) + 0.25)
    L = (x[..., 0] * u[..., 1] - x[..., 1] * u[..., 0]).sum(-1)
    return ((u**2).sum(-1) / m).sum(-1) / 2 + V, u.sum(-2), L


@pytest.mark.slow
def test_ten_bodies_conserve_invariants_with_accurate_energy():
    """Splitting methods conserve momenta to rounding; the energy error falls with the order, as the sums have it."""
    worst = []
    for tau in (0.02, 0.01):
        run = nh.integrate(BODIES, "blanes_moan_s6o4", tau, samples=2000)
        H, momentum, L = sums(run.q.values, run.p.values)
        error = np.abs(H / H[0] - 1)
        assert np.abs(error - np.abs(run.energy_error.values)).max() < 1e-15
        assert run.max_energy_error.item() == pytest.approx(float(error.max()), abs=1e-15)
        assert np.abs(momentum - momentum[0]).max() < 1e-13
        assert np.abs(L / L[0] - 1).max() < 1e-14
        assert run.angular_momentum_drift.item() < 1e-14
        worst.append(float(error.max()))
    assert np.log2(worst[0] / worst[1]) == pytest.approx(4, abs=0.3)


@pytest.mark.slow
def test_ten_body_energy_is_as_accurate_as_double_double():
    for tau in (0.05, 0.01):
        double, extended = (nh.integrate(BODIES, "leapfrog", tau, precision=x) for x in ("double", "extended"))
        assert abs(double.max_energy_error.item() - extended.max_energy_error.item()) < 2e-15
        assert abs(double.mean_energy_error.item() - extended.mean_energy_error.item()) < 2e-15
