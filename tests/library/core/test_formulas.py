"""Formulas: expressions, constants, and random formulas in every number type."""

from decimal import Decimal, localcontext
from fractions import Fraction
from itertools import combinations, pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mpmath import mpf

from nearharmonic.core import arithmetic
from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression import Expression, Graph, Sum, gradient, hessian_vector, value_of
from nearharmonic.core.number import Constant, FormulaError, Number, constant
from nearharmonic.core.program import is_quadratic, program, shortest_program
from nearharmonic.core.tracing import Double, DoubleDouble
from nearharmonic.systems import System
from nearharmonic.systems.gradients import DIGITS as DECIMAL_DIGITS
from nearharmonic.systems.gradients import Multiprecision, velocity
from support.methods.function_arguments import compiled
from support.oracles.random_formulas import (
    EVERY,
    EXACT,
    LARGE,
    LITERALS,
    NONE,
    OPERATIONS,
    TENTH,
    THREE,
    mpmaths,
    randomly,
    trees,
    truth,
    written,
)

# --- Expressions: values and derivatives of random formulas against mpmath, and how they are simplified


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
        bodies = combinations(range(n), 2)
        squares = {(i, j): sum((q[3 * i + k] - q[3 * j + k]) ** 2 for k in range(3)) for i, j in bodies}
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


# --- Constants of a formula: what literals mean, exact arithmetic, roots, and powers


@pytest.mark.parametrize(
    ("literal", "meaning"),
    [
        (0.1, "1/10"), (-2.5e-7, "-1/4000000"), (np.float64(0.1), "1/10"), (np.float32(0.1), "1/10"), (3, "3"),
        (np.int8(3), "3"), (True, "1"), (Fraction(1, 3), "1/3"), (Decimal("0.7"), "7/10"), (1e300, f"{10**300}"),
    ],
)  # fmt: skip
def test_a_literal_means_the_shortest_decimal_that_it_prints_as(literal, meaning):
    assert type(constant(literal)) is Constant
    assert constant(literal) == Fraction(meaning)


@pytest.mark.parametrize("other", ["1", None, 1j, (1,), np.ones(2), object()])
def test_what_is_no_real_number_is_no_constant(other):
    assert constant(other) is None


rationals = st.fractions(min_value=-1000, max_value=1000, max_denominator=1000)
decimals = st.decimals(min_value=-1000, max_value=1000, places=3)


@pytest.mark.slow
@given(rationals, decimals)
def test_constants_stay_exact_beside_floats(a, b):
    """0.1 + 0.2 is 3/10; a Fraction would have become a float."""
    exact, x, f = Fraction(b), Constant(a), float(b)
    assert x + f == f + x == a + exact
    assert (x - f, f - x) == (a - exact, exact - a)
    assert x * f == f * x == np.float64(f) * x == a * exact
    assert abs(-x) == abs(a)
    assert [x**2, x**4, x**7] == [a**2, a**4, a**7]
    if a and b:
        assert (x / f, f / x, x**-1) == (a / exact, exact / a, 1 / a)
    assert all(type(y) is Constant for y in (x + f, f - x, f * x, -x, +x, abs(x), x**3, x**0))


def test_root_of_constant_is_exact_or_good_to_300_digits():
    assert Constant(4, 9).sqrt() == Fraction(2, 3)
    assert Constant(0).sqrt() == 0
    assert arithmetic.sqrt(Constant(9, 4)) == Fraction(3, 2)
    assert arithmetic.sqrt(Fraction(1, 4)) == 0.5  # no parameter: the root of a float
    assert Constant(1, 9) ** 1.5 == Fraction(1, 27)
    for value in (Constant(2), Constant(1, 10**40), Constant(10**41 + 1)):
        assert abs(value.sqrt() ** 2 / value - 1) < Fraction(1, 10**300)
    with pytest.raises(ArithmeticError, match="negative number -2"):
        Constant(-2).sqrt()


class Recorded(Number):
    """Counts multiplications."""

    multiplications = 0

    def _multiply(self, other):
        Recorded.multiplications += 1
        return self


@pytest.mark.parametrize(
    ("exponent", "most"), [(1, 0), (2, 1), (3, 2), (4, 3), (5, 4), (6, 3), (8, 4), (12, 4), (64, 7), (100, 8)]
)
def test_a_power_takes_few_multiplications(exponent, most):
    Recorded.multiplications = 0
    Recorded() ** exponent
    assert Recorded.multiplications == most


