"""The kernel against closed forms: the oscillator's matrix, Kepler's equation, a multiprecision trajectory."""

import mpmath
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.integrators import BENCHMARKED
from nearharmonic.math import cos
from support.oracles.multiprecision import digits_of, trajectory
from support.oracles.reference_solutions import kepler_state, oscillator_state


@pytest.mark.parametrize("integrator", BENCHMARKED)
@pytest.mark.parametrize(("precision", "allowed"), [("extended", mpf(2) * 10**-27), ("double", 6e-13)])
def test_the_oscillator_is_its_matrix_power_to_rounding(integrator, precision, allowed):
    """1000 steps of about 20 double-double updates, each good to 5u^2 = 6e-32, add up at most linearly to 2e-27.

    In double, rounded coefficients shift the phase by at most u each: 20 * 250 * 1.1e-16 = 6e-13 over t = 250.
    """
    run = nh.integrate("sho", integrator, 0.25, t_end=250, precision=precision)
    q, p = oscillator_state(nh.integrators[integrator], mpf(1) / 4, 1000)
    assert abs(digits_of(run, "q")[0] - q) < allowed
    assert abs(digits_of(run, "p")[0] - p) < allowed


def test_mercury_is_where_keplers_equation_puts_it():
    """Two step sizes, order 6: the position error falls by 2^6 within 5 %, to below a metre at the smaller step."""
    GM = nh.systems["kepler"].parameters["GM"].value
    errors = []
    for tau in (21.915, 10.9575):
        run = nh.integrate("kepler", "yoshida_s7o6a", tau, precision="extended", samples=2)
        wanted = kepler_state("69.82", "0.139896", GM, "87660")
        found = digits_of(run, "q") + digits_of(run, "p")
        errors.append(max(abs(a - b) for a, b in zip(found[:2], wanted[:2], strict=True)))
    assert errors[1] < 1e-9 * 1e6
    assert errors[0] / errors[1] == pytest.approx(64, rel=0.05)


@pytest.mark.parametrize("integrator", ["ruth", "babps9o7h"])
@pytest.mark.parametrize("first", ["drift", "kick"])
def test_extended_henon_heiles_agrees_with_multiprecision_to_29_digits(integrator, first):
    """50 steps before chaos has grown errors by more than a factor 10: 50 * 200 operations * 6e-32 * 10 = 6e-27."""
    tableau = nh.integrators[integrator].role(first)
    q, p = trajectory(tableau, nh.systems["henon_heiles"], mpf(1) / 4, 50)[-1]
    run = nh.integrate("henon_heiles", integrator, 0.25, t_end=12.5, precision="extended", first=first)
    found = digits_of(run, "q") + digits_of(run, "p")
    assert max(abs(a - b) for a, b in zip(found, q + p, strict=True)) < mpf(6) * 10**-27


def test_energy_error_of_sample_is_that_of_its_state():
    """H from the sample's own q and p in 60 digits; the double state drops its carry, half an ulp: 4e-16 of H."""
    run = nh.integrate("henon_heiles", "ruth", 0.3, t_end=60)
    for sample in range(run.sizes["sample"]):
        (x, y), (u, v) = (tuple(mpf(float(c)) for c in run[name][sample]) for name in ("q", "p"))
        H = (u * u + v * v + x * x + y * y) / 2 + x * x * y - y**3 / 3
        assert abs((H - mpf(1) / 8) * 8 - run.energy_error[sample].item()) < 2e-15


# --- a pendulum, by elliptic functions ------------------------------------------------------------------------------


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
