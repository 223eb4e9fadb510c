"""Size of expressions in operations: the limit above which they become loops, and the largest size."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.expression.nodes import Application, Node, Product, Sum, Value
from nearharmonic.core.formulas.number import FUNCTIONS, FormulaError

#: Coordinates and operations up to which a kernel has no loops over coordinates. It takes 5 to 20 ms per operation to
#: compile; larger formulas become loops.
MOST_UNROLLED, MOST_OPERATIONS_UNROLLED = 50, 1000
#: Largest number of operations of a kernel of loops, each pattern counted once.
MOST_OPERATIONS = 4000
#: Number of operations that take as long to compile as one function.
OPERATIONS_OF_A_FUNCTION = 10


def operations(graph: Graph, roots: Sequence[Value]) -> int:
    """Return the number of operations that the values take."""
    return sum(_operations(graph.nodes[node]) for node in graph.reachable(roots))


def operations_of(name: str) -> int:
    """Return the weight of an operation of this name, in operations."""
    return OPERATIONS_OF_A_FUNCTION if name in FUNCTIONS else 1


def becomes_loops(dimension: int, operations: int) -> bool:
    """Return True if a formula of so many coordinates and operations is compiled as loops."""
    return dimension > MOST_UNROLLED or operations > MOST_OPERATIONS_UNROLLED


def check_size(operations: int) -> None:
    """Refuse formulas that take too long to compile.

    Raises
    ------
    FormulaError
        The formulas take more than :data:`MOST_OPERATIONS`.
    """
    if operations > MOST_OPERATIONS:
        raise FormulaError(
            f"takes {operations} operations, a function counted as {OPERATIONS_OF_A_FUNCTION} and terms of one form "
            f"once: at most {MOST_OPERATIONS} are compiled, which takes about a minute"
        )


def _operations(node: Node) -> int:
    if isinstance(node, Sum):
        return len(node.terms)
    if isinstance(node, Product):
        return len(node.factors)
    return operations_of(node.function) if isinstance(node, Application) else 1
