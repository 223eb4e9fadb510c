"""Kernels: steps against oracles, loops of many coordinates, and products of a step size."""

import random
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from fractions import Fraction
from itertools import combinations, pairwise
from math import prod
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from mpmath import mp, mpf, workdps

import nearharmonic as nh
from nearharmonic.core import expression as size
from nearharmonic.core.expression import Graph, value_of
from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, REST
from nearharmonic.core.stepper import SLOTS, address_of, empty_slots, fill, recall, table_of
from nearharmonic.core.terms import LoopedEnergy, runs
from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import exact_products, moves, start_row
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.integrators import plain_integrators
from nearharmonic.math import array, atan2, cos, exp, sin, sqrt, sum
from support.oracles.multiprecision import digits_of, trajectory

# --- Contract of compiled arithmetic: bits, carries, symplecticity, backward runs, and detection of divergence


#: Precision and summation -> widths: lanes of one register, and of several.
WIDTHS = {("double", "compensated"): (8, 16), ("double", "plain"): (8, 32), ("extended", "compensated"): (8,)}
#: Systems whose runs share lanes; a regularised one has a lane of its own (test_regularised.py).
SYSTEMS = sorted(name for name, system in nh.systems.items() if system.regularisation is None)
#: Systems whose kernels are also compiled for several registers: with T = p.p / 2 and with another.
BOTH_KINETIC_ENERGIES = ("henon_heiles", "relativistic_oscillator")
#: Step sizes per stage, in units where an orbit takes about 2 pi: smooth, coarse, and diverging.
COUNTS = [4001, 1700, 800, 444, 300, 210, 150, 90, 60, 40, 25, 13, 5]


def batch(system, integrator, **settings):
    problem, tableau = nh.systems[system], nh.integrators[integrator]
    numerics = {field.name: settings.pop(field.name) for field in fields(Numerics) if field.name in settings}
    settings = {"t_end": Fraction(problem.t_end), "steps": COUNTS, "samples": 20} | settings
    return integrate_batch(problem, tableau, numerics=Numerics(**numerics), **settings)


def same_bits(a, b):
    names = ("q", "p", "q_low", "p_low", "energy_error", "block_max", "max_energy_error", "left_at", "energy")
    return all(np.array_equal(getattr(a, n), getattr(b, n), equal_nan=True) for n in names)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize(("precision", "summation"), WIDTHS)
def test_lanes_of_any_number_equal_the_scalar_bit_for_bit(system, precision, summation):
    for integrator in ("aba864", "babps9o7h"):
        numerics = {"precision": precision, "summation": summation}
        scalar = batch(system, integrator, width=1, **numerics)
        assert scalar.left_at.any()
        if summation == "plain":
            assert np.count_nonzero([scalar.q_low[0, 1:], scalar.p_low[0, 1:]]) == 0
        for width in WIDTHS[precision, summation][: 2 if system in BOTH_KINETIC_ENERGIES else 1]:
            assert same_bits(batch(system, integrator, width=width, **numerics), scalar), (integrator, width)


def test_block_holds_maximum_and_mean_of_its_own_steps_alone():
    every, few = (batch("henon_heiles", "ruth", steps=[800], samples=n) for n in (801, 9))
    errors = np.abs(every.energy_error[0])
    for k in range(1, 9):
        own = errors[few.marks[0, k - 1] + 1 : few.marks[0, k] + 1]
        assert few.block_max[0, k] == own.max()
        # A mean of 100 numbers in two orders of summation.
        assert few.block_mean[0, k] == pytest.approx(own.mean(), rel=1e-14)


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_carry_is_not_zero(system):
    """A compiler that may re-associate deletes the carry without a word."""
    compensated = batch(system, "s5odr4")
    # Now and then an increment is exact and its carry zero; a deleted carry is zero always.
    assert np.count_nonzero(compensated.q_low[0, 1:]) > 0.5 * compensated.q_low[0, 1:].size


def test_compensation_lowers_the_rounding_error_of_a_long_run():
    """At tau/s = 1e-4 truncation (1e-13 and below) is under rounding: compensated stays at it, plain is 30 times up."""
    compensated, plain = (
        nh.sweep("sho", "babs7o7h", [7e-3], t_end=5000, summation=kind).max_energy_error.item()
        for kind in ("compensated", "plain")
    )
    assert compensated < 2e-15
    assert plain > 10 * compensated


