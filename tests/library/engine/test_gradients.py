"""The comparison of gradients with energies at first use: what it finds, and that it rejects no correct system."""

from __future__ import annotations

import re
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import nearharmonic as nh
import nearharmonic.math
from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.number import FUNCTIONS, Constant
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems import System
from nearharmonic.systems.gradients import Multiprecision, check_gradients
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
    formula, index, value, derivative, _ = contradiction(
        system(lambda q: q[0] ** 2, lambda q: (2 * q[0], 1e-9), ("1", "1"))
    )
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
