"""The comparison of gradients with energies at first use: what it finds, and that it rejects no correct system."""

import pickle
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from itertools import combinations, pairwise
from threading import Barrier

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import cos, mpf

import nearharmonic as nh
import nearharmonic.math
from nearharmonic import math
from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.number import FUNCTIONS, Constant
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems import System
from nearharmonic.systems.formulas import DerivedGradient
from nearharmonic.systems.gradients import Multiprecision, check_gradients
from support.methods.own_systems import spring
from support.oracles.multiprecision import digits_of
from support.oracles.random_formulas import mpmaths


def system(V, grad_V, q0=("1",), **more):
    return System(name="mine", V=V, grad_V=grad_V, q0=q0, **({"p0": ("0.5",) * len(q0), "t_end": "1"} | more))


def contradiction(made):
    """(formula, component, its value, the derivative, the point) as the error states them."""
    with pytest.raises(SystemDefinitionError) as caught:
        check_gradients(made)
    number = r"([-+.\de]+)"
    values = rf"at \w = \((.*)\) it is {number}, and the derivative of \w is {number}"
    pattern = rf"mine: (grad_\w)\[(\d+)\] contradicts \w: {values}"
    match = re.fullmatch(pattern, str(caught.value))
    assert match, str(caught.value)
    formula, index, point, value, derivative = match.groups()
    coordinates = re.findall(number, point.partition(" ... ")[0])
    return formula, int(index), float(value), float(derivative), list(map(float, coordinates))


def half_square(q):
    return sum(x * x for x in q) / 2


def coulomb(q, k):
    return k / sqrt(q[0] * q[0] + q[1] * q[1])


def coulomb_gradient(q, k):
    r = sqrt(q[0] * q[0] + q[1] * q[1])
    return -k * q[0] / r**3, -k * q[1] / r**3


def lennard_jones(q):
    return 4 * ((q[1] - q[0]) ** -12 - (q[1] - q[0]) ** -6)


def lennard_jones_gradient(q):
    force = 4 * (12 * (q[1] - q[0]) ** -13 - 6 * (q[1] - q[0]) ** -7)
    return force, -force


