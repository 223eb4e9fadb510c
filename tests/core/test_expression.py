"""Expressions of random formulas, their gradients and Hessians, against mpmath's arithmetic and differences."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mpf

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression import graph as graph_module
from nearharmonic.core.expression.derivative import gradient, hessian_vector
from nearharmonic.core.expression.graph import Expression, Graph, value_of
from nearharmonic.core.expression.polynomial import shortest_program
from nearharmonic.core.expression.writer import program
from nearharmonic.core.number import FUNCTIONS, Constant, FormulaError

#: Digits, the step of differences, and how far values may differ: a central difference is off by STEP^2 = 1e-80 of the
#: third derivative and by 10^(40 - DIGITS) of the value, both below 1e20 in the domain of ``truth``.
DIGITS, STEP, TOLERANCE = 140, mpf(10) ** -40, mpf(10) ** -45
VARIABLES = 3
#: Distance that arguments keep from where a function is not analytic, and the largest value.
AWAY, LARGE = mpf("0.05"), mpf(1000)

# A formula is a variable (its number), a constant (its decimal), or (operation, operands...).
CONSTANTS = ["2", "-1", "0.1", "3", "-2.5", "0", "1", "4"]
EXPONENTS = [2, 3, 5, -1, -2, -4, 0.5, 1.5, -0.5, -1.5, -2.5]
UNARY = ["neg", "abs", "sqrt", *(name for name, arity in FUNCTIONS.items() if arity == 1)]
BINARY = ["+", "-", "*", "/", *(name for name, arity in FUNCTIONS.items() if arity == 2)]


def extended(inner):
    return st.one_of(
        st.tuples(st.sampled_from(BINARY), inner, inner),
        st.tuples(st.sampled_from("+-*/"), inner, inner),
        st.tuples(st.sampled_from(UNARY), inner),
        st.tuples(st.just("**"), inner, st.sampled_from(EXPONENTS)),
    )


trees = st.recursive(st.integers(0, VARIABLES - 1) | st.sampled_from(CONSTANTS), extended, max_leaves=9)
numbers = st.integers(-2000, 2000).map(lambda n: mpf(n) / 700 + mpf(n) ** 2 / 10**9)
points = st.lists(numbers, min_size=VARIABLES, max_size=VARIABLES)
randomly = settings(
    max_examples=250, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow]
)
#: Every function once.
EVERY = "0"
for _name in (*UNARY, *BINARY):
    _arguments = [("+", ("*", 0, 0), "3"), ("+", ("*", 1, 2), "4")][: 1 if _name in UNARY else 2]
    EVERY = ("+", EVERY, ("*", ("sin", 1), (_name, *_arguments)))
START = [mpf("0.3"), mpf("-0.8"), mpf("1.1")]

#: mpmath's functions of real numbers.
PLAIN = ("sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "erf", "hypot")
TRUE = {name: getattr(mpmath, name) for name in PLAIN} | {
    "cbrt": lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)),
    "pow": mpmath.power,
    "root": mpmath.sqrt,
}
#: Where an operation is analytic, and far from where it is not.
DOMAIN = {
    "/": lambda a, b: abs(b) > AWAY,
    "sqrt": lambda a: a > AWAY,
    "log": lambda a: a > AWAY,
    "abs": lambda a: abs(a) > AWAY,
    "tan": lambda a: abs(mpmath.cos(a)) > AWAY,
    "cbrt": lambda a: abs(a) > AWAY,
    "pow": lambda a, b: a > AWAY,
    "exp": lambda a: abs(a) < 7,
    "sinh": lambda a: abs(a) < 7,
    "cosh": lambda a: abs(a) < 7,
    "erf": lambda a: abs(a) < 4,
    "atan2": lambda a, b: abs(a) > AWAY or b > AWAY,
    "hypot": lambda a, b: abs(a) + abs(b) > AWAY,
}


def written(tree, q):
    """The formula as a user writes it, on expressions."""
    if isinstance(tree, int):
        return q[tree]
    if isinstance(tree, str):
        return Fraction(tree)
    name, *operands = tree
    if name == "**":
        base = written(operands[0], q)
        assume(isinstance(base, Expression))
        return base ** operands[1]
    values = [written(operand, q) for operand in operands]
    # Operations on constants alone are those of Python or of Constant, and tested there.
    assume(any(isinstance(x, Expression) for x in values))
    if name in FUNCTIONS:
        assume(isinstance(values[0], Expression))
        return values[0].apply(name, *(x if isinstance(x, Expression) else Constant(x) for x in values[1:]))
    return operation(name)(*values)


def operation(name):
    return {
        "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
        "neg": lambda a: -a, "abs": abs, "sqrt": sqrt,
    }[name]  # fmt: skip


def truth(tree, q, check=True):
    """Value in mpmath; formulas that come near where they are not analytic are left out."""
    if isinstance(tree, int):
        return q[tree]
    if isinstance(tree, str):
        return mpf(Fraction(tree).numerator) / Fraction(tree).denominator
    name, *operands = tree
    if name == "**":
        base, exponent = truth(operands[0], q, check), operands[1]
        if check:
            assume(base > AWAY if exponent % 1 else abs(base) > AWAY or exponent > 0)
        value = base ** mpf(exponent)
    else:
        values = [truth(operand, q, check) for operand in operands]
        if check and name in DOMAIN:
            assume(DOMAIN[name](*values))
        value = TRUE[name](*values) if name in TRUE else operation(name)(*values)
    if check:
        assume(abs(value) < LARGE)
    return value


def apply(name, *arguments):
    return (-1 if arguments[0] < 0 else 1) if name == "sign" else TRUE[name](*arguments)


def run(made, arguments):
    return made.run(arguments, lambda c: mpf(c.numerator) / c.denominator, apply)


def traced(tree, count=VARIABLES):
    graph = Graph()
    q = graph.variables(count)
    result = written(tree, q)
    assume(isinstance(result, Expression))
    return graph, value_of(result), [x.value for x in q]


def slope(tree, q, direction):
    ahead, behind = ([x + sign * STEP * d for x, d in zip(q, direction, strict=True)] for sign in (1, -1))
    return (truth(tree, ahead, False) - truth(tree, behind, False)) / (2 * STEP)


@randomly
@given(trees, points)
@example(EVERY, START)
def test_a_traced_formula_has_the_value_of_the_formula(tree, q):
    with mpmath.workdps(DIGITS):
        expected = truth(tree, q)
        graph, value, _ = traced(tree)
        for made in (program(graph, [value]), shortest_program(graph, [value], value)):
            (found,) = run(made, q)
            assert abs(found - expected) < TOLERANCE * (1 + abs(expected))


@randomly
@given(trees, points)
@example(EVERY, START)
def test_the_gradient_is_that_of_mpmaths_differences(tree, q):
    with mpmath.workdps(DIGITS):
        truth(tree, q)
        graph, value, variables = traced(tree)
        found = run(shortest_program(graph, gradient(graph, value, variables), value), q)
        for i, derivative in enumerate(found):
            expected = slope(tree, q, [int(i == j) for j in range(VARIABLES)])
            assume(abs(expected) < LARGE**4)
            assert abs(derivative - expected) < TOLERANCE * (1 + abs(expected)) * LARGE


@randomly
@given(trees, points)
@example(EVERY, START)
def test_the_hessian_times_a_vector_is_the_difference_of_gradients(tree, q):
    with mpmath.workdps(DIGITS):
        truth(tree, q)
        graph, value, variables = traced(tree, 2 * VARIABLES)
        x, v = variables[:VARIABLES], variables[VARIABLES:]
        direction = [mpf("0.7"), mpf("-1.3"), mpf("0.2")]
        found = run(shortest_program(graph, hessian_vector(graph, value, x, v), value), [*q, *direction])
        first = program(graph, gradient(graph, value, x))
        ahead, behind = (
            run(first, [*(a + sign * STEP * b for a, b in zip(q, direction, strict=True)), *direction])
            for sign in (1, -1)
        )
        for a, b, product in zip(ahead, behind, found, strict=True):
            expected = (a - b) / (2 * STEP)
            assume(abs(expected) < LARGE**4)
            assert abs(product - expected) < TOLERANCE * (1 + abs(expected)) * LARGE**2


# --- types, sizes -----------------------------------------------------------------------------------------------------


def test_the_root_of_a_square_is_a_modulus():
    graph = Graph()
    x, y = graph.variables(2)
    for value, at, expected in (
        (sqrt(x * x), -3, 3), (sqrt((x * y) ** 2), -3, 6), ((x**-2) ** 0.5, -4, 0.25), (sqrt(4 * x**2), -1, 2),
        (sqrt(-x), -4, 2), (abs(-2 * x), -3, 6), (sqrt(x * x * x), 4, 8),
    ):  # fmt: skip
        made = program(graph, [value_of(value)])
        assert run(made, [mpf(at), mpf(2)]) == (expected,)


def test_one_expression_is_evaluated_on_numbers_of_any_type():
    graph = Graph()
    x, y = graph.variables(2)
    made = program(graph, [value_of((x * x + y / 3) / (x - y) + Fraction(1, 7))])
    exact = Fraction(1, 7) + (Fraction(1, 4) + Fraction(-2, 3)) / (Fraction(1, 2) + 2)
    assert made.run([Fraction(1, 2), Fraction(-2)], Fraction, apply) == (exact,)
    assert made.run([Constant(1, 2), Constant(-2)], Constant, apply) == (exact,)
    assert made.run([0.5, -2.0], float, apply)[0] == pytest.approx(float(exact), rel=1e-15)
    (column,) = made.run([np.array([0.5, 1.0]), np.array([-2.0, 0.0])], float, apply)
    assert column == pytest.approx([float(exact), 1 + 1 / 7], rel=1e-15)
    decimal = made.run([Decimal("0.5"), Decimal(-2)], lambda c: Decimal(c.numerator) / c.denominator, apply)[0]
    assert float(decimal) == pytest.approx(float(exact), rel=1e-15)


def test_a_formula_of_any_depth_is_differentiated():
    """y -> sin y + x, 5000 times: deeper than Python's recursion limit."""
    graph = Graph()
    (x,) = graph.variables(1)
    value = x
    for _ in range(5_000):
        value = value.apply("sin") + x
    made = shortest_program(graph, gradient(graph, value_of(value), [x.value]), value_of(value))
    with mpmath.workdps(20):
        y, expected = mpf("0.3"), mpf(1)
        for _ in range(5_000):
            y, expected = mpmath.sin(y) + mpf("0.3"), expected * mpmath.cos(y) + 1
        (found,) = run(made, [mpf("0.3")])
        assert abs(found / expected - 1) < 1e-10


def test_an_exploding_formula_ends_in_one_sentence(monkeypatch):
    monkeypatch.setattr(graph_module, "MOST_NODES", 1000)
    graph = Graph()
    x, y = graph.variables(2)

    def explode(x, y):
        for _ in range(2000):
            x, y = x * y, x + y

    with pytest.raises(FormulaError, match=r"^takes more than 1000 different operations$"):
        explode(x, y)
    with pytest.raises(FormulaError, match="calls atan2 with 1 arguments, expected 2"):
        Graph().variables(1)[0].apply("atan2")
