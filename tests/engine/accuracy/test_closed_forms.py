"""Systems that a user might write, against solutions in closed form: elliptic functions, and the energy of a chain.

Each system is made once for the whole file, so that its kernels are compiled once.
"""

from __future__ import annotations

from itertools import pairwise
from math import log2

import mpmath
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.math import cos
from support.oracles.multiprecision import digits_of

PENDULUM = nh.System(
    name="pendulum of two parameters",
    V=lambda q, g, length: -g / length * cos(q[0]),
    q0=("0",),
    p0=("1.5",),
    t_end="10",
    parameters={"g": "9.81", "length": "2.25"},
)
SITES = 12
CHAIN = nh.System(
    name="linear chain",
    V=lambda q, k: (q[0] ** 2 + sum((x - y) ** 2 for x, y in pairwise(q)) + q[-1] ** 2) * k / 2,
    q0=tuple(str((7 * i) % 5 - 2) for i in range(SITES)),
    p0=tuple(str((3 * i) % 4 - 1) for i in range(SITES)),
    t_end="25",
    parameters={"k": "1.25"},
)


def pendulum_state(p0, w, t):
    """Angle and velocity from q = 0, by Jacobi's functions: libration for p0 < 2 w, rotation above."""
    k = p0 / (2 * w)
    if k < 1:
        s, c = (mpmath.ellipfun(name, w * t, m=k * k) for name in ("sn", "cn"))
        return 2 * mpmath.asin(k * s), 2 * k * w * c
    s, c, d = (mpmath.ellipfun(name, k * w * t, m=1 / k**2) for name in ("sn", "cn", "dn"))
    return 2 * mpmath.atan2(s, c), 2 * k * w * d


@pytest.mark.parametrize("p0", ["1.5", "4.125", "5", "-6.5"], ids=["small", "wide", "rotation", "rotation back"])
def test_a_pendulum_follows_elliptic_functions_to_25_digits(p0):
    """s15odr8 with this step has an error of some 1e-27; 2 w = 4.17... separates libration from rotation."""
    run = nh.integrate(PENDULUM, "s15odr8", "2e-4", t_end=3, p0=[p0], precision="extended", samples=2, energy="none")
    w, (q,), (p,) = mpmath.sqrt(mpf("9.81") / mpf("2.25")), digits_of(run, "q"), digits_of(run, "p")
    angle, velocity = pendulum_state(abs(mpf(p0)), w, mpf(3))
    sign = mpmath.sign(mpf(p0))
    turns = mpmath.nint((sign * q - angle) / (2 * mp.pi))  # the angle of a rotation grows without bound
    assert abs(sign * q - angle - 2 * mp.pi * turns) < mpf("1e-25")
    assert (turns != 0) == (abs(mpf(p0)) > 2 * w)
    assert abs(sign * p - velocity) < mpf("1e-25")


@pytest.mark.parametrize(("integrator", "order"), [("leapfrog", 2), ("blanes_moan_s6o4", 4), ("srkn_b11", 6)])
def test_position_of_pendulum_converges_with_order_of_method(integrator, order):
    angle, velocity = pendulum_state(mpf(3), mpmath.sqrt(mpf("9.81") / mpf("2.25")), mpf(4))
    runs = [nh.integrate(PENDULUM, integrator, tau, t_end=4, p0=[3.0], samples=1) for tau in (0.04, 0.02)]
    coarse, fine = (
        float(mpmath.hypot(digits_of(run, "q")[0] - angle, digits_of(run, "p")[0] - velocity)) for run in runs
    )
    assert log2(coarse / fine) == pytest.approx(order, abs=0.3)


def chain_energy(q, p):
    q = [mpf(0), *q, mpf(0)]
    return sum(x**2 for x in p) / 2 + mpf("1.25") / 2 * sum((y - x) ** 2 for x, y in pairwise(q))


def test_twelve_coordinate_energy_is_as_accurate_as_double_double():
    """Far above rounding it is measured in double; to rounding, 2^-53 an operation, so are the maxima."""
    for integrator, tau in (("leapfrog", 0.1), ("blanes_moan_s6o4", 0.1), ("s9odr6a", 0.05)):
        double, extended = (nh.integrate(CHAIN, integrator, tau, precision=x) for x in ("double", "extended"))
        for name in ("max_energy_error", "mean_energy_error"):
            assert abs(double[name].item() - extended[name].item()) < 5e-15
    start = chain_energy(*(list(map(mpf, x)) for x in (CHAIN.q0, CHAIN.p0)))
    assert double.initial_energy.item() == float(start)
    for i in (1, 20, -1):
        H = chain_energy(digits_of(double, "q", i), digits_of(double, "p", i))
        assert abs(float(H / start - 1) - double.energy_error.values[i]) < 2e-15