CORRECT = {
    "zero start": system(lambda q: q[0] ** 2 + q[0] ** 3, lambda q: (2 * q[0] + 3 * q[0] ** 2,), q0=("0",)),
    "flat start": system(lambda q: q[0] ** 9, lambda q: (9 * q[0] ** 8,), q0=("0",)),
    "equilibrium": system(lambda q: q[0] ** 3 / 3 - q[0], lambda q: (q[0] ** 2 - 1,)),
    "equilibrium with a rounded third": system(lambda q: 1 / 3 * q[0] ** 3 - q[0], lambda q: (q[0] ** 2 - 1,)),
    "rounded numbers": system(lambda q: 0.3333333333333333 * q[0] ** 3 + 0.1 * q[0] + np.float64(0.2) * q[0],
                              lambda q: (q[0] ** 2 + 0.3,)),
    "constant energy": system(lambda q: 5, lambda q: (0,)),
    "free along y": system(lambda q: q[0] ** 4, lambda q: (4 * q[0] ** 3, 0), q0=("1", "2")),
    "free by rounding": system(lambda q: q[0] / q[1] * q[1], lambda q: (1, 0), q0=("1", "3")),
    "only differences": system(lambda q: (q[0] - q[1]) ** 2, lambda q: (2 * (q[0] - q[1]), 2 * (q[1] - q[0])),
                               q0=("1e9", "1000000001")),
    "a large constant": system(lambda q: 1e30 + q[0] ** 2, lambda q: (2 * q[0],)),
    "tiny units": system(coulomb, coulomb_gradient, q0=("5.3e-11", "0"), parameters={"k": "-2.3e-28"}),
    "huge units": system(coulomb, coulomb_gradient, q0=("1.5e11", "0"), parameters={"k": "-1.3e20"}),
    "extreme units": system(coulomb, coulomb_gradient, q0=("1e-200", "2e-200"), parameters={"k": "-1e-300"}),
    "mixed units": system(lambda q: q[0] ** 2 * 1e-12 + q[1] ** 2 / q[0],
                          lambda q: (2e-12 * q[0] - (q[1] / q[0]) ** 2, 2 * q[1] / q[0]), q0=("1e6", "0.001")),
    "start at a singularity": system(coulomb, coulomb_gradient, q0=("0", "0"), parameters={"k": "1"}),
    "a singularity near the start": system(lambda q: 1 / (q[0] - 1), lambda q: (-1 / (q[0] - 1) ** 2,),
                                           q0=("1.0000001",)),
    "singular everywhere": system(lambda q: 1 / (q[0] - q[0]), lambda q: (q[0],)),
    "a narrow domain": system(lambda q: -sqrt(1 - 1e12 * q[0] ** 2),
                              lambda q: (1e12 * q[0] / sqrt(1 - 1e12 * q[0] ** 2),), q0=("0",)),
    "half powers": system(lambda q: q[0] ** 2.5 + q[0] ** -0.5, lambda q: (2.5 * q[0] ** 1.5 - 0.5 * q[0] ** -1.5,)),
    "modulus": system(lambda q: abs(q[0]) ** 3 / 3, lambda q: (q[0] * abs(q[0]),), q0=("-2",)),
    "a kink at the start": system(lambda q: abs(q[0]), lambda q: (q[0] / abs(q[0]),), q0=("0",)),
    "steep": system(lennard_jones, lennard_jones_gradient, q0=("1000", "1001.1")),
    "a root of a parameter": system(lambda q, k: k**0.5 * q[0], lambda q, k: (sqrt(k),), parameters={"k": "2"}),
    "numpy": system(lambda q: np.sum(np.array(q) ** 2) / 2, np.array, q0=("1", "2")),
    "kinetic energy": system(half_square, lambda q: q, T=lambda p: sqrt(1 + p[0] ** 2), p0=("0",),
                             grad_T=lambda p: (p[0] / sqrt(1 + p[0] ** 2),)),
    "a long chain": system(lambda q: sum((b - a) ** 2 / 2 + (b - a) ** 3 / 3 for a, b in pairwise(q)),
                           lambda q: [(q[i] - q[i - 1] + (q[i] - q[i - 1]) ** 2 if i else 0)
                                      - (q[i + 1] - q[i] + (q[i + 1] - q[i]) ** 2 if i < 39 else 0) for i in range(40)],
                           q0=("0", "0.1") * 20),
}  # fmt: skip


@pytest.mark.parametrize("case", CORRECT)
def test_a_correct_system_is_never_rejected(case):
    check_gradients(CORRECT[case])


@pytest.mark.parametrize("factor", [-1, 2, 0, 1 + 1e-9, 1 - 3e-11])
@pytest.mark.parametrize("scale", ["1e-150", "1", "1e150"])
def test_a_wrong_factor_is_found_in_any_units(factor, scale):
    made = system(half_square, lambda q: (q[0], factor * q[1], q[2]), q0=(scale, scale, scale))
    formula, index, value, derivative, point = contradiction(made)
    assert (formula, index) == ("grad_V", 1)
    assert derivative == pytest.approx(point[1], rel=1e-15)
    assert value == pytest.approx(factor * point[1], rel=1e-15)
    # Near the start: within an eighth of it.
    assert all(abs(x / float(scale) - 1) < 1 / 8 for x in point)


@pytest.mark.parametrize("wrong", [0, 1, 6, 11, 12, 28, 29])
@pytest.mark.parametrize("d", [12, 13, 30])
def test_one_wrong_component_of_many_is_named(wrong, d):
    made = system(
        half_square, lambda q: [x * (1 + 1e-9 * (i == wrong)) for i, x in enumerate(q)], q0=("1", "-2", "0.5") * 10
    )
    made = system(half_square, made.grad_V, q0=made.q0[:d])
    if wrong >= d:
        check_gradients(made)
        return
    formula, index, value, derivative, point = contradiction(made)
    assert (formula, index) == ("grad_V", wrong)
    assert value == pytest.approx(derivative * (1 + 1e-9), rel=1e-13)
    assert 4 <= len(point) <= min(d, 12)  # a long message leaves out its middle


