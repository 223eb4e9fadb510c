"""The long sums of an expression and their terms; terms of one pattern have the same key.

A few terms of a sum that use the same coordinates form one term: d^2/2 + d^4/40 of one distance is one term.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.expression.nodes import (
    Application,
    Exact,
    Literal,
    Product,
    Sum,
    Value,
    Variable,
    children,
    exact,
    modulus,
)

#: Number of terms from which on a sum is computed in loops, and not as a part of another term.
LONG_SUM = 16
#: Largest number of terms of the same coordinates that form one term; more terms, as in a Fourier series, have loops.
MOST_TOGETHER = 8
#: Number of the array of the coordinates; an array of sums has the number of its level, from 1 on.
COORDINATES = 0


class Entry(NamedTuple):
    """A constant, its index among the data of a term if it may differ between terms, and the node beside it."""

    constant: Exact
    place: int | None
    child: int | None


@dataclass(frozen=True)
class Term:
    """A term of a long sum.

    Attributes
    ----------
    key : tuple
        Equal for terms that differ only in the places of their operands and in their data.
    nodes : dict
        Children of the nodes of the term, by the index of the node in the graph; ``None`` is the term itself.
    operands : tuple of int
        Nodes of the coordinates and long sums that the term uses.
    data : tuple of exact numbers
        Moduli of the constants of the term other than 0, 1 and -1.
    """

    key: tuple[object, ...]
    nodes: dict[int | None, tuple[Entry, ...]]
    operands: tuple[int, ...]
    data: tuple[Exact, ...]


class LongSums:
    """The long sums below a value of a graph, whose variables are ``dimension`` coordinates and then the parameters.

    The value ``root`` counts as a sum, if necessary of one term.
    """

    def __init__(self, graph: Graph, root: Value, dimension: int) -> None:
        self.graph, self.root, self.dimension = graph, root, dimension
        reachable = graph.reachable([root])
        self._uses = Counter(child for i in reachable for child in children(graph.nodes[i]))
        #: Level of each long sum except the root, and its index among the sums of that level.
        self.place: dict[int, tuple[int, int]] = {}
        self._terms: dict[int, tuple[Exact, dict[int, Exact]]] = {}
        self._orders: dict[int, list[int]] = {}
        self._find(reachable)
        #: Number of levels below that of the root.
        self.levels = max((level for level, _ in self.place.values()), default=0)

    def _find(self, reachable: Sequence[int]) -> None:
        nodes = self.graph.nodes
        parts = {
            child
            for i in reachable
            if isinstance(nodes[i], Sum)
            for child in children(nodes[i])
            if isinstance(nodes[child], Sum) and self._uses[child] == 1
        }
        of_node: dict[int, int] = {}
        sizes: Counter[int] = Counter()
        for i in reachable:
            level = max((of_node[child] for child in children(nodes[i])), default=0)
            if isinstance(nodes[i], Sum) and i not in parts and i != self.root.node:
                constant, terms = self._flat(Value(1, i))
                if len(terms) >= LONG_SUM:
                    level += 1
                    self._terms[i], self.place[i] = (constant, terms), (level, sizes[level])
                    sizes[level] += 1
            of_node[i] = level

    def _flat(self, value: Value) -> tuple[Exact, dict[int, Exact]]:
        """The constant and the terms of a sum; sums that occur only in it are split into their terms."""
        constant: Exact = 0
        terms: dict[int, Exact] = {}
        pending = [value]
        while pending:
            c, i = pending.pop()
            node = None if i is None else self.graph.nodes[i]
            if i is None:
                constant = exact(constant + c)
            elif isinstance(node, Sum) and (i == value.node or self._uses[i] == 1):
                constant = exact(constant + c * node.constant)
                pending.extend(Value(exact(c * factor), child) for child, factor in reversed(node.terms))
            else:
                terms[i] = exact(terms.get(i, 0) + c)
        return constant, {node: c for node, c in terms.items() if c}

    def terms(self, level: int) -> list[list[Term]]:
        """Return the terms of each sum of a level, from 1 on; the only sum of the last level is the root."""
        if level > self.levels:
            return [self._together(*self._flat(self.root))]
        return [self._together(*self._terms[node]) for node, (of, _) in self.place.items() if of == level]

    def _together(self, constant: Exact, terms: dict[int, Exact]) -> list[Term]:
        groups: dict[frozenset[int], list[Value]] = {}
        for node, c in terms.items():
            used = frozenset(i for i in self._below([node]) if self._is_operand(i))
            groups.setdefault(used, []).append(Value(c, node))
        if constant:
            groups.setdefault(frozenset(), []).append(Value(constant, None))
        found: list[Term] = []
        for values in groups.values():
            together = [values] if len(values) <= MOST_TOGETHER else [[value] for value in values]
            found += [self._term(values) for values in together]
        return found

    def operand(self, node: int) -> tuple[int, int]:
        """Return the array and the place of a coordinate or a long sum."""
        if node in self.place:
            return self.place[node]
        found = self.graph.nodes[node]
        assert isinstance(found, Variable)
        return COORDINATES, found.place

    def _is_operand(self, node: int) -> bool:
        found = self.graph.nodes[node]
        return node in self.place or (isinstance(found, Variable) and found.place < self.dimension)

    def _below(self, roots: Iterable[int]) -> list[int]:
        """The nodes down to operands and parameters, in an order that depends only on the pattern."""
        found = dict.fromkeys(roots)
        order = list(found)
        for node in order:
            for child in () if node in self.place else self._children(node):
                if child not in found:
                    found[child] = None
                    order.append(child)
        return order

    def _children(self, node: int) -> Sequence[int]:
        """Children of a node; in sums and products they are in the order of their shapes and constants."""
        order = self._orders.get(node)
        if order is None:
            found = self.graph.nodes[node]
            order = list(children(found))
            if isinstance(found, Sum):
                factors = dict(found.terms)
                order.sort(key=lambda child: (self._shape(child), -factors[child]))
            elif isinstance(found, Product):
                exponents = dict(found.factors)
                order.sort(key=lambda child: (self._shape(child), exponents[child]))
            self._orders[node] = order
        return order

    def _shape(self, node: int) -> tuple[int, int]:
        """Return a sort key that distinguishes kinds of nodes, but not places within one kind."""
        found = self.graph.nodes[node]
        if node in self.place:
            return 0, self.place[node][0]
        if isinstance(found, Variable):
            return (0, 0) if found.place < self.dimension else (1, found.place)
        return 2 + (Literal, Sum, Product, Application).index(type(found)), len(tuple(children(found)))

    def _term(self, values: Sequence[Value]) -> Term:
        values = sorted(values, key=lambda x: ((-1, 0) if x.node is None else self._shape(x.node), -x.coefficient))
        order = self._below(value.node for value in values if value.node is not None)
        number = {node: i for i, node in enumerate(order)}
        data: list[Exact] = []
        nodes: dict[int | None, tuple[Entry, ...]] = {None: _entries(values, data)}
        key: list[object] = [_described(nodes[None], number)]
        for node in order:
            found = self.graph.nodes[node]
            if self._is_operand(node):
                key.append(self.operand(node)[0])
            elif isinstance(found, Variable):
                key.append(found)
            else:
                nodes[node] = self._made_of(node, data)
                name = found.function if isinstance(found, Application) else type(found).__name__
                key.append((name, _described(nodes[node], number)))
        return Term(tuple(key), nodes, tuple(filter(self._is_operand, order)), tuple(data))

    def _made_of(self, node: int, data: list[Exact]) -> tuple[Entry, ...]:
        found = self.graph.nodes[node]
        if isinstance(found, Literal):
            return _entries([Value(found.value, None)], data)
        if isinstance(found, Sum):
            factors = dict(found.terms)
            values = [Value(factors[child], child) for child in self._children(node)]
            return _entries([Value(found.constant, None), *values], data)
        exponents = dict(found.factors) if isinstance(found, Product) else {}
        return tuple(Entry(exponents.get(child, 1), None, child) for child in self._children(node))


def _entries(values: Iterable[Value], data: list[Exact]) -> tuple[Entry, ...]:
    """Values as entries; constants other than 0, 1 and -1 become data."""
    entries = []
    for c, node in values:
        place = None
        if modulus(c) not in (0, 1):
            place = len(data)
            data.append(modulus(c))
        entries.append(Entry(c, place, node))
    return tuple(entries)


def _described(entries: Iterable[Entry], number: dict[int, int]) -> tuple[object, ...]:
    """Entries without their data; nodes are replaced by their numbers in the term."""
    return tuple(
        (c if place is None else "+" if c > 0 else "-", None if child is None else number[child])
        for c, place, child in entries
    )