@pytest.mark.parametrize("integrator", ["ruth", "yoshida_s7o6a", "babps8o7h"])
@pytest.mark.parametrize("system", ["henon_heiles", "kepler"])
def test_one_step_is_symplectic(system, integrator):
    """M^T J M = J for the tangent map M by central differences: displacement 1e-8 in extended precision leaves 1e-16
    truncation and 1e-24 rounding; 1e-13 allows for large third derivatives. det M = 1 follows, and is checked too."""
    problem, tableau = nh.systems[system], nh.integrators[integrator]
    d, h = problem.dimension, Fraction(1, 10**8)
    start = [*map(Fraction, problem.q0), *map(Fraction, problem.p0)]
    rows = []
    for k in range(2 * d):
        for sign in (1, -1):
            moved = [x + sign * h * (i == k) for i, x in enumerate(start)]
            rows.append(start_row(moved[:d], moved[d:]))
    t_end = {"henon_heiles": Fraction(1, 2), "kepler": Fraction(100)}[system]
    out = integrate_batch(
        problem, tableau, t_end=t_end, steps=[1] * len(rows), samples=2, start=np.array(rows),
        numerics=Numerics(precision="extended"),
    )  # fmt: skip
    high = np.concatenate([out.q[:, -1], out.p[:, -1]], axis=1)
    low = np.concatenate([out.q_low[:, -1], out.p_low[:, -1]], axis=1)
    M = (((high[::2] - high[1::2]) + (low[::2] - low[1::2])) / (2 * float(h))).T
    J = np.block([[np.zeros((d, d)), np.eye(d)], [-np.eye(d), np.zeros((d, d))]])
    assert np.abs(M - np.eye(2 * d)).max() > 1e-2
    assert np.abs(M.T @ J @ M - J).max() < 1e-13
    assert np.linalg.det(M) == pytest.approx(1.0, abs=1e-13)


def test_fsal_method_counts_one_force_per_stage_plus_one():
    assert nh.sweep("sho", "babs7o7h", [0.5]).evaluations.item() == 7 * 1000 + 1
    assert nh.sweep("sho", "aba864", [0.5]).evaluations.item() == 7 * 1000


def test_a_diverged_run_says_so_and_stops():
    run = nh.integrate("henon_heiles", "ruth", 3.0)
    assert run.status.item() == "diverged"
    assert 0 < run.diverged_at.item() < run.steps.item()
    assert run.evaluations.item() == 3 * run.diverged_at.item()
    assert np.isinf(run.max_energy_error)
    assert np.isinf(run.mean_energy_error)
    assert np.isfinite(run.q).all()


@pytest.mark.parametrize(("tau", "t_end"), [(500.0, None), (250.0, None), (1e199, 1e200)])
def test_a_run_that_overflows_has_left_at_that_very_step(tau, t_end):
    """Steps of 1e199 give infinity minus infinity: NaN, which no comparison with a limit notices."""
    run = nh.sweep("henon_heiles", "yoshida_s7o6a", [tau], t_end=t_end)
    assert (run.status.item(), run.diverged_at.item()) == ("diverged", 1)
    assert run.steps.item() > 1 or t_end is None
    assert np.isinf(run.max_energy_error).all()


def test_an_energy_of_zero_at_the_start_is_measured_absolutely():
    """H = p^2/2 - q^2/2 at q = p = 1: along the unstable direction both grow as exp(t), and H stays at rounding."""
    hill = nh.System(name="hill", V=lambda q: -q[0] * q[0] / 2, q0=("1",), p0=("1",), t_end="3")
    method, run = nh.integrators["yoshida_s7o6a"], {"t_end": Fraction(3), "steps": [20], "samples": 2}
    zero, one, four = (integrate_batch(hill, method, scale=scale, **run) for scale in (0.0, 1.0, 4.0))
    assert 1e-9 < zero.max_energy_error[0] == one.max_energy_error[0] < 1e-2
    assert (zero.energy[0], four.max_energy_error[0]) == (0, one.max_energy_error[0] / 4)


# --- Formulas that are compiled as loops: one step of many systems against mpmath, and the bits of unrolled kerne


#: Digits of the oracle, and the step of its central differences, off by 1e-60 of third derivatives, which are near 1.
DIGITS, STEP = 100, mpf(10) ** -30


def chain(q):
    q = (0, *q, 0)
    return sum((b - a) ** 2 / 2 + (b - a) ** 4 / 40 for a, b in pairwise(q))


