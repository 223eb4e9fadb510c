"""A pendulum that a user might write, against elliptic functions."""

from __future__ import annotations

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