def test_a_component_that_should_vanish_is_found():
    wrong = system(lambda q: q[0] ** 2, lambda q: (2 * q[0], 1e-9), ("1", "1"))
    formula, index, value, derivative, _ = contradiction(wrong)
    assert (formula, index, value, derivative) == ("grad_V", 1, 1e-9, 0)


def test_wrong_term_that_is_small_away_from_start_is_found():
    """The repulsion of two atoms a unit apart at coordinates of 1000: negligible a few units further."""

    def wrong(q):
        force = 4 * (12 * (q[1] - q[0]) ** -13 * (1 + 1e-6) - 6 * (q[1] - q[0]) ** -7)
        return force, -force

    assert contradiction(system(lennard_jones, wrong, q0=("1000", "1001.1")))[:2] == ("grad_V", 0)


def test_the_kinetic_energy_is_compared_too():
    wrong = system(half_square, lambda q: q, T=lambda p: p[0] ** 4, grad_T=lambda p: (p[0],))
    formula, _, value, derivative, (p,) = contradiction(wrong)
    assert formula == "grad_T"
    assert (value, derivative) == (pytest.approx(p), pytest.approx(4 * p**3))
    assert contradiction(system(half_square, lambda q: q, grad_T=lambda p: (2 * p[0],)))[0] == "grad_T"


coefficients = st.lists(st.fractions(-9, 9, max_denominator=9), min_size=6, max_size=6)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(coefficients, st.integers(0, 5), st.sampled_from(["1", "-2.5"]))
def test_polynomial_gradient_passes_and_any_changed_coefficient_is_found(terms, changed, start):
    """V = sum of c_jk x^j y^k, one coefficient of dV/dx too large by 1e-6 of it.

    At a coordinate near 1 or -2.5 that is at least 1e-6 * 0.9 / 9; dV/dx has five terms below 9 * 4 * 2.7^3, each the
    result of fewer than ten operations, so that less than 1e-12 * 5 * 710 * 10 = 4e-8 is allowed.
    """
    exponents = [(1, 0), (2, 1), (0, 3), (1, 1), (3, 2), (4, 0)]

    def V(q):
        return sum(c * q[0] ** j * q[1] ** k for c, (j, k) in zip(terms, exponents, strict=True))

    def gradient(factors):
        def grad_V(q):
            x = sum(
                f * c * j * q[0] ** (j - 1) * q[1] ** k
                for f, c, (j, k) in zip(factors, terms, exponents, strict=True)
                if j
            )
            return x, sum(c * k * q[0] ** j * q[1] ** (k - 1) for c, (j, k) in zip(terms, exponents, strict=True) if k)

        return grad_V

    for q0 in ((start, "1"), ("0", "0"), ("0", start)):
        check_gradients(system(V, gradient([1] * 6), q0=q0))
    if exponents[changed][0] and terms[changed]:
        wrong = gradient([1 + Fraction(1, 10**6) * (i == changed) for i in range(6)])
        assert contradiction(system(V, wrong, q0=(start, "1")))[:2] == ("grad_V", 0)


def test_a_gradient_that_contradicts_its_potential_integrates_nothing(monkeypatch):
    """Before a kernel is compiled, in each function that integrates, and again at the next call."""

    def none(*_, **__):
        raise AssertionError

    monkeypatch.setattr("nearharmonic.core.kernel.build", none)
    made = system(half_square, lambda q: (-q[0],))
    for _ in range(2):
        with pytest.raises(SystemDefinitionError, match=r"mine: grad_V\[0\] contradicts V"):
            nh.integrate(made, "ruth", 0.1)
    with pytest.raises(SystemDefinitionError, match=r"mine: grad_V\[0\] contradicts V"):
        nh.sweep(made, "ruth", [0.1], precision="extended")


