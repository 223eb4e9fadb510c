"""Derivatives of expressions: the gradient in reverse mode, and the Hessian times a vector.

In reverse mode a gradient takes a small multiple of the operations of the formula, for any number of variables. Source:
Griewank & Walther, Evaluating Derivatives (2008), doi:10.1137/1.9780898717761, Sections 3.2 and 5.2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cache

from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.expression.nodes import (
    ONE,
    ZERO,
    Application,
    Exact,
    Literal,
    Product,
    Sum,
    Value,
    exact,
)
from nearharmonic.core.formulas.number import ROOT_BITS


def gradient(graph: Graph, root: Value, variables: Sequence[Value]) -> tuple[Value, ...]:
    """Return the derivatives of ``root`` with respect to ``variables``, in reverse mode."""
    adjoints: dict[int, Value] = {} if root.node is None else {root.node: Value(root.coefficient, None)}
    for node in reversed(graph.reachable([root])):
        adjoint = adjoints.get(node, ZERO)
        if adjoint.coefficient:
            for child, partial in _partials(graph, node):
                share = graph.multiply(adjoint, partial)
                adjoints[child] = graph.add(adjoints[child], share) if child in adjoints else share
    return tuple(adjoints.get(v.node, ZERO) for v in variables if v.node is not None)


def hessian_vector(
    graph: Graph, root: Value, variables: Sequence[Value], directions: Sequence[Value]
) -> tuple[Value, ...]:
    """Return the Hessian of ``root`` times ``directions``: the gradient of the directional derivative."""
    slope = ZERO
    for derivative, direction in zip(gradient(graph, root, variables), directions, strict=True):
        slope = graph.add(slope, graph.multiply(derivative, direction))
    return gradient(graph, slope, variables)


def _partials(graph: Graph, node: int) -> list[tuple[int, Value]]:
    """The derivatives of a node with respect to its children."""
    found = graph.nodes[node]
    if isinstance(found, Sum):
        return [(child, Value(c, None)) for child, c in found.terms]
    if isinstance(found, Product):
        return [(child, _lowered(graph, dict(found.factors), child, e)) for child, e in found.factors]
    if isinstance(found, Application):
        operands = [_operand(graph, child) for child in found.operands]
        partials = DERIVATIVES[found.function](graph, Value(1, node), *operands)
        # A function of the same node twice, such as hypot(x, x), has two partial derivatives for it.
        return list(zip(found.operands, partials, strict=True))
    return []


def _lowered(graph: Graph, factors: dict[int, Exact], child: int, e: Exact) -> Value:
    factors[child] = exact(e - 1)
    return graph.times(e, graph.product_of(factors))


def _operand(graph: Graph, node: int) -> Value:
    found = graph.nodes[node]
    return Value(found.value, None) if isinstance(found, Literal) else graph.times(1, Value(1, node))


def _pow(graph: Graph, value: Value, x: Value, y: Value) -> tuple[Value, ...]:
    """y x^(y-1), which is finite at 0 where y >= 1, and x^y log x."""
    slope = graph.multiply(y, graph.apply("pow", x, graph.add(y, Value(-1, None))))
    # The derivative for a constant x is not needed, and the logarithm of a negative x does not exist.
    return slope, (ZERO if y.node is None else graph.multiply(value, graph.apply("log", x)))


def _atan2(graph: Graph, _: Value, y: Value, x: Value) -> tuple[Value, ...]:
    square = graph.power(graph.add(graph.multiply(x, x), graph.multiply(y, y)), -1)
    return graph.multiply(x, square), graph.times(-1, graph.multiply(y, square))


def _hypot(graph: Graph, value: Value, x: Value, y: Value) -> tuple[Value, ...]:
    inverse = graph.power(value, -1)
    return graph.multiply(x, inverse), graph.multiply(y, inverse)


def _erf(graph: Graph, _: Value, x: Value) -> tuple[Value, ...]:
    """2 exp(-x^2) / sqrt(pi)."""
    return (graph.times(_two_over_root_pi(), graph.apply("exp", graph.times(-1, graph.multiply(x, x)))),)


#: The derivatives of f(x, ...) with respect to its operands, as functions of the graph, of its value and of the
#: operands.
DERIVATIVES: dict[str, Callable[..., tuple[Value, ...]]] = {
    "sin": lambda graph, f, x: (graph.apply("cos", x),),
    "cos": lambda graph, f, x: (graph.times(-1, graph.apply("sin", x)),),
    "tan": lambda graph, f, x: (graph.add(ONE, graph.power(f, 2)),),
    "exp": lambda graph, f, x: (f,),
    "log": lambda graph, f, x: (graph.power(x, -1),),
    "cbrt": lambda graph, f, x: (graph.times(Fraction(1, 3), graph.power(f, -2)),),
    "tanh": lambda graph, f, x: (graph.add(ONE, graph.times(-1, graph.power(f, 2))),),
    "sinh": lambda graph, f, x: (graph.apply("cosh", x),),
    "cosh": lambda graph, f, x: (graph.apply("sinh", x),),
    "abs": lambda graph, f, x: (graph.apply("sign", x),),
    "sign": lambda graph, f, x: (ZERO,),
    "pow": _pow, "atan2": _atan2, "erf": _erf, "hypot": _hypot,
}  # fmt: skip


@cache
def _two_over_root_pi() -> Fraction:
    """2 / sqrt(pi), rounded to :data:`~nearharmonic.core.formulas.number.ROOT_BITS` bits."""
    from mpmath import mp, mpf, pi, workprec

    with workprec(ROOT_BITS + 16):
        value = mpf(2) / mp.sqrt(pi)
        return Fraction(int(mp.floor(value * mpf(2) ** ROOT_BITS)), 1 << ROOT_BITS)
