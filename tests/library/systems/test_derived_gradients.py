"""Systems without gradients of their own: the same curves as with them, in every number type, from V alone."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from itertools import combinations, pairwise
from threading import Barrier

import mpmath
import numpy as np
import pytest
from mpmath import cos, mpf

import nearharmonic as nh
from nearharmonic import math
from nearharmonic.core.number import Constant
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems import System
from nearharmonic.systems.formulas import DerivedGradient
from nearharmonic.systems.gradients import Multiprecision, check_gradients
from support.methods.own_systems import spring
from support.oracles.multiprecision import digits_of

PAPER = {"sho": 0.1, "henon_heiles": 0.1, "kepler": 20.0}


@pytest.mark.parametrize("name", [*PAPER, "relativistic_oscillator"])
def test_derived_gradients_are_those_given_in_every_number_type(name):
    given = nh.systems[name]
    derived = replace(given, grad_V=None, grad_T=None)
    q = ("0.3", "-0.7")[: given.dimension]
    for kind, close in ((float, 1e-14), (mpf, mpf(10) ** -50), (lambda x: np.array([float(x), 0.5]), 1e-14)):
        values, constants = tuple(map(kind, q)), given.constants(kind)
        for formula, others in (("grad_V", constants), ("grad_T", ())):
            pairs = zip(
                getattr(given, formula)(values, *others), getattr(derived, formula)(values, *others), strict=True
            )
            assert all(np.all(abs(a - b) <= close * abs(a)) for a, b in pairs)
    numbers = tuple(Multiprecision(Decimal(x)) for x in q)
    parameters = given.constants(Constant)
    for a, b in zip(given.grad_V(numbers, *parameters), derived.grad_V(numbers, *parameters), strict=True):
        assert abs(a.value - b.value) < abs(a.value) * Decimal("1e-100")


def test_derivative_that_is_constant_has_shape_of_others():
    made = spring(V=lambda q: q[0] ** 2 + 3 * q[1], grad_V=None, q0=("1", "1"), p0=("0", "0"))
    assert np.array(made.grad_V((np.ones(4), np.ones(4)))).shape == (2, 4)
    assert made.grad_V((Fraction(1), Fraction(1))) == (2, 3)
    assert made.grad_V((1.0, 1.0)) == (2.0, 3.0)
    assert isinstance(made.grad_V((1, 2))[0], float)


def test_the_hessian_times_a_vector_is_known_in_closed_form():
    """-GM/r: (1/r^3 - 3 q q^T / r^5) GM v. With a time, that of the coordinates alone."""
    kepler = nh.systems["kepler"]
    (x, y), (u, v), GM = (mpf("1.5"), mpf("-0.5")), (mpf("0.3"), mpf(2)), mpf("1.7")
    r = mpmath.sqrt(x * x + y * y)
    along = 3 * (x * u + y * v) / r**5
    found = kepler.hessian_V_times((x, y), (u, v), GM)
    for a, b in zip(found, (GM * (u / r**3 - along * x), GM * (v / r**3 - along * y)), strict=True):
        assert abs(a - b) < mpf(10) ** -50
    driven = spring(V=lambda q, t: q[0] ** 3 / 3 * math.cos(t), grad_V=None, time_dependent=True)
    assert driven.hessian_V_times((2.0,), (3.0,), 0.5) == (pytest.approx(12 * np.cos(0.5)),)
    extended = driven.formulas().hessian_V_times((2.0, 0.5), (3.0, 1.0))
    assert extended == pytest.approx([12 * np.cos(0.5) - 4 * np.sin(0.5), -12 * np.sin(0.5) - 8 / 3 * np.cos(0.5)])
    assert driven.formulas().hessian_T_times((2.0, 0.5), (3.0, 1.0)) == (3.0, 0.0)


# --- copies -----------------------------------------------------------------------------------------------------------


def test_a_copy_with_another_energy_derives_its_own_gradient():
    first = spring(grad_V=None, T=lambda p: p[0] ** 4 / 4)
    assert first.grad_T((2.0,)) == (8.0,)
    second = replace(first, V=lambda q: q[0] ** 4, T=lambda p: p[0] ** 6 / 6)
    assert (second.grad_V((2.0,)), second.grad_T((2.0,))) == ((32.0,), (32.0,))
    assert first.grad_V((2.0,)) == (2.0,)
    assert replace(nh.systems["henon_heiles"], V=lambda q: q[0] ** 2, grad_V=None).grad_V((1.0, 1.0)) == (2.0, 0.0)
    assert replace(second, t_end="1").grad_V((2.0,)) == (32.0,)


def test_a_copy_with_other_parameters_derives_with_them():
    made = spring(V=lambda q, n: q[0] ** n, grad_V=None, parameters={"n": "3"})
    assert made.grad_V((2.0,), *made.constants(float)) == (12.0,)
    other = replace(made, parameters={"n": "4"})
    assert other.grad_V((2.0,), *other.constants(float)) == (32.0,)


# --- parameters -------------------------------------------------------------------------------------------------------


def branching(q, k):
    return q[0] ** 2 if k > 1 else q[0] ** 4


def ranging(q, n):
    return sum(q[0] ** i for i in range(int(n)))


PARAMETERS = {
    "factor": (lambda q, k: k * q[0] ** 2, True),
    "root": (lambda q, k: math.sqrt(k) * math.exp(-k * q[0]), True),
    "exponent of a function": (lambda q, k: math.pow(q[0] + 2, k), True),
    "branch": (branching, False),
    "range": (ranging, False),
    "float": (lambda q, k: float(k) * q[0], False),
    "index": (lambda q, k: (q[0], 2 * q[0])[int(k)], False),
}


@pytest.mark.parametrize("case", PARAMETERS)
def test_parameters_are_values_unless_a_formula_needs_to_know_them(case):
    V, expected = PARAMETERS[case]
    made = spring(V=V, grad_V=None, parameters={"k": "1"})
    assert made.parameters_at_run_time == expected
    exact = mpmath.diff(lambda x: V((x,), mpf(1)), mpf("0.7"))
    for k in (1.0, mpf(1), Fraction(1), Constant(1)):
        assert float(made.grad_V((mpf("0.7"),), k)[0]) == pytest.approx(float(exact), rel=1e-12)


def test_gradient_that_branches_on_parameter_keeps_it_constant():
    made = spring(V=lambda q, k: k * q[0] ** 2 / 2, grad_V=lambda q, k: (k * q[0] if k > 0 else 0,),
                  parameters={"k": "1"})  # fmt: skip
    assert not made.parameters_at_run_time
    check_gradients(made)
    bent = spring(V=lambda q, k: q[0] ** 2 if k < 0 else q[0] ** 4, grad_V=None, parameters={"k": "-1"})
    assert bent.grad_V((mpf(2),), mpf(-1)) == (4,)
    assert nh.systems["kepler"].parameters_at_run_time
    assert nh.systems["sho"].parameters_at_run_time


def test_formula_that_fails_says_so_once_with_name_of_energy():
    def V(q):
        return q[0] if q[0] > 0 else -q[0]

    made = spring(V=V, grad_V=None, name="bent")
    for use in (lambda: nh.integrate(made, "ruth", 0.1), lambda: made.grad_V((1.0,)), lambda: check_gradients(made)):
        with pytest.raises(
            SystemDefinitionError, match=r"^bent: V compares a value: .* must not branch; .*numba.njit may"
        ):
            use()


def test_a_value_kept_from_an_earlier_call_is_refused():
    kept = []

    def V(q):
        kept.append(q[0])
        return kept[0] * q[0]

    made = spring(V=V, grad_V=None)
    assert made.grad_V((3.0,)) == (6.0,)
    again = replace(made, t_end="1")
    with pytest.raises(SystemDefinitionError, match="uses a value of an earlier call"):
        again.grad_V((3.0,))


@pytest.mark.parametrize("grad_V", [None, lambda q: q])
def test_a_formula_of_exploding_size_is_refused_before_any_work(monkeypatch, grad_V):
    def V(q):
        x, y = q[0], 1 + q[0]
        for _ in range(10_000):
            x, y = x * y, x + y
        return x

    monkeypatch.setattr("nearharmonic.core.expression.MOST_NODES", 9000)
    monkeypatch.setattr("nearharmonic.core.kernel.build", None)
    with pytest.raises(SystemDefinitionError, match=r"^mine: V takes more than 9000 different operations$"):
        nh.integrate(spring(V=V, grad_V=grad_V, name="mine"), "ruth", 0.1)


def test_large_formula_is_refused_by_number_of_operations(monkeypatch):
    def V(q):
        x = q[0]
        for k in range(500):
            x = math.sin(x - k)
        return x

    monkeypatch.setattr("nearharmonic.core.kernel.build", None)
    words = r"^mine: V takes 1\d{4} operations, a function counted as 10 and terms of one form once: at most 4000 are "
    with pytest.raises(SystemDefinitionError, match=words):
        nh.integrate(spring(V=V, grad_V=None, name="mine"), "ruth", 0.1)


@pytest.mark.slow
def test_sum_of_many_terms_of_one_coordinate_is_loop():
    """A Fourier series of 700 terms: a kick against one of mpmath."""

    def V(q):
        return q[0] ** 2 / 2 + sum(math.sin((k + 1) * q[0]) / (k + 1) ** 3 for k in range(700))

    system = spring(V=V, grad_V=None, name="series", t_end="0.01")
    run = nh.integrate(system, "leapfrog", 0.01, first="kick", precision="extended")
    tau, q, p = mpf("0.01"), mpf(system.q0[0]), mpf(system.p0[0])
    p = p - tau / 2 * (q + sum(cos((k + 1) * q) / (k + 1) ** 2 for k in range(700)))
    # A sum of 700 terms of at most 1, in double-double, times tau.
    assert abs(digits_of(run, "q")[0] - (q + tau * p)) < 1e-27


@pytest.mark.slow
def test_a_gradient_that_would_compile_for_minutes_is_refused_too():
    def grad_V(q):
        x = q[0]
        terms = sum((x - k) ** 2 for k in range(3000))
        return (x * (1 + terms) - x * terms,)

    with pytest.raises(SystemDefinitionError, match=r"^mine: grad_V takes 120\d\d operations, .* at most 4000"):
        check_gradients(spring(grad_V=grad_V, name="mine"))


def test_bodies_and_chains_of_many_coordinates_are_not_too_large():
    def pairs(q):
        points = [q[i : i + 3] for i in range(0, 60, 3)]
        squares = (sum((a - b) ** 2 for a, b in zip(x, y, strict=True)) for x, y in combinations(points, 2))
        return -sum(1 / math.sqrt(square) for square in squares)

    def chain(q):
        return sum((b - a) ** 2 / 2 + (b - a) ** 3 / 12 + (b - a) ** 4 / 40 for a, b in pairwise((0, *q, 0)))

    for V, d in ((pairs, 60), (chain, 250)):
        check_gradients(spring(V=V, grad_V=None, q0=tuple(map(str, range(d))), p0=("0",) * d))


def test_threads_that_derive_at_once_get_the_same():
    """The V of many terms, derived by eight threads that begin together."""
    made = spring(V=lambda q, k: sum((k + i) * q[0] ** i * math.sin(q[0]) for i in range(60)), grad_V=None,
                  parameters={"k": "1"})  # fmt: skip
    barrier = Barrier(8)

    def derive(_):
        barrier.wait()
        return made.grad_V((0.5,), 1.0), made.hessian_V_times((0.5,), (1.0,), 1.0)

    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(derive, range(8)))) == 1


# --- shown, pickled ---------------------------------------------------------------------------------------------------


def quartic(q, k):
    return k * q[0] ** 4


def test_systems_pickle_registered_ones_to_themselves():
    for system in nh.systems.values():
        assert pickle.loads(pickle.dumps(system)) is system
    made = spring(V=quartic, grad_V=None, masses=("2",), parameters={"k": "0.5"})
    made.grad_V((1.0,), 0.5)  # what was derived stays behind
    again = pickle.loads(pickle.dumps(made))
    assert (again.V, again.masses, again.parameters) == (quartic, ("2",), made.parameters)
    assert isinstance(again.grad_V, DerivedGradient)
    assert again.grad_V((1.0,), 0.5) == (2.0,)
    assert again.grad_T((1.0,)) == (0.5,)
    changed = replace(nh.systems["kepler"], t_end="100")
    again = pickle.loads(pickle.dumps(changed))
    assert (again.t_end, again.gravity, again.exact_position) == ("100", True, changed.exact_position)
    with pytest.raises((pickle.PicklingError, AttributeError), match="lambda"):
        pickle.dumps(spring())


def test_building_a_system_calls_no_formula():
    def fails(*_):
        raise AssertionError

    made = System(
        name="late", label="late", V=fails, T=fails, q0=("1",), p0=("0",), t_end="1", source="here",
        units=dict.fromkeys(("q", "p", "t", "energy"), "1"), parameters={"k": "1"},
    )  # fmt: skip
    assert repr(made)
    assert made.formulas().dimension == 1