def test_a_system_is_compared_once():
    calls = []

    def V(q):
        calls.append(q)
        return half_square(q)

    made = system(V, lambda q: q)
    check_gradients(made)
    first = len(calls)
    check_gradients(made)
    assert 0 < first == len(calls) < 20


def test_neither_the_users_decimal_context_matters_nor_is_it_changed():
    from decimal import Context, Inexact, getcontext, localcontext

    with localcontext(Context(prec=3, traps=[Inexact])):
        check_gradients(system(coulomb, coulomb_gradient, q0=("69.8234", "1"), parameters={"k": "-1.71994752"}))
        assert getcontext().prec == 3
        assert getcontext().traps[Inexact]


def test_natural_formulas_integrate_to_double_doubles_precision():
    """Constant gradients, literals, powers and abs; a uniform force: the exact orbit is a parabola."""
    made = system(lambda q: 0.1 * q[0] + abs(-2) * 0.15, lambda q: (0.1,), q0=("3",), p0=("0.5",))
    run = nh.integrate(made, "aba864", 0.1, precision="extended")
    # One tenth in double-double as well: rounded to a double it would be off by 5e-18.
    for found, low, exact in (
        (run.q[-1, 0], run.q_low[-1, 0], "3.45"), (run.p[-1, 0], run.p_low[-1, 0], "0.4"),
        (run.initial_energy, run.initial_energy_low, "0.725"),
    ):  # fmt: skip
        assert abs(mpmath.mpf(found.item()) + mpmath.mpf(low.item()) - mpmath.mpf(exact)) < 1e-29
    assert run.max_energy_error.item() < 1e-30


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_multiprecision_has_200_digits_and_the_condition_of_its_slopes(name):
    """Slopes by mpmath's differences; 9 digits of the condition are kept."""
    operands = [Multiprecision.of(Constant(k + 3, 7)) for k in range(len(FUNCTIONS[name]))]
    result = getattr(nearharmonic.math, name)(*operands)
    with mpmath.workdps(230):
        function = mpmaths(name)
        exact = [mpmath.mpf(k + 3) / 7 for k in range(len(operands))]
        value = function(*exact)
        assert abs(mpmath.mpf(str(result.value)) / value - 1) < mpmath.mpf(10) ** -198
        size = abs(value)
        for i, x in enumerate(exact):
            order = tuple(int(i == j) for j in range(len(exact)))
            size += abs(mpmath.diff(function, tuple(exact), order) if len(exact) > 1 else mpmath.diff(function, x)) * x
        assert float(result.size) == pytest.approx(float(size), rel=1e-7)


def test_multiprecision_has_no_value_where_a_function_has_none():
    with pytest.raises(ArithmeticError, match="log has no finite value"):
        nearharmonic.math.log(Multiprecision.of(Constant(-1)))
    with pytest.raises(ArithmeticError, match="cbrt has no finite value and slope"):
        nearharmonic.math.cbrt(Multiprecision.of(Constant(0)))


# --- Systems without gradients of their own: the same curves as with them, in every number type, from V alone


PAPER = {"sho": 0.1, "henon_heiles": 0.1, "kepler": 20.0}


@pytest.mark.parametrize("name", [*PAPER, "relativistic_oscillator"])
def test_derived_gradients_are_those_given_in_every_number_type(name):
    given = nh.systems[name]
    derived = replace(given, grad_V=None, grad_T=None)
    q = ("0.3", "-0.7")[: given.dimension]
    for kind, close in ((float, 1e-14), (mpf, mpf(10) ** -50), (lambda x: np.array([float(x), 0.5]), 1e-14)):
        values, constants = tuple(map(kind, q)), given.constants(kind)
        for formula, others in (("grad_V", constants), ("grad_T", ())):
            pairs = zip(*(getattr(one, formula)(values, *others) for one in (given, derived)), strict=True)
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
    """-GM/r: (1/r^3 - 3 q q^T / r^5) GM v. With a time, the Hessian of the coordinates alone."""
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
