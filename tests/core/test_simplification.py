"""What derived expressions share, how they are simplified, and which are quadratic, however they are written."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise

import pytest

from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression.derivative import gradient
from nearharmonic.core.expression.graph import Graph, Sum, value_of
from nearharmonic.core.expression.polynomial import is_quadratic, shortest_program
from nearharmonic.core.number import Constant


def counted(V, dimension, more=0):
    """How often each operation stands in the gradient of V with respect to its first arguments."""
    graph = Graph()
    q = graph.variables(dimension + more)
    value = value_of(V(q[:dimension], *q[dimension:]))
    made = shortest_program(graph, gradient(graph, value, [x.value for x in q[:dimension]]), value)
    names = [operation[0] for operation in made.operations]
    return {name: names.count(name) for name in set(names) - {"variable", "constant", "negate"}}


def bodies(n):
    def V(q, *m):
        points = [q[3 * i : 3 * i + 3] for i in range(n)]
        return -sum(
            m[i] * m[j] / sqrt(sum((a - b) ** 2 for a, b in zip(points[i], points[j], strict=True)))
            for i, j in combinations(range(n), 2)
        )

    return V


@pytest.mark.parametrize("n", [2, 3, 7])
def test_partners_share_the_cube_of_their_distance_and_the_force_between_them(n):
    pairs = n * (n - 1) // 2
    found = counted(bodies(n), 3 * n, n)
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
    "a square": (lambda x, y: x * x / 2, {}),
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
    lambda p, m: (p[0] ** 2 + 3 * p[1] ** 2) / (2 * m),
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
    lambda p, m: sqrt(1 + p[0] ** 2) - 1,
    lambda p, m: p[0] ** 2 / (1 + sqrt(1 + p[0] ** 2)),
    lambda p, m: p[0] ** 2 + p[1] ** 2 * p[2] / 10**30,
    lambda p, m: abs(p[0]),
    lambda p, m: 1 / p[0],
    lambda p, m: p[0].apply("cosh"),
    lambda p, m: (p[0] + p[1]) ** 3 - p[0] ** 3,
    lambda p, m: sqrt(p[0]) * p[0] ** 1.5 + sqrt(p[1]),
    lambda p, m: m ** 2 * p[0] ** 2 * p[1],
]  # fmt: skip


@pytest.mark.parametrize(("T", "expected"), [(T, True) for T in QUADRATIC] + [(T, False) for T in NOT_QUADRATIC])
def test_a_polynomial_of_degree_two_is_known_however_it_is_written(T, expected):
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
