"""Systems that a user might write, against solutions in closed form: elliptic functions, normal modes, invariants.

Each system is made once for the whole file, so that its kernels are compiled once.
"""

from __future__ import annotations

from itertools import pairwise
from math import log2

import mpmath
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.math import cos, exp

PENDULUM = nh.System(
    name="pendulum of two parameters",
    V=lambda q, g, length: -g / length * cos(q[0]),
    q0=("0",),
    p0=("1.5",),
    t_end="10",
    parameters={"g": "9.81", "length": "2.25"},
)
TODA = nh.System(
    name="toda ring",
    V=lambda q: exp(q[0] - q[1]) + exp(q[1] - q[2]) + exp(q[2] - q[0]),
    q0=("0.3", "-0.2", "0.1"),
    p0=("0.5", "0.25", "-0.75"),
    t_end="20",
    invariants={
        "total_momentum": lambda q, p: p[0] + p[1] + p[2],
        "third": lambda q, p: (
            p[0] * p[1] * p[2] - p[0] * exp(q[1] - q[2]) - p[1] * exp(q[2] - q[0]) - p[2] * exp(q[0] - q[1])
        ),
    },
)
MORSE = nh.System(
    name="morse",
    V=lambda q, D, a, m: D * (1 - exp(-a * q[0])) ** 2,
    masses=("m",),
    q0=("0",),
    p0=("0",),
    t_end="10",
    parameters={"D": "2", "a": "1.5", "m": "0.75"},
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


@pytest.fixture(autouse=True)
def forty_digits():
    with mp.workdps(40):
        yield


def last(run, name):
    """The last sample in full: a double and the digits below it."""
    return [mpf(float(x)) + mpf(float(y)) for x, y in zip(run[name][-1], run[f"{name}_low"][-1], strict=True)]


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
    w, (q,), (p,) = mpmath.sqrt(mpf("9.81") / mpf("2.25")), last(run, "q"), last(run, "p")
    angle, velocity = pendulum_state(abs(mpf(p0)), w, mpf(3))
    sign = mpmath.sign(mpf(p0))
    turns = mpmath.nint((sign * q - angle) / (2 * mp.pi))  # the angle of a rotation grows without bound
    assert abs(sign * q - angle - 2 * mp.pi * turns) < mpf("1e-25")
    assert (turns != 0) == (abs(mpf(p0)) > 2 * w)
    assert abs(sign * p - velocity) < mpf("1e-25")


@pytest.mark.parametrize("p0", ["4.125", "5"], ids=["libration", "rotation"])
def test_a_pendulum_returns_after_the_period_of_the_elliptic_integral(p0):
    """The end of the interval is the period to 40 digits; the state repeats to those of double-double."""
    w = mpmath.sqrt(mpf("9.81") / mpf("2.25"))
    k = mpf(p0) / (2 * w)
    period = 4 * mpmath.ellipk(k**2) / w if k < 1 else 2 * mpmath.ellipk(1 / k**2) / (k * w)
    run = nh.integrate(
        PENDULUM, "s15odr8", "2e-4", t_end=mpmath.nstr(period, 40), p0=[p0], precision="extended", energy="none"
    )
    (q,), (p,) = last(run, "q"), last(run, "p")
    assert abs(q - (0 if k < 1 else 2 * mp.pi)) < mpf("1e-25")
    assert abs(p - mpf(p0)) < mpf("1e-25")


@pytest.mark.parametrize(("integrator", "order"), [("leapfrog", 2), ("blanes_moan_s6o4", 4), ("srkn_b11", 6)])
def test_position_of_pendulum_converges_with_order_of_method(integrator, order):
    angle, velocity = pendulum_state(mpf(3), mpmath.sqrt(mpf("9.81") / mpf("2.25")), mpf(4))
    runs = [nh.integrate(PENDULUM, integrator, tau, t_end=4, p0=[3.0], samples=1) for tau in (0.04, 0.02)]
    coarse, fine = (float(mpmath.hypot(last(run, "q")[0] - angle, last(run, "p")[0] - velocity)) for run in runs)
    assert log2(coarse / fine) == pytest.approx(order, abs=0.3)


def lax_traces(q, p):
    """tr L^2 = 2 H and tr L^3 of the Lax matrix of the ring in mpmath (Flaschka 1974), with spectral parameter 1."""
    off = [mpmath.exp((q[i] - q[(i + 1) % 3]) / 2) for i in range(3)]
    L = mpmath.matrix([[p[0], off[0], off[2]], [off[0], p[1], off[1]], [off[2], off[1], p[2]]])
    return [sum((L**k)[i, i] for i in range(3)) for k in (2, 3)]


def test_third_toda_invariant_drifts_like_its_lax_matrix():
    """Invariants in the output against tr L^3 of their states; the drift falls with the order of the method."""
    drifts = []
    for tau in (0.1, 0.05):
        run = nh.integrate(TODA, "blanes_moan_s6o4", tau, samples=9)
        cubes = []
        for q, p, I3, error in zip(run.q.values, run.p.values, run.third.values, run.energy_error.values, strict=True):
            square, cube = lax_traces(*(list(map(mpf, x.tolist())) for x in (q, p)))
            cubes.append(cube)
            assert abs(float(cube - 6) / 3 - I3) < 1e-14  # det L = tr L^3 / 3 where the total momentum is 0
            assert abs(float(square / 2 / run.initial_energy.item() - 1) - error) < 1e-15
        drift = max(abs((cube - cubes[0]) / (cubes[0] - 6)) for cube in cubes)
        assert run.third_drift.item() == pytest.approx(float(drift), rel=1e-5)
        assert run.total_momentum_drift.item() < 1e-14
        drifts.append(float(drift))
    assert log2(drifts[0] / drifts[1]) == pytest.approx(4, abs=0.3)
    assert drifts[1] < 1e-6


def morse_position(t, energy, D, a, m):
    """exp(a q) = (1 + r cos(w t)) / (1 - r^2) from the outer turn, with r^2 = E / D and w^2 = 2 a^2 D (1 - r^2) / m."""
    w = a * mpmath.sqrt(2 * D * (1 - energy / D) / m)
    return mpmath.log((1 + mpmath.sqrt(energy / D) * mpmath.cos(w * t)) / (1 - energy / D)) / a


@pytest.mark.parametrize("values", [{}, {"D": "3", "a": "0.75", "m": "2.5"}], ids=["own parameters", "others"])
def test_a_morse_oscillator_follows_its_closed_form(values):
    """A parameter is the mass; the energy is 0.36 D, so that r = 3/5. At this step the method's error is 1e-13."""
    D, a, m = (mpf(values.get(name, MORSE.parameters[name].value)) for name in ("D", "a", "m"))
    start = mpmath.nstr(-mpmath.log(mpf("0.4")) / a, 40)
    times = [0.5, 1, 2.75, 4, 7.125, 10]
    run = nh.integrate(MORSE, "srkn_a14", "0.01", q0=[start], parameters=values, t=times)
    for t, q, low in zip(times, run.q.values[:, 0].tolist(), run.q_low.values[:, 0].tolist(), strict=True):
        assert abs(float(mpf(q) + mpf(low) - morse_position(mpf(t), D * mpf("0.36"), D, a, m))) < 1e-12
    assert run.initial_energy.item() == pytest.approx(float(D * mpf("0.36")), rel=1e-15)


def chain_state(t):
    """Normal modes of a chain with fixed ends: (2 / (n + 1))^1/2 sin(i k pi / (n + 1)), w = 2 K^1/2 sin(...)."""
    n, K = SITES, mpf("1.25")
    modes = [[mpmath.sqrt(mpf(2) / (n + 1)) * mpmath.sin(i * k * mp.pi / (n + 1)) for i in range(1, n + 1)]
             for k in range(1, n + 1)]  # fmt: skip
    q, p = [mpf(0)] * n, [mpf(0)] * n
    for k, mode in enumerate(modes, 1):
        w = 2 * mpmath.sqrt(K) * mpmath.sin(k * mp.pi / (2 * (n + 1)))
        a = sum(mpf(x) * u for x, u in zip(CHAIN.q0, mode, strict=True))
        b = sum(mpf(x) * u for x, u in zip(CHAIN.p0, mode, strict=True))
        for i, u in enumerate(mode):
            q[i] += u * (a * mpmath.cos(w * t) + b / w * mpmath.sin(w * t))
            p[i] += u * (b * mpmath.cos(w * t) - a * w * mpmath.sin(w * t))
    return q, p


def chain_energy(q, p):
    q = [mpf(0), *q, mpf(0)]
    return sum(x**2 for x in p) / 2 + mpf("1.25") / 2 * sum((y - x) ** 2 for x, y in pairwise(q))


@pytest.mark.parametrize(("precision", "tau", "close"), [("double", 0.02, 2e-12), ("extended", 0.01, 1e-13)])
def test_a_chain_of_twelve_sites_moves_in_its_normal_modes(precision, tau, close):
    run = nh.integrate(CHAIN, "s15odr8", tau, precision=precision, samples=2)
    for name, exact in zip(("q", "p"), chain_state(mpf(25)), strict=True):
        assert max(abs(float(x - y)) for x, y in zip(last(run, name), exact, strict=True)) < close


def test_twelve_coordinate_energy_is_as_accurate_as_double_double():
    """Far above rounding it is measured in double; to rounding, 2^-53 an operation, so are the maxima."""
    for integrator, tau in (("leapfrog", 0.1), ("blanes_moan_s6o4", 0.1), ("s9odr6a", 0.05)):
        double, extended = (nh.integrate(CHAIN, integrator, tau, precision=x) for x in ("double", "extended"))
        for name in ("max_energy_error", "mean_energy_error"):
            assert abs(double[name].item() - extended[name].item()) < 5e-15
    start = chain_energy(*(list(map(mpf, x)) for x in (CHAIN.q0, CHAIN.p0)))
    assert double.initial_energy.item() == float(start)
    for i in (1, 20, -1):
        state = ([mpf(x) for x in double[name].values[i].tolist()] for name in ("q", "p"))
        low = ([mpf(x) for x in double[name].values[i].tolist()] for name in ("q_low", "p_low"))
        H = chain_energy(*([x + y for x, y in zip(a, b, strict=True)] for a, b in zip(state, low, strict=True)))
        assert abs(float(H / start - 1) - double.energy_error.values[i]) < 2e-15
