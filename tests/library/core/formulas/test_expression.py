"""Expressions: values and derivatives of random formulas against mpmath, and how they are simplified."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise

import mpmath
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mpf

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression import Expression, Graph, Sum, gradient, hessian_vector, value_of
from nearharmonic.core.number import Constant, FormulaError
from nearharmonic.core.program import is_quadratic, program, shortest_program
from support.oracles.random_formulas import EVERY, EXACT, LARGE, LITERALS, mpmaths, randomly, trees, truth, written

#: Digits, the step of differences, and how far values may differ: a central difference is off by STEP^2 = 1e-80 of the
#: third derivative and by 10^(40 - DIGITS) of the value, both below 1e20 in the domain of ``truth``.
DIGITS, STEP, TOLERANCE = 140, mpf(10) ** -40, mpf(10) ** -45
VARIABLES = 3
numbers = st.integers(-2000, 2000).map(lambda n: mpf(n) / 700 + mpf(n) ** 2 / 10**9)
points = st.lists(numbers, min_size=VARIABLES, max_size=VARIABLES)
START = [mpf("0.3"), mpf("-0.8"), mpf("1.1")]


def apply(name, *arguments):
    return (
        (-1 if arguments[0] < 0 else 1) if name == "sign" else mpmaths("sqrt" if name == "root" else name)(*arguments)
    )


def run(made, arguments):
    return made.run(arguments, lambda c: mpf(c.numerator) / c.denominator, apply)


def traced(tree, count=VARIABLES):
    graph = Graph()
    q = graph.variables(count)
    result = written(tree, q)
    assume(isinstance(result, Expression))
    return graph, value_of(result), [x.value for x in q]


def beside(q, direction):
    return ([x + sign * STEP * d for x, d in zip(q, direction, strict=True)] for sign in (1, -1))


@settings(randomly, max_examples=250)
@given(trees(LITERALS + EXACT, VARIABLES), points)
@example(EVERY, START)
@example(("**", ("+", 0, ("abs", 0)), 2), START)
def test_values_and_gradients_are_mpmaths(tree, q):
    with mpmath.workdps(DIGITS):
        expected, _ = truth(tree, q)
        graph, value, variables = traced(tree)
        for made in (program(graph, [value]), shortest_program(graph, [value], value)):
            assert abs(run(made, q)[0] - expected) < TOLERANCE * (1 + abs(expected))
        found = run(shortest_program(graph, gradient(graph, value, variables), value), q)
        for i, derivative in enumerate(found):
            ahead, behind = (truth(tree, x)[0] for x in beside(q, [int(i == j) for j in range(VARIABLES)]))
            expected = (ahead - behind) / (2 * STEP)
            assume(abs(expected) < LARGE**4)
            assert abs(derivative - expected) < TOLERANCE * (1 + abs(expected)) * LARGE


@pytest.mark.slow
@settings(randomly, max_examples=150)
@given(trees(LITERALS + EXACT, VARIABLES), points)
@example(EVERY, START)
def test_the_hessian_times_a_vector_is_the_difference_of_gradients(tree, q):
    with mpmath.workdps(DIGITS):
        truth(tree, q)
        graph, value, variables = traced(tree, 2 * VARIABLES)
        x, v = variables[:VARIABLES], variables[VARIABLES:]
        direction = [mpf("0.7"), mpf("-1.3"), mpf("0.2")]
        found = run(shortest_program(graph, hessian_vector(graph, value, x, v), value), [*q, *direction])
        first = program(graph, gradient(graph, value, x))
        for a, b, product in zip(*(run(first, [*at, *direction]) for at in beside(q, direction)), found, strict=True):
            expected = (a - b) / (2 * STEP)
            assume(abs(expected) < LARGE**4)
            assert abs(product - expected) < TOLERANCE * (1 + abs(expected)) * LARGE**2


def test_the_root_of_a_square_is_a_modulus():
    graph = Graph()
    x, y = graph.variables(2)
    for value, at, expected in (
        (sqrt(x * x), -3, 3), (sqrt((x * y) ** 2), -3, 6), ((x**-2) ** 0.5, -4, 0.25), (sqrt(4 * x**2), -1, 2),
        (sqrt(-x), -4, 2), (abs(-2 * x), -3, 6), (sqrt(x * x * x), 4, 8),
    ):  # fmt: skip
        made = program(graph, [value_of(value)])
        assert run(made, [mpf(at), mpf(2)]) == (expected,)


@pytest.mark.slow
def test_a_formula_of_any_depth_is_differentiated():
    """y -> sin y + x, 2000 times: deeper than Python's recursion limit."""
    graph = Graph()
    (x,) = graph.variables(1)
    value = x
    for _ in range(2_000):
        value = value.apply("sin") + x
    made = shortest_program(graph, gradient(graph, value_of(value), [x.value]), value_of(value))
    y, expected = mpf("0.3"), mpf(1)
    for _ in range(2_000):
        y, expected = mpmath.sin(y) + mpf("0.3"), expected * mpmath.cos(y) + 1
    (found,) = run(made, [mpf("0.3")])
    assert abs(found / expected - 1) < 1e-10