def ring(q, strength):
    return sum(exp(strength * (q[i - 1] - q[i])) - 1 for i in range(len(q)))


def uneven(q):
    """Constants and signs that differ from term to term, a site that is different, and a term of three."""
    sites = sum((i + 1) * q[i] ** 2 / 7 + (-1) ** i * (i + 2) * q[i] ** 3 / 60 for i in range(len(q)))
    return sites + sum(atan2(1, 2 + x * x) for x in q) + q[3] ** 4 / 3 + q[0] * q[5] * q[7] + 2


def bodies(q):
    n = len(q) // 3
    total = 0
    for i, j in combinations(range(n), 2):
        square = sum((q[3 * i + k] - q[3 * j + k]) ** 2 for k in range(3))
        total = total - (1 + i % 3) * (1 + j % 3) / sqrt(square + 0.25)
    return total


def mean_field(q):
    n = len(q)
    across, along = sum(cos(x) for x in q), sum(sin(x) for x in q)
    return (n - (across**2 + along**2) / n) / 2


def embedded(q):
    """Each site in a density that is a long sum itself."""
    n = len(q)
    density = [sum(1 / (1 + (q[i] - q[j]) ** 2) for j in range(n) if j != i) for i in range(n)]
    return sum(q[i] ** 2 - sqrt(density[i]) for i in range(n))


def spread(q):
    """Long sums in a long sum in a long sum."""
    mean = sum(q) / len(q)
    variance = sum((x - mean / 2) ** 2 for x in q)  # about the mean itself, it would not depend on it
    return sum(x**2 / 2 + exp(-variance / 40) * cos(x) for x in q)


def lattice(q):
    field = array(q, 5, -1)
    across, down = field[1:] - field[:-1], field[:, 1:] - field[:, :-1]
    return sum(across**2) / 2 + sum(down**2) / 2 + sum(field**4) / 4


def driven(q, t, strength):
    return chain(q) + sum(strength * q[i] * cos(t + i) for i in range(len(q)))


SYSTEMS_OF_LOOPS = {
    "free": (lambda q: q[0] - q[0], 9, {}),
    "one site": (lambda q: q[0] ** 2 / 2 + q[0] ** 4, 1, {}),
    "chain": (chain, 19, {}),
    "chain of masses": (chain, 24, {"masses": [1 + i % 3 for i in range(24)]}),
    "ring with a parameter": (ring, 17, {"parameters": {"strength": "0.7"}}),
    "uneven": (uneven, 23, {}),
    "bodies": (bodies, 15, {"masses": [1 + i // 3 % 3 for i in range(15)]}),
    "mean field": (mean_field, 40, {}),
    "embedded": (embedded, 18, {}),
    "spread": (spread, 18, {}),
    "lattice": (lattice, 20, {}),
    "driven": (driven, 24, {"parameters": {"strength": "0.5"}, "time_dependent": True}),
}
#: Systems whose sums are patterns that others have as well, or take seconds.
LONGER = {"uneven", "lattice", "bodies", "one site", "embedded"}
LONGEST = {"spread", "mean field", "free", "chain of masses"}


def system_of(name, tau="0.1"):
    V, d, more = SYSTEMS_OF_LOOPS[name]
    rng = np.random.default_rng(len(name))
    start = {key: [f"{x:.3f}" for x in rng.normal(size=d)] for key in ("q0", "p0")}
    return nh.System(name=name.replace(" ", "_"), V=V, t_end=tau, **start, **more)


@pytest.fixture
def looped(monkeypatch):
    """Formulas of any number of coordinates become loops."""
    monkeypatch.setattr(size, "MOST_UNROLLED", 0)


def oracle(system):
    """The system with derivatives by differences, as :mod:`multiprecision` takes it."""
    V, T = system.formulas().V, system.formulas().T

    def slopes(f):
        def gradient(x, *given):
            moved = ([[*x[:i], x[i] + sign * STEP, *x[i + 1 :]] for sign in (1, -1)] for i in range(len(x)))
            return [(f(ahead, *given) - f(behind, *given)) / (2 * STEP) for ahead, behind in moved]

        return gradient

    q0, p0 = system.extended_start(str)
    momentum = slopes(lambda p: T(tuple(p), *map(mpf, values(system))))
    return SimpleNamespace(
        q0=q0, p0=p0, parameters=system.parameters, V=V, T=T, grad_T=momentum,
        grad_V=slopes(lambda q, *given: V(tuple(q), *given)),
    )  # fmt: skip


def values(system):
    return [parameter.value for parameter in system.parameters.values()]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in LONGER) + [pytest.mark.long] * (name in LONGEST))
        for name in SYSTEMS_OF_LOOPS
    ],
)
def test_a_step_is_that_of_multiprecision(name, looped):
    system = system_of(name)
    run = nh.integrate(system, "leapfrog", 0.1, precision="extended", first="kick")
    tableau = nh.integrators["leapfrog"].role("kick")
    with workdps(DIGITS):
        _, (q, p) = trajectory(tableau, oracle(system), mpf("0.1"), 1)
        d = system.dimension
        # A few hundred operations in double-double, each off by at most 2^-100 of numbers of size 30.
        for a, b in zip(digits_of(run, "q") + digits_of(run, "p"), q[:d] + p[:d], strict=True):
            assert abs(a - b) < 1e-27
        (q, p), given = (list(map(mpf, x)) for x in system.extended_start(str)), [mpf(x) for x in values(system)]
        energy = system.formulas().T(p, *given) + system.formulas().V(tuple(q), *given)
        initial = mpf(run.initial_energy.item()) + mpf(run.initial_energy_low.item())
        # A sum of as many numbers, whose moduli add up to a few thousand.
        assert abs(initial - energy) < 1e-26


