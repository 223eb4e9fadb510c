"""The Gauss method: implicit steps with all stages in lanes, against closed forms and mpmath."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import comb, factorial

import mpmath
import numpy as np
import pytest

import nearharmonic as nh
from nearharmonic.engine.numbers import standard_start
from nearharmonic.engine.setup import Setup
from nearharmonic.errors import SettingError
from nearharmonic.exchange.method import method_for
from nearharmonic.integrators.collocation import Collocation, gauss, stage_table

GAUSS = nh.integrators["gauss16"]
PENDULUM = nh.System(
    name="pendulum", V=lambda q: 1 - nh.math.cos(q[0]), q0=("0.5",), p0=("0.2",), t_end="10", energy_scale="1"
)
COUPLED = nh.System(
    name="coupled_masses",
    V=lambda q: q[0] ** 2 / 2 + q[1] ** 4 / 4 + q[0] * q[1] / 5,
    T=lambda p: p[0] ** 2 / 4 + p[1] ** 2 / 6 + p[0] * p[1] / 10,
    q0=("1", "0.5"),
    p0=("0", "0.1"),
    t_end="20",
)


def step_by_mpmath(force, velocity, q, p, h, digits=40):
    """One step of the method in the form of Runge and Kutta, iterated in so many digits."""
    with mpmath.workdps(digits):
        nodes, weights = gauss(8)
        c = [mpmath.mpf(x.numerator) / x.denominator for x in nodes]
        b = [mpmath.mpf(x.numerator) / x.denominator for x in weights]
        # c_i^(k+1) / (k+1) = sum_j a_ij c_j^k defines the matrix.
        powers = mpmath.matrix(8, 8)
        for k in range(8):
            for j in range(8):
                powers[k, j] = c[j] ** k
        rows = [mpmath.lu_solve(powers, mpmath.matrix([x ** (k + 1) / (k + 1) for k in range(8)])) for x in c]
        q, p, h = [mpmath.mpf(x) for x in q], [mpmath.mpf(x) for x in p], mpmath.mpf(h)
        Q, P = [q] * 8, [p] * 8
        for _ in range(80):
            F, W = [force(x) for x in Q], [velocity(x) for x in P]
            Q = [[x + h * sum(a * w[k] for a, w in zip(row, W, strict=True)) for k, x in enumerate(q)] for row in rows]
            P = [[x + h * sum(a * f[k] for a, f in zip(row, F, strict=True)) for k, x in enumerate(p)] for row in rows]
        F, W = [force(x) for x in Q], [velocity(x) for x in P]
        q = [x + h * sum(a * w[k] for a, w in zip(b, W, strict=True)) for k, x in enumerate(q)]
        p = [x + h * sum(a * f[k] for a, f in zip(b, F, strict=True)) for k, x in enumerate(p)]
        return q, p


CASES = {
    "pendulum": (PENDULUM, lambda q: [-mpmath.sin(q[0])], lambda p: p),
    "coupled_masses": (
        COUPLED,
        lambda q: [-q[0] - q[1] / 5, -(q[1] ** 3) - q[0] / 5],
        lambda p: [p[0] / 2 + p[1] / 10, p[1] / 3 + p[0] / 10],
    ),
    "relativistic_oscillator": (
        nh.systems["relativistic_oscillator"],
        lambda q: [-q[0]],
        lambda p: [p[0] / mpmath.sqrt(1 + p[0] ** 2)],
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_a_step_is_that_of_the_equations_in_forty_digits(case):
    system, force, velocity = CASES[case]
    assert set(system.constants(float)) <= {1.0}
    start = {"q0": list(map(float, system.q0)), "p0": list(map(float, system.p0))}
    exact = dict(zip("qp", step_by_mpmath(force, velocity, *start.values(), 0.5), strict=True))
    for precision, most in (("double", 2.0**-51), ("extended", 2.0**-98)):
        run = nh.integrate(system, GAUSS, 0.5, t_end=0.5, samples=2, precision=precision, **start)
        with mpmath.workdps(40):
            for name, numbers in exact.items():
                low = run[f"{name}_low"].values[-1]
                found = [mpmath.mpf(x) + mpmath.mpf(y) for x, y in zip(run[name].values[-1], low, strict=True)]
                # A few roundings of numbers of order one, of the product of eight terms and of the sum.
                assert max(abs(x - y) for x, y in zip(found, numbers, strict=True)) < most


@pytest.mark.slow
@pytest.mark.parametrize(
    ("q0", "p0"), [([0.26, 0.23], [-0.08, -0.19]), ([-0.3, 0.28], [-0.04, 0.25]), ([0.0, 0.0], [0.19, -0.11])]
)
def test_long_steps_are_solved_to_rounding(q0, p0):
    """Changes grow for once on their way to rounding, or the first guess is a force of 0."""
    exact = step_by_mpmath(lambda q: [-q[0] - 2 * q[0] * q[1], -q[1] - q[0] ** 2 + q[1] ** 2], lambda p: p, q0, p0, 4)
    run = nh.integrate("henon_heiles", GAUSS, 4, t_end=4, samples=2, q0=q0, p0=p0)
    assert run.status.item() == "ok"
    for found, numbers in zip((run.q, run.p), exact, strict=True):
        # The largest change of the forces with which an iteration may end.
        assert max(abs(x - y) for x, y in zip(found.values[-1], numbers, strict=True)) < 2.0**-46


@pytest.mark.slow
def test_the_oscillator_turns_by_the_diagonal_pade_approximant():
    h = 1.5
    # Hairer & Wanner (1996), Solving ODEs II, Theorem IV.3.12.
    row = [float(Fraction(factorial(16 - k) * comb(8, k), factorial(16))) for k in range(9)]
    turned = sum(c * (1j * h) ** k for k, c in enumerate(row)) / sum(c * (-1j * h) ** k for k, c in enumerate(row))
    run = nh.integrate("sho", GAUSS, h, t_end=h, samples=2, q0=[1.0], p0=[0.0])
    # Sums of nine terms lose a few units of the last place.
    assert abs(run.q.values[-1, 0] - turned.real) < 1e-14
    assert abs(-run.p.values[-1, 0] - turned.imag) < 1e-14
    # The energy is conserved exactly but for roundings, whose random walk in 20000 steps is 1e-14.
    assert nh.integrate("sho", GAUSS, h, t_end=h * 20000).max_energy_error.item() < 1e-13


def test_rounded_coefficients_fulfil_the_conditions_of_symplecticity():
    table, s = stage_table(8), range(8)
    exact = [[Fraction(high) + Fraction(low) for high, low in row] for row in table.momentum]
    assert all(exact[i][j] + exact[j][i] == 1 for i in s for j in s)
    for half in (0, 1):
        c = [Fraction(x[half]) for x in table.nodes]
        alpha = [[Fraction(x[half]) for x in row] for row in table.position]
        assert all(alpha[i][j] - alpha[j][i] == c[i] - c[j] for i in s for j in s)
        assert all(Fraction(x[half]) == (1 - half) - c[i] for i, x in enumerate(table.rest))


@pytest.mark.slow
def test_lanes_do_not_change_a_bit():
    starts = np.random.default_rng(5).uniform(-0.3, 0.3, (9, 2))
    together = nh.ensemble("henon_heiles", GAUSS, 0.9, q0=starts, t_end=45)
    for member, start in enumerate(starts):
        alone = nh.integrate("henon_heiles", GAUSS, 0.9, q0=start, t_end=45, samples=2)
        for name in ("q", "p", "q_low"):
            assert np.array_equal(alone[name].values[-1], together[name].values[member, -1])
        assert alone.evaluations.item() == together.evaluations.values[member]
    setup = Setup("henon_heiles", GAUSS, t_end=45)
    rows = np.repeat(standard_start(setup.system, False)[None, :], 9, axis=0)
    rows[:, :2], rows[:, 2:4] = starts, 0.0
    for width in (1, 2, 8):
        moves, marks = setup.moves([setup.end / 50]), np.tile([[0, 50]], (9, 1))
        numerics = replace(setup.numerics, width=width)
        batch = setup.batch(moves, marks, np.zeros(9, int), rows, np.empty((1, 0)), numerics)
        batch.run()
        assert np.array_equal(batch.filled.states[:, 1, :2], together.q.values[:, -1])


@pytest.mark.slow
@pytest.mark.parametrize("summation", ["compensated", "plain"])
def test_a_continued_run_has_the_bits_of_one_long_run(summation):
    settings = {"summation": summation, "t_end": 20000}
    first = nh.integrate("kepler", GAUSS, 200, **settings)
    second = nh.integrate("kepler", GAUSS, 200, start=first, **settings)
    whole = nh.integrate("kepler", GAUSS, 200, summation=summation, t_end=40000)
    assert np.array_equal(second.q.values[-1], whole.q.values[-1])
    assert first.evaluations.item() + second.evaluations.item() == whole.evaluations.item()


def test_a_step_that_does_not_converge_has_its_own_status():
    for energy in ("every", "samples", "none"):
        run = nh.integrate("henon_heiles", GAUSS, 30.0, t_end=300, energy=energy)
        assert (run.status.item(), run.diverged_at.item()) == ("not_converged", 1)
    assert "not_converged" in run.status.attrs["long_name"]
    assert nh.problem("henon_heiles", GAUSS, t_end=300)(30.0).status == "not_converged"
    far = nh.ensemble("henon_heiles", GAUSS, 1.0, q0=[[0.1, 0.1], [0.2, 0.0], [40.0, 3.0]], p0=[0.0, 0.1], t_end=10)
    assert [*far.status.values[:2]] == ["ok", "ok"]
    assert far.status.values[2] in ("not_converged", "diverged")
    alone = nh.integrate("henon_heiles", GAUSS, 1.0, q0=[0.1, 0.1], p0=[0.0, 0.1], t_end=10, samples=2)
    assert np.array_equal(far.q.values[0, -1], alone.q.values[-1])


@pytest.mark.slow
@pytest.mark.parametrize("amplitude", [1.0, 0.1, 0.03])
def test_oscillators_inside_the_equations_give_the_same_run(amplitude):
    start = {"q0": [0.3 * amplitude, 0.0], "p0": [0.0, 0.4 * amplitude]}
    settings = {"tau": 1.1, "t_end": 110, "samples": 2, **start}
    plain = nh.integrate("henon_heiles", GAUSS, **settings)
    inside = nh.integrate("henon_heiles", GAUSS, split="exact_oscillator", **settings)
    # Both solve the same equations to rounding, which a hundred steps amplify by about a hundred.
    assert np.abs(inside.q.values[-1] - plain.q.values[-1]).max() < 100 * 100 * 2.0**-53 * amplitude
    # What is iterated is smaller by the amplitude; one iteration more removes the rounding of coefficients, and takes
    # at the full amplitude what is gained.
    assert inside.evaluations.item() < plain.evaluations.item() * (1.05 if amplitude == 1 else 0.9)
    exact = nh.integrate("henon_heiles", GAUSS, split="exact_oscillator", precision="extended", **settings)
    assert np.abs(inside.q.values[-1] - exact.q.values[-1]).max() < 100 * 100 * 2.0**-53 * amplitude


@pytest.mark.slow
def test_energy_drifts_by_rounding_alone_with_both_equations():
    for split in ("kinetic_potential", "exact_oscillator"):
        run = nh.integrate(
            "henon_heiles", GAUSS, 0.7, t_end=0.7 * 40000, samples=2, split=split, q0=[0.03, 0.0], p0=[0.0, 0.04]
        )
        # A random walk of roundings of 1e-16 in 40000 steps is 2e-14; a drift of one each would be 4e-12.
        assert run.max_energy_error.item() < 2e-13


@pytest.mark.slow
def test_a_regularised_orbit_passes_near_the_centre():
    # e = 0.9, as in config/regularised.yaml: steps of equal regular time are short in time near the centre.
    start = {"q0": ["110.0271", "0"], "p0": ["0", "0.039537368881065506962259617967003"]}
    run = nh.integrate("kepler_regularised", GAUSS, 300.0, **start)
    assert run.status.item() == "ok"
    assert run.max_energy_error.item() < 1e-13
    assert run.evaluations.item() > 8 * run.steps.item()


@pytest.mark.slow
def test_steps_of_a_stepper_are_those_of_runs():
    step = nh.stepper("henon_heiles", GAUSS)
    q, p = np.array([0.3, 0.0]), np.array([0.0, 0.4])
    step(q, p, 0.5)
    run = nh.integrate("henon_heiles", GAUSS, 0.5, t_end=0.5, summation="plain", samples=2, q0=[0.3, 0], p0=[0, 0.4])
    assert np.array_equal(q, run.q.values[-1])
    assert np.array_equal(p, run.p.values[-1])


@pytest.mark.slow
def test_a_potential_of_numba_is_called_for_each_stage():
    import numba

    @numba.njit
    def V(q):
        return 0.5 * (q[0] ** 2 + q[1] ** 2) + q[0] ** 2 * q[1] - q[1] ** 3 / 3

    @numba.njit
    def grad_V(q):
        return q[0] + 2 * q[0] * q[1], q[1] + q[0] ** 2 - q[1] ** 2

    own = nh.System(name="compiled", V=V, grad_V=grad_V, q0=("0.3", "0"), p0=("0", "0.4"), t_end="20")
    known = nh.integrate("henon_heiles", GAUSS, 0.5, t_end=20, samples=2, q0=[0.3, 0], p0=[0, 0.4])
    run = nh.integrate(own, GAUSS, 0.5, samples=2)
    assert np.abs(run.q.values[-1] - known.q.values[-1]).max() < 40 * 100 * 2.0**-53


@pytest.mark.parametrize(
    "call",
    [
        lambda: nh.integrate("kepler", GAUSS, 100, first="kick"),
        lambda: nh.kappa(GAUSS, 3),
        lambda: method_for("a library", "gauss16"),
    ],
)
def test_what_needs_kicks_and_drifts_refuses_the_method(call):
    with pytest.raises(SettingError, match="implicit"):
        call()


def test_stages_of_a_method_are_a_small_integer():
    with pytest.raises(nh.NearharmonicError, match="stages = 40"):
        Collocation(name="x", label="x", stages=40, source="")
    four = Collocation(name="gauss8", label="gauss8", stages=4, source="")
    assert nh.order_of(four) == 8
    assert nh.order_of(GAUSS) == nh.harmonic_order(GAUSS) == 16
    assert nh.integrate("sho", four, 0.5, t_end=10).max_energy_error.item() < 1e-14


def chain(count, T=None):
    """Masses between walls, joined by springs that are not linear; with more than 50, states are in memory."""

    def V(q):
        ends = [0, *q, 0]
        stretched = [b - a for a, b in pairwise(ends)]
        return sum(x**2 / 2 + x**3 / 12 + x**4 / 40 for x in stretched)

    at = [f"{0.5 * np.sin(np.pi * (k + 1) / (count + 1)):.6f}" for k in range(count)]
    given = {} if T is None else {"T": T}
    return nh.System(name=f"chain_of_{count}", V=V, q0=tuple(at), p0=("0",) * count, t_end="10", **given)


@pytest.mark.slow
@pytest.mark.parametrize("masses", [None, lambda p: sum(x * x * (1 + k / 60) / 2 for k, x in enumerate(p))])
def test_a_chain_in_memory_moves_as_by_splitting(masses):
    system = chain(60, masses)
    run = nh.integrate(system, GAUSS, 1.0, samples=2)
    fine = nh.integrate(system, "sofspa_s35o10" if masses else "srkn_a14", 0.1, samples=2)
    # Both errors are below the roundings of a hundred steps.
    assert np.abs(run.q.values[-1] - fine.q.values[-1]).max() < 100 * 2.0**-52
    assert np.abs(run.p.values[-1] - fine.p.values[-1]).max() < 100 * 2.0**-52
    half = nh.integrate(system, GAUSS, 1.0, t_end=5)
    rest = nh.integrate(system, GAUSS, 1.0, t_end=5, start=half)
    assert np.array_equal(rest.q.values[-1], run.q.values[-1])
    with pytest.raises(SettingError, match="compiled as loops"):
        nh.integrate(system, GAUSS, 1.0, precision="extended")