def test_a_function_of_too_few_arguments_is_refused():
    with pytest.raises(FormulaError, match="calls atan2 with 1 arguments, expected 2"):
        Graph().variables(1)[0].apply("atan2")


# --- simplification --------------------------------------------------------------------------------------------------


def counted(V, dimension, more=0):
    """Number of operations of each kind in the gradient of V with respect to its first arguments."""
    graph = Graph()
    q = graph.variables(dimension + more)
    value = value_of(V(q[:dimension], *q[dimension:]))
    made = shortest_program(graph, gradient(graph, value, [x.value for x in q[:dimension]]), value)
    names = [operation[0] for operation in made.operations]
    return {name: names.count(name) for name in set(names) - {"variable", "constant", "negate"}}


@pytest.mark.parametrize("n", [2, 7])
def test_partners_share_cube_of_their_distance_and_force_between_them(n):
    def V(q, *m):
        squares = {
            (i, j): sum((q[3 * i + k] - q[3 * j + k]) ** 2 for k in range(3)) for i, j in combinations(range(n), 2)
        }
        return -sum(m[i] * m[j] / sqrt(square) for (i, j), square in squares.items())

    pairs = n * (n - 1) // 2
    found = counted(V, 3 * n, n)
    assert found["root"] == found["divide"] == pairs
    # Three differences a pair; sums of forces: each of the n bodies adds n - 1 in each of three directions.
    assert found["subtract"] + found["add"] <= 3 * pairs + 2 * pairs + 3 * n * (n - 2)
    # Three squares, the square of the square, masses, the root, and three components, for both partners.
    assert found["multiply"] <= 9 * pairs


def test_a_chain_computes_each_spring_once():
    def V(q):
        return sum((b - a) ** 2 / 2 + (b - a) ** 3 / 12 for a, b in pairwise((0, *q, 0)))

    found = counted(V, 32)
    assert found["multiply"] <= 2 * 33
    assert found["subtract"] + found.get("add", 0) <= 31 + 33 + 32


WRITINGS = {
    "x/2*2": (lambda x, y: x / 2 * 2, {}),
    "0*y": (lambda x, y: x + 0 * y, {}),
    "y - y": (lambda x, y: (x + y) - y, {}),
    "a quotient": (lambda x, y: x * y / y, {}),
    "two of a kind": (lambda x, y: y * x + y * x, {"multiply": 2}),
    "expanded": (lambda x, y: ((x + y) ** 2 - (x - y) ** 2) / 4, {}),
    "a root's square": (lambda x, y: sqrt(x) ** 2 * y, {}),
    "a modulus": (lambda x, y: abs(x) ** 3 / 3, {"abs": 1, "multiply": 1}),
    "a cube of a sum": (lambda x, y: (x * x + y * y) ** 3, {"multiply": 7, "add": 1}),
    "Henon and Heiles with few operations": (lambda x, y: (x * x + y * y) / 2 + y * (x * x - y * y / 3),
                                             {"multiply": 4, "add": 2, "subtract": 1}),
    "Henon and Heiles": (lambda x, y: x * x / 2 + y * y / 2 + x * x * y - y**3 / 3,
                         {"multiply": 4, "add": 2, "subtract": 1}),
}  # fmt: skip