KICK_FIRST, DRIFT_FIRST, UNMEASURED = (
    ("compensated", "kick", "every"),
    ("plain", "drift", "samples"),
    ("compensated", "drift", "none"),
)
#: The other case of .ci/run, beside the case of README's command.
SECOND = ("driven", KICK_FIRST)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("embedded", DRIFT_FIRST),
        *(
            pytest.param(name, settings, marks=pytest.mark.slow if (name, settings) == SECOND else pytest.mark.long)
            for name in ("driven", "uneven", "embedded") for settings in (KICK_FIRST, DRIFT_FIRST, UNMEASURED)
            if (name, settings) != ("embedded", DRIFT_FIRST)
        ),
    ],
)  # fmt: skip
def test_doubles_follow_double_doubles_to_rounding(name, settings, looped):
    """Ten steps of a fourth-order method; both summations, either part first, the three ways to measure the energy."""
    system, (summation, first, energy) = system_of(name, tau="1"), settings
    exact = nh.integrate(system, "aba864", 0.1, precision="extended", first=first)
    run = nh.integrate(system, "aba864", 0.1, summation=summation, first=first, energy=energy)
    # Seventy forces, whose sums of 24 terms of size 1 are off by 24 units of 1e-16, times a step of 0.1.
    assert np.abs(run.q - exact.q).max() < 2e-14
    if energy == "every":
        assert run.max_energy_error.item() == pytest.approx(exact.max_energy_error.item(), rel=1e-4, abs=1e-15)
    elif energy == "samples":
        # An error of the energy of a state that is off by 2e-14 in 24 coordinates.
        assert run.energy_error[-1].item() == pytest.approx(exact.energy_error[-1].item(), abs=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["double", "extended"])
def test_loops_and_unrolled_kernels_have_the_same_bits(precision, monkeypatch):
    """Sums have only one order here: each force is the sum of two bonds."""

    def run():
        start = [f"{np.sin(np.pi * (i + 1) / 9):.6f}" for i in range(8)]
        eight = nh.System(name="eight_sites", V=chain, q0=start, p0=["0"] * 8, t_end="10")
        return nh.integrate(eight, "aba864", 0.1, precision=precision, samples=5)

    unrolled = run()
    monkeypatch.setattr(size, "MOST_UNROLLED", 0)
    looped = run()
    assert np.array_equal(looped.q, unrolled.q)
    assert np.array_equal(looped.p, unrolled.p)
    # The order of the sum of energies differs: they are off by a few units of 1e-32, or by 1e-4 of an error in double.
    assert looped.max_energy_error.item() == pytest.approx(unrolled.max_energy_error.item(), rel=1e-4, abs=1e-30)


@pytest.mark.slow
def test_parameters_of_loops_are_given_at_run_time(looped):
    system = system_of("ring with a parameter", "1")
    problem = nh.problem(system, "leapfrog", precision="extended")
    once = problem(0.1, parameters={"strength": "0.3"})
    alone = nh.System(name="weak", V=lambda q: ring(q, 0.3), q0=system.q0, p0=system.p0, t_end="1")
    assert np.array_equal(once.q[-1], nh.integrate(alone, "leapfrog", 0.1, precision="extended").q[-1])
    assert not np.array_equal(once.q[-1], problem(0.1).q[-1])


