"""Chains of ten and 1024 sites, ten and a hundred bodies: normal modes, conserved momenta, and measured energies."""

import numpy as np
import pytest
from mpmath import mp, mpf

import nearharmonic as nh
from nearharmonic.math import array, sqrt, sum
from support.methods.own_systems import mode, sites
from support.oracles.multiprecision import digits_of

SITES, BODIES = 1024, 100
MASSES = [1 + i % 7 for i in range(BODIES)]


def attraction(q):
    """Potential of softened bodies, for all pairs at once."""
    first, second = np.triu_indices(BODIES, 1)
    masses, r = np.array(MASSES), array(q, BODIES, 3)
    distance = r[first] - r[second]
    square = (distance * distance) @ [1, 1, 1]
    return -sum(masses[first] * masses[second] / sqrt(square + 0.01))


@pytest.fixture(scope="module")
def bodies():
    rng = np.random.default_rng(7)
    q, p = rng.uniform(-3, 3, (BODIES, 3)).round(4), rng.uniform(-1, 1, (BODIES, 3)).round(4)
    return nh.System(
        name="bodies_100", V=attraction, masses=np.repeat(MASSES, 3).tolist(), q0=q.ravel().tolist(),
        p0=p.ravel().tolist(), t_end="0.2",
    )  # fmt: skip


@pytest.mark.slow
def test_a_linear_chain_of_1024_sites_follows_its_normal_modes():
    """Leapfrog turns a mode of frequency w = 2 sin(pi k / 2 (n + 1)) by the angle 2 asin(w tau / 2) a step."""
    modes, tau, steps = {1: 1.0, 7: 0.3, 600: 0.2, 1024: 0.1}, 0.25, 200
    start = [f"{x:.12f}" for x in np.sum([a * mode(SITES, k) for k, a in modes.items()], axis=0)]
    linear = {"q0": start, "parameters": {"beta": 0}, "t_end": 50}
    run = nh.integrate(sites(SITES), "leapfrog", tau, first="kick", energy="none", samples=2, **linear)
    exact = np.zeros(SITES)
    for k, a in modes.items():
        frequency = 2 * np.sin(np.pi * k / 2 / (SITES + 1))
        exact += a * mode(SITES, k) * np.cos(steps * 2 * np.arcsin(frequency * tau / 2))
    # Initial values of 12 digits, and the rounding of forces over 200 steps.
    assert np.abs(run.q[-1].values - exact).max() < 5e-12


@pytest.mark.slow
def test_energy_of_chain_of_1024_sites_is_measured_to_rounding():
    run = nh.integrate(sites(SITES), "aba864", 0.5, t_end=50, q0=mode(SITES, 3).round(6), samples=5)

    def energy(k):
        q, p = np.longdouble(run.q[k].values), np.longdouble(run.p[k].values)
        q, p = q + run.q_low[k].values, p + run.p_low[k].values
        stretched = np.diff(np.concatenate([[0], q, [0]]))
        return (p @ p) / 2 + (stretched**2 / 2 + np.longdouble("0.1") * stretched**4 / 4).sum()

    errors = [(energy(k) - energy(0)) / energy(0) for k in range(5)]
    # Long doubles: 1024 terms, each with 1e-19 of its distance, 1, over the stretch, 1e-2.
    assert run.energy_error.values == pytest.approx(np.array(errors, float), abs=1e-15, rel=1e-3)


@pytest.mark.slow
def test_a_hundred_bodies_feel_the_sum_of_all_pairs(bodies):
    """The first kick of leapfrog against a sum of numpy's."""
    tau = 1e-3
    run = nh.problem(bodies, "leapfrog", first="kick", t_end="1e-3", energy="none")(tau)
    q, p, m = (np.array(x, float).reshape(BODIES, -1) for x in (bodies.q0, bodies.p0, MASSES))

    def pull(q):
        distance = q[:, None] - q[None]
        strength = m * m.T / ((distance**2).sum(axis=2) + 0.01) ** 1.5
        return -(strength[:, :, None] * distance).sum(axis=1)

    half = p + tau / 2 * pull(q)
    q = q + tau * half / m
    assert run.q[-1].reshape(BODIES, 3) == pytest.approx(q, abs=1e-14)
    assert run.p[-1].reshape(BODIES, 3) == pytest.approx(half + tau / 2 * pull(q), abs=1e-13)


def test_formulas_of_many_coordinates_serve_numpy_and_multiprecision(bodies):
    system = sites(60)
    q0, p0 = system.start(float)
    direct = np.sum(np.diff([0, *q0, 0]) ** 2 / 2 + 0.1 * np.diff([0, *q0, 0]) ** 4 / 4)
    assert system.energy(q0, p0, (0.1,)) == pytest.approx(direct, rel=1e-13)
    slopes = system.grad_V(q0, 0.1)
    pull = np.diff([0, *q0, 0]) + 0.1 * np.diff([0, *q0, 0]) ** 3
    assert slopes == pytest.approx(pull[:-1] - pull[1:], abs=1e-15)  # differences of numbers below 0.05