def test_numpys_arrays_work_in_formulas():
    """sum, sqrt and abs of an array of values, and numpy's floats on either side."""
    q = (Multiprecision(Decimal(-3)), Multiprecision(Decimal(4)))
    assert np.sqrt(np.sum(np.array(q) ** 2)).value == 5
    assert np.abs(np.array(q))[0].value == 3
    for half in (np.float64(0.1) * q[0], q[0] * np.float64(0.1), np.float32(0.1) * q[0], q[0] / np.float64(10)):
        assert half.value == Decimal("-0.3")
    assert [x.value for x in np.array([0.1, 1]) * np.array(q)] == [Decimal("-0.3"), 4]
    assert [x.value for x in np.array([0.1, 1]) * q[1]] == [Decimal("0.4"), 4]


# --- Random formulas in every number type against mpmath, with bounds on rounding that follow each operation


U = mpf(2) ** -53
#: Relative error of one operation: constant, sum, product, quotient, root. Those of double-doubles: test_arithmetic.py
#: (a root's error is half its square's); a division by a constant is a product with its rounded inverse.
DOUBLE = dict.fromkeys(NONE, U) | {"function": 2 * U}
EXTENDED = {"constant": U**2, "+": 3.1 * U**2, "*": 5 * U**2, "/": 15 * U**2, "root": 4 * U**2}
EXTENDED["function"] = mpf(2) ** -100
#: Python's and numpy's powers come from the C library, good to one unit in the last place.
LIBRARY = {name: 2 * bound for name, bound in DOUBLE.items()}


def code(tree, kind):
    """The formula in machine code of eight lanes, of columns high, low, high, low; one column is computed alone."""

    def body(x, x_low, y, y_low):
        extended = kind is DoubleDouble
        result = written(tree, (kind(x, x_low), kind(y, y_low)) if extended else (kind(x), kind(y)))
        return result.pair if extended else (result.carrier,)

    return compiled(body, 4, 8, 2 if kind is DoubleDouble else 1)


coordinate = st.floats(0.25, 4).flatmap(lambda x: st.sampled_from([x, -x]))
points_of_tracing = st.tuples(coordinate, coordinate, st.floats(-1, 1), st.floats(-1, 1)).map(
    lambda t: [*arithmetic.two_sum(t[0], t[2] * 2.0**-54), *arithmetic.two_sum(t[1], t[3] * 2.0**-54)]
)


@pytest.mark.slow
@settings(randomly, max_examples=25)
@given(trees(LITERALS + EXACT, functions=False), st.lists(points_of_tracing, min_size=8, max_size=8))
@example(OPERATIONS, [[-0.75, 1e-18, 1.25, -1e-17]] * 8)
@example(("+", ("pow", ("abs", 0), TENTH), ("hypot", ("cbrt", 1), THREE)), [[-0.75, 1e-18, 1.25, -1e-17]] * 8)
def test_machine_code_keeps_the_bounds_of_its_arithmetic(tree, states):
    """Double and double-double, and each lane of eight equals the scalar to the bit; functions: test_functions.py."""
    assume(not isinstance(tree, int))
    exact = [(mpf(a) + mpf(b), mpf(c) + mpf(d)) for a, b, c, d in states]
    heads = [(mpf(a), mpf(c)) for a, _, c, _ in states]
    for kind, bounds, arguments in ((DoubleDouble, EXTENDED, exact), (Double, DOUBLE, heads)):
        expected = [truth(tree, q, bounds) for q in arguments]
        function, columns = code(tree, kind), np.array(states).T
        together = function(columns)
        for k, (value, error) in enumerate(expected):
            single = function(columns[:, k : k + 1])[:, 0]
            assert abs(sum(map(mpf, single)) - value) <= error * (1 + 100 * U)
            assert single.tobytes() == together[:, k].tobytes()


@randomly
@given(trees(LITERALS + EXACT), points_of_tracing)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_multiprecision_agrees_to_its_digits(tree, point):
    """Errors of mpmath at 60 digits, some 1e-60 an operation, dominate the errors at 200 digits."""
    value, error = truth(tree, tuple(mpf(x) for x in point[::2]), dict.fromkeys(NONE, mpf(10) ** -59))
    with localcontext(prec=DECIMAL_DIGITS):
        result = written(tree, tuple(Multiprecision.of(Constant(x)) for x in point[::2]))
    assert abs(mpf(str(result.value)) - value) <= error


@pytest.mark.slow
@randomly
@given(trees(), points_of_tracing)
@example(EVERY, [-0.75, 0.0, 1.25, 0.0])
def test_floats_arrays_and_the_written_text_are_the_same_function(tree, point):
    x, y = point[::2]
    value, error = truth(tree, (mpf(x), mpf(y)), LIBRARY)
    made = System(
        name="random", V=lambda q: q[0], grad_V=lambda q: (written(tree, q), 0), q0=("1", "1"), p0=("0", "0"), t_end="1"
    )
    *_, text, zero = velocity(made)(x, y, 0.0, 0.0)
    assert zero == 0
    for result in (written(tree, (x, y)), written(tree, (np.array([x]), np.array([y])))[0], -text):
        assert abs(mpf(float(result)) - value) <= error