@pytest.mark.slow
def test_parameter_that_decides_what_formula_does_is_compiled_in(looped):
    def reach(q, neighbours):
        return sum((q[i] - q[i - k]) ** 2 / 2 for k in range(1, int(neighbours) + 1) for i in range(k, len(q)))

    start = {"q0": [f"{i * i % 7}" for i in range(12)], "p0": ["0"] * 12, "t_end": "1"}
    system = nh.System(name="reach", V=reach, parameters={"neighbours": "2"}, **start)
    fixed = nh.System(name="fixed", V=lambda q: reach(q, 2), **start)
    compiled_in, constant = (nh.integrate(one, "leapfrog", 0.1, precision="extended") for one in (system, fixed))
    assert np.array_equal(compiled_in.q, constant.q)


def looped_energy(V, d):
    graph = Graph()
    return LoopedEnergy(graph, value_of(V(graph.variables(d))), d, 0)


@pytest.mark.slow
def test_many_sites_take_as_many_operations_as_twenty():
    assert looped_energy(chain, 300).operations == looped_energy(chain, 20).operations < 50
    assert looped_energy(bodies, 60).operations == looped_energy(bodies, 24).operations
    assert looped_energy(lattice, 200).operations < 100
    assert looped_energy(mean_field, 200).operations < 100


def test_long_sums_that_others_use_are_levels_of_their_own():
    assert [level.size for level in looped_energy(mean_field, 40).levels] == [2, 1]
    assert [level.size for level in looped_energy(embedded, 18).levels] == [18, 1]
    assert [level.size for level in looped_energy(spread, 18).levels] == [1, 1, 1]


@pytest.mark.slow
def test_terms_of_too_many_forms_are_refused_before_compilation():
    def different(q):
        return sum(x * prod(sin(x + k * k) for k in range(i)) for i, x in enumerate(q))

    system = nh.System(name="different", V=different, q0=["1"] * 70, p0=["0"] * 70, t_end="1")
    with pytest.raises(
        SystemDefinitionError, match=r"different: V takes [0-9]+ operations, .* terms of one form once: at most 4000"
    ):
        nh.integrate(system, "leapfrog", 0.1)


def test_tuples_in_a_formula_are_pointed_to_arrays():
    system = nh.System(name="pairs", V=lambda q: sum(q[1:] - q[:-1]), q0=["1", "2"], p0=["0", "0"], t_end="1")
    with pytest.raises(SystemDefinitionError, match=r"V raises TypeError.*nearharmonic\.math\.array makes arrays"):
        nh.integrate(system, "leapfrog", 0.1)


def test_runs_ascend_by_one_or_stand_still():
    """Neither rows that jump nor those that ascend by two are runs."""
    columns = [np.array([9, 1, 2, 3, 4, 5, 6, 7, 8, 20, *range(30, 50, 2)]), np.array([5] * 20)]
    assert [np.arange(20)[part].tolist() for part in runs(columns, 20)] == [list(range(1, 9)), [0, *range(9, 20)]]


def test_a_sum_is_added_in_pairs():
    """Pairwise, (1 + 1e-16) + (-1 + 1e-16) = 1.1e-16 as doubles; one after the other, the sum is 1e-16."""
    assert sum([1.0, 1e-16, -1.0, 1e-16]) == 2.0**-53
    assert sum(x for x in ()) == 0
    assert sum(np.arange(6.0).reshape(2, 3)) == 15


def test_an_array_of_a_formula_holds_numbers_of_any_type():
    assert array((1.5, 2.5), 2, 1).shape == (2, 1)
    over_time = array((np.arange(3.0), np.ones(3)))
    assert (over_time[1:] - over_time[:-1])[0].tolist() == [1, 0, -1]
    assert sum(sqrt(array((mpf(2), mpf(3))))) == mp.sqrt(2) + mp.sqrt(3)
    assert sqrt(array((4.0, 9.0))).tolist() == [2, 3]


# --- Products of rational coefficients and powers of a step size against rational arithmetic, and their cache


