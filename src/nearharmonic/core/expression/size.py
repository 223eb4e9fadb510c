"""How many operations an expression takes, and how many are compiled."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.core.expression.graph import Application, Graph, Node, Product, Sum, Value
from nearharmonic.core.number import FUNCTIONS, FormulaError

#: Most operations of a formula that is compiled: its kernel takes about a minute then, 5 to 20 ms an operation.
MOST_OPERATIONS = 4000
#: Operations that a function is counted as: it takes as long to compile.
OPERATIONS_OF_A_FUNCTION = 10


#: Coordinates up to which formulas are written out in a kernel; those of more become loops.
MOST_UNROLLED = 50


def becomes_loops(dimension: int) -> bool:
    """Return whether formulas of so many coordinates are compiled as loops."""
    return dimension > MOST_UNROLLED


def check_loops(operations: int) -> None:
    """Refuse loops that take too long to compile.

    Raises
    ------
    FormulaError
        Their bodies take more than :data:`MOST_OPERATIONS`.
    """
    if operations > MOST_OPERATIONS:
        raise FormulaError(
            f"has terms of so many forms that they take {operations} operations: at most {MOST_OPERATIONS} are "
            "compiled, and terms of one form count once"
        )


def check_size(graph: Graph, roots: Sequence[Value]) -> None:
    """Refuse values that take too long to compile.

    Raises
    ------
    FormulaError
        They take more than :data:`MOST_OPERATIONS`.
    """
    count = sum(_operations(graph.nodes[node]) for node in graph.reachable(roots))
    if count > MOST_OPERATIONS:
        counted = f"{count} operations, a function counted as {OPERATIONS_OF_A_FUNCTION}"
        raise FormulaError(f"takes {counted}: at most {MOST_OPERATIONS} are compiled, which takes about a minute")


def _operations(node: Node) -> int:
    if isinstance(node, Sum):
        return len(node.terms)
    if isinstance(node, Product):
        return len(node.factors)
    return OPERATIONS_OF_A_FUNCTION if isinstance(node, Application) and node.function in FUNCTIONS else 1