# --- energy of more than eight coordinates: in double far above rounding, in double-double near it --------------------

TEN_SITES = sites(10)


def exact_error(run, sample):
    """(H - H0)/|H0| of the stored states, with all their digits, in multiprecision."""

    def energy(k):
        q, p = digits_of(run, "q", k), digits_of(run, "p", k)
        return mp.fdot(p, p) / 2 + TEN_SITES.V(q, mpf("0.1"))

    return float((energy(sample) - energy(0)) / energy(0))


@pytest.mark.slow
@pytest.mark.parametrize("first", ["kick", pytest.param("drift", marks=pytest.mark.long)])
@pytest.mark.parametrize(("method", "tau"), [("leapfrog", 0.2), ("aba864", 0.2), ("s9odr6a", 0.1)])
def test_energy_error_is_that_of_states_to_four_digits(method, tau, first):
    """Errors from 1e-3 to 1e-14."""
    run = nh.integrate(TEN_SITES, method, tau, first=first, samples=11)
    exact = [exact_error(run, sample) for sample in range(11)]
    assert run.energy_error.values == pytest.approx(exact, rel=2.0**-12, abs=0)
    assert np.abs(exact).max() > 1e-13


@pytest.mark.slow
def test_near_rounding_the_energy_error_is_exact():
    """Steps so short that the error is all rounding, 1e-16, which a sum of doubles could not tell."""
    run = nh.integrate(TEN_SITES, "yoshida_s7o6a", 0.01, samples=11)
    exact = [exact_error(run, sample) for sample in range(11)]
    assert 0 < np.abs(exact).max() < 1e-14
    # H in double-double: a few units of 1e-32.
    assert run.energy_error.values == pytest.approx(exact, abs=1e-30)


@pytest.mark.slow
def test_energy_of_ten_sites_is_as_accurate_as_double_double():
    """Far above rounding it is measured in double; to rounding, 2^-53 an operation, so are the maxima."""
    for integrator, tau in (("leapfrog", 0.1), ("blanes_moan_s6o4", 0.1), ("s9odr6a", 0.05)):
        double, extended = (nh.integrate(TEN_SITES, integrator, tau, precision=x) for x in ("double", "extended"))
        for name in ("max_energy_error", "mean_energy_error"):
            assert abs(double[name].item() - extended[name].item()) < 5e-15
    for i in (1, 20, -1):
        assert abs(exact_error(double, i) - double.energy_error.values[i]) < 2e-15
    assert double.initial_energy.item() == float(TEN_SITES.V(list(map(mpf, TEN_SITES.q0)), mpf("0.1")))


# --- ten bodies, from V alone: energy, momentum and angular momentum by sums of their own, in long doubles ------------

N = 10
WEIGHTS = [str(1 + i % 4) for i in range(N)]
_ANGLES = 2 * np.pi * np.arange(N) / N
#: A ring that turns, disturbed a little.
_Q = np.stack([3 * np.cos(_ANGLES) + 0.1 * np.sin(5 * _ANGLES), 3 * np.sin(_ANGLES)], axis=1).round(3)
_P = np.stack([-np.sin(_ANGLES), np.cos(_ANGLES)], axis=1).round(3)


def ten_attraction(q, G):
    """Softened by one half."""
    return -G * sum(
        int(WEIGHTS[i]) * int(WEIGHTS[j]) / sqrt((q[2 * i] - q[2 * j]) ** 2 + (q[2 * i + 1] - q[2 * j + 1]) ** 2 + 0.25)
        for i in range(N)
        for j in range(i)
    )


TEN_BODIES = nh.System(
    name="ten bodies",
    V=ten_attraction,
    masses=tuple(m for m in WEIGHTS for _ in range(2)),
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
    m = np.ones_like(x[..., 0]) * np.array(WEIGHTS, float)
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
        run = nh.integrate(TEN_BODIES, "blanes_moan_s6o4", tau, samples=2000)
        H, momentum, L = sums(run.q.values, run.p.values)
        error = np.abs(H / H[0] - 1)
        assert np.abs(error - np.abs(run.energy_error.values)).max() < 1e-15
        assert run.max_energy_error.item() == pytest.approx(float(error.max()), abs=1e-15)
        assert np.abs(momentum - momentum[0]).max() < 1e-13
        assert np.abs(L / L[0] - 1).max() < 1e-14
        assert run.angular_momentum_drift.item() < 1e-14
        worst.append(float(error.max()))
    assert np.log2(worst[0] / worst[1]) == pytest.approx(4, abs=0.3)