RNG = random.Random(1)
#: Kinds of step sizes: any; short decimals; few bits; multiples of 3 and 5, for which n/24 or n/5 may be half-way
#: between two doubles; 27 bits, whose square is half-way; both ends of what is promised.
TAUS = (
    lambda: RNG.uniform(-1, 1), lambda: round(RNG.uniform(0.01, 9), 2), lambda: RNG.randint(-999, 999) * 2.0**-9,
    lambda: 3 * RNG.randint(1, 2**51) * 2.0**-52, lambda: 5 * RNG.randint(1, 2**50) * 2.0**-51,
    lambda: (2 * RNG.randint(2**25, 2**26) + 1) * 2.0**-30, lambda: 10.0 ** RNG.uniform(-80, -70),
    lambda: -(10.0 ** RNG.uniform(70, 80)),
)  # fmt: skip


def filled(rows, power, tau, flags=None):
    table, found = table_of(rows, (1, 1, power)), np.empty(COLUMNS * len(rows))
    fill(table, np.zeros(len(rows)) if flags is None else flags, power, tau, found)
    return found.reshape(len(rows), COLUMNS)


@pytest.mark.slow
@pytest.mark.parametrize("draws", [1, pytest.param(5, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", plain_integrators)
def test_moves_have_the_bits_of_rational_arithmetic(name, draws):
    tableau = nh.integrators[name]
    rows = [tuple(Fraction(*x) for x in row) for row in exact_products(tableau)]
    for tau in [draw() for draw in TAUS for _ in range(draws)]:
        np.testing.assert_array_equal(filled(rows, 2, tau), moves(tableau, [Fraction(tau)], 1)[0], repr(tau))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, t in nh.modified_integrators.items() if not t.processed])
def test_modified_moves_have_the_bits_of_rational_arithmetic(name):
    tableau = nh.modified_integrators[name]
    for tau in [draw() for draw in TAUS for _ in range(4)]:
        exact = moves(tableau, [Fraction(tau)], 1)[0]
        np.testing.assert_array_equal(filled(tableau.moves(), 3, tau, exact[:, -1]), exact, repr(tau))


#: Seven over a multiple of 3 or 5, or decimals of that, with the factor of step sizes that cancels it.
SEVENTHS = {
    "seven 24ths": (Fraction(7, 24), 3),
    "decimals below": (Fraction("0.2916" + "6" * 72), 3),
    "decimals above": (Fraction("0.2916" + "6" * 71 + "7"), 3),
    "a hundred digits": (Fraction("1.1" + "6" * 98 + "7"), 3),
    "seven 20ths": (Fraction(7, 20), 5),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SEVENTHS)
def test_ties_and_what_is_near_them_are_rounded_once(name):
    k, factor = SEVENTHS[name]
    for _ in range(100):
        # 7 m is odd and has 54 bits: half-way between two doubles.
        m = RNG.randrange(2**53 // 7 // 2 + 1, 2**53 // 5 // 2) * 2 + 1
        tau = Fraction(factor * m, 2**50)
        found = filled([(k, -k, -k * k)], 2, float(tau))[0]
        assert found[:REST].tolist() == [float(x) for x in (k * tau, -k * tau, -((k * tau) ** 2))], m
        rest = Fraction(found[KICK]) * Fraction(found[DRIFT]) - Fraction(found[PRODUCT])
        assert found[REST] == float(rest)


@pytest.mark.slow
def test_a_step_size_that_is_no_number_gives_none():
    for tau in (np.nan, np.inf):
        assert not np.isfinite(filled([(Fraction(1, 3), Fraction(1, 3), Fraction(1, 9))], 2, tau)).any()


@pytest.mark.slow
def test_threads_recall_the_moves_that_they_ask_for():
    """Different moves at one memory address."""
    rows = [(Fraction(1, k), Fraction(-k, 7), Fraction(-1, 7)) for k in range(1, 10)]
    table, flags = table_of(rows, (1, 1, 2)), np.zeros(len(rows))
    slots = address_of(empty_slots(COLUMNS * len(rows)))

    @numba.njit(nogil=True)
    def differences(taus):
        found, expected, wrong = np.empty(COLUMNS * len(flags)), np.empty(COLUMNS * len(flags)), 0
        for tau in taus:
            recall(slots(), table, flags, 2, tau, found)
            fill(table, flags, 2, tau, expected)
            wrong += (found != expected).any()
        return wrong

    values = np.random.default_rng(1).uniform(0.1, 1, 2 * SLOTS)  # so that most slots have readers and writers
    taus = np.random.default_rng(2).choice(values, (4, 200_000))
    differences(taus[0, :1])
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(differences, taus)) == [0] * 4