@pytest.mark.parametrize("case", WRITINGS)
def test_gradients_are_simplified(case):
    V, most = WRITINGS[case]
    found = counted(lambda q: V(*q), 2)
    assert all(found[name] <= most.get(name, 0) for name in found), found


def test_a_displacement_is_not_multiplied_out():
    """2 (x - 1000) is accurate near 1000; 2 x - 2000 with a factor that is rounded is not, and (x - 1000)^3 is lost."""
    for V in (lambda x: (x - 1000) ** 2 / 3, lambda x: (x - 1000) ** 4, lambda x: (x - 1000) ** 2 + (x - 1000)):
        graph = Graph()
        (x,) = graph.variables(1)
        value = value_of(V(x))
        made = shortest_program(graph, gradient(graph, value, [x.value]), value)
        at = 1000 + 2.0**-30
        (found,) = made.run([at], float, None)
        exact = made.run([Fraction(at)], Fraction, None)[0]
        assert abs(found - exact) < 1e-15 * abs(exact)


QUADRATIC = [
    lambda p, m: sum(x * x for x in p) / 2,
    lambda p, m: (p[0] + p[1]) ** 2 / m + p[2] / 3 + sqrt(m),
    lambda p, m: ((p[0] + 1) ** 3 - p[0] ** 3) / 6,
    lambda p, m: (p[0] * p[0]) ** 2 / (p[0] * p[0]),
    lambda p, m: sqrt(m) * p[0] * p[1] * m.apply("sin"),
    lambda p, m: p[0] / (1 / p[0]),
    lambda p, m: (p[0] ** 2 + p[1] ** 2) ** 2 - (p[0] ** 2 - p[1] ** 2) ** 2 - 4 * p[0] ** 2 * p[1] ** 2 + p[2],
    lambda p, m: (m * p[0]) ** 3 - m**3 * p[0] ** 3 + (p[1] - p[0]) * (p[1] + p[0]),
    lambda p, m: p[0] + 0 * sqrt(1 + p[0] ** 2),
    lambda p, m: Constant(3),
]
NOT_QUADRATIC = [
    lambda p, m: p[0] ** 3,
    lambda p, m: p[0] ** 2 / (1 + sqrt(1 + p[0] ** 2)),
    lambda p, m: p[0] ** 2 + p[1] ** 2 * p[2] / 10**30,
    lambda p, m: abs(p[0]),
    lambda p, m: 1 / p[0],
    lambda p, m: (p[0] + p[1]) ** 3 - p[0] ** 3,
    lambda p, m: sqrt(p[0]) * p[0] ** 1.5 + sqrt(p[1]),
    lambda p, m: m ** 2 * p[0] ** 2 * p[1],
]  # fmt: skip


@pytest.mark.parametrize(("T", "expected"), [(T, True) for T in QUADRATIC] + [(T, False) for T in NOT_QUADRATIC])
def test_polynomial_of_degree_two_is_known_however_it_is_written(T, expected):
    graph = Graph()
    *p, m = graph.variables(4)
    value = value_of(T(p, m))
    assert is_quadratic(graph, value, frozenset(x.value.node for x in p)) == expected


def test_equal_differences_are_one_node_whatever_their_sign():
    graph = Graph()
    x, y = graph.variables(2)
    assert (x - y).value.node == (y - x).value.node
    assert isinstance(graph.nodes[(x - y).value.node], Sum)
    assert (x - y + y - x) == 0
