"""Formulas that are compiled as loops: one step of many systems against mpmath, and the bits of unrolled kernels."""

from __future__ import annotations

from itertools import combinations, pairwise
from math import prod
from types import SimpleNamespace

import numpy as np
import pytest
from mpmath import mp, mpf, workdps

import nearharmonic as nh
from nearharmonic.core import expression as size
from nearharmonic.core.expression import Graph, value_of
from nearharmonic.core.terms import LoopedEnergy, runs
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.math import array, atan2, cos, exp, sin, sqrt, sum
from support.oracles.multiprecision import digits_of, trajectory

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


SYSTEMS = {
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
    V, d, more = SYSTEMS[name]
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
        for name in SYSTEMS
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


KICK, DRIFT, NONE = ("compensated", "kick", "every"), ("plain", "drift", "samples"), ("compensated", "drift", "none")
#: The other case of .ci/run, beside that of README's command.
SECOND = ("driven", KICK)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("embedded", DRIFT),
        *(
            pytest.param(name, settings, marks=pytest.mark.slow if (name, settings) == SECOND else pytest.mark.long)
            for name in ("driven", "uneven", "embedded") for settings in (KICK, DRIFT, NONE)
            if (name, settings) != ("embedded", DRIFT)
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
    """Sums have only one order here: each force is that of two bonds."""

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


def test_the_layout_of_loops_is_that_of_their_terms():
    """Each of 63 bonds has two derivatives, either end one, and each of 45 pairs six; in whole blocks of eight."""
    assert looped_energy(chain, 64).room == 64 + 2 * 64 + 8
    assert looped_energy(bodies, 30).room == 32 + 6 * 48
    # A component of the gradient is summed in the order of the loops.
    assert all((np.diff(totals.sources, axis=1) > 0).all() for totals in looped_energy(bodies, 60).gradient_of(0))


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
