"""The terms of long sums, sorted by how they are computed: terms that differ in places and constants are one pattern.

A chain of a thousand sites has a thousand terms of one pattern, each of two neighbouring coordinates, and a hundred
bodies have 4950 pairs of one pattern, each of six coordinates and a product of masses. A :class:`Loop` is a pattern
with the tables of what its repetitions use; sums that terms of other sums depend on come first, in levels of their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nearharmonic.core.expression.graph import (
    ZERO,
    Application,
    Exact,
    Graph,
    Literal,
    Product,
    Sum,
    Value,
    Variable,
    children,
    exact,
    modulus,
)
from nearharmonic.core.loops.tables import Places, runs

#: Terms from which on a sum is computed in loops, and not as a part of what it occurs in.
LONG_SUM = 16
#: The array of the coordinates; those of the sums have the numbers of their levels, from 1 on.
COORDINATES = 0


@dataclass(frozen=True, eq=False)
class Operand:
    """What a variable of a pattern is in each repetition: the ``places`` (count,) of an array."""

    array: int
    places: Places


@dataclass(frozen=True, eq=False)
class Loop:
    """A pattern with its repetitions.

    Attributes
    ----------
    graph, value
        The pattern. Its variables are, in this order, the operands, the data and the parameters.
    operands : tuple of Operand
        Coordinates and sums.
    data : tuple of tuples of exact numbers
        Positive constants that differ between repetitions, each (count,).
    parameters : int
        Number of parameters.
    sums : array of int, (count,)
        Places of the sums that the repetitions are terms of, among those of one level.
    """

    graph: Graph
    value: Value
    operands: tuple[Operand, ...]
    data: tuple[tuple[Exact, ...], ...]
    parameters: int
    sums: Places

    @property
    def count(self) -> int:
        """Number of repetitions."""
        return len(self.sums)


@dataclass(frozen=True, eq=False)
class Level:
    """Sums that depend on coordinates and on sums of lower levels alone: their number, and the loops that make them."""

    size: int
    loops: tuple[Loop, ...]


@dataclass(frozen=True)
class _Term:
    """A term of a sum as the sum of values with the same leaves, written down so that equal patterns are equal."""

    key: tuple[object, ...]
    parts: tuple[Value, ...]
    nodes: tuple[int, ...]
    leaves: tuple[int, ...]
    data: tuple[Exact, ...]


def levels(graph: Graph, root: Value, dimension: int, parameters: int) -> tuple[Level, ...]:
    """Return the loops that compute ``root``, which is the one sum of the last level.

    Parameters
    ----------
    graph : Graph
        Its variables are the coordinates and the parameters, in this order.
    root : Value
        The energy.
    dimension, parameters : int
        Numbers of coordinates and parameters.
    """
    return _Reader(graph, root, dimension, parameters).levels()


class _Reader:
    """Finds the long sums below a value, and the patterns of their terms."""

    def __init__(self, graph: Graph, root: Value, dimension: int, parameters: int) -> None:
        self.graph, self.root, self.dimension, self.parameters = graph, root, dimension, parameters
        self.reachable = graph.reachable([root])
        self.uses = Counter(child for i in self.reachable for child in children(graph.nodes[i]))
        self.level: dict[int, int] = {}
        #: The long sums, with their levels and their places among the sums of a level.
        self.place: dict[int, tuple[int, int]] = {}
        self.terms: dict[int, tuple[Exact, dict[int, Exact]]] = {}
        self._find_sums()

    def _find_sums(self) -> None:
        sizes: Counter[int] = Counter()
        parts = {
            child
            for i in self.reachable
            if isinstance(self.graph.nodes[i], Sum)
            for child in children(self.graph.nodes[i])
            if isinstance(self.graph.nodes[child], Sum) and self.uses[child] == 1
        }
        for i in self.reachable:
            node = self.graph.nodes[i]
            level = max((self.level[child] for child in children(node)), default=0)
            if isinstance(node, Sum) and i not in parts and i != self.root.node:
                self.terms[i] = constant, terms = self._flat(Value(1, i))
                if len(terms) + bool(constant) >= LONG_SUM:
                    level += 1
                    self.place[i] = level, sizes[level]
                    sizes[level] += 1
            self.level[i] = level
        self.sizes = sizes

    def _flat(self, value: Value) -> tuple[Exact, dict[int, Exact]]:
        """The constant and the terms of a sum, with those of the sums that are a part of no other."""
        constant: Exact = 0
        terms: dict[int, Exact] = {}
        pending = [value]
        while pending:
            c, i = pending.pop()
            node = None if i is None else self.graph.nodes[i]
            if i is None:
                constant = exact(constant + c)
            elif isinstance(node, Sum) and (i == value.node or self.uses[i] == 1):
                constant = exact(constant + c * node.constant)
                pending.extend(Value(exact(c * factor), child) for child, factor in reversed(node.terms))
            else:
                terms[i] = exact(terms.get(i, 0) + c)
        return constant, {node: c for node, c in terms.items() if c}

    def levels(self) -> tuple[Level, ...]:
        top = 1 + max(self.sizes, default=0)
        found = []
        for level in range(1, top):
            sums = [node for node, (of_level, _) in self.place.items() if of_level == level]
            loops = self._loops([self.terms[node] for node in sums])
            found.append(Level(len(sums), loops))
        return (*found, Level(1, self._loops([self._flat(self.root)])))

    def _loops(self, sums: Sequence[tuple[Exact, dict[int, Exact]]]) -> tuple[Loop, ...]:
        """The loops that compute the terms of some sums."""
        groups: dict[tuple[object, ...], list[tuple[int, _Term]]] = {}
        for place, (constant, terms) in enumerate(sums):
            together: dict[frozenset[int], list[Value]] = {}
            for node, c in terms.items():
                together.setdefault(frozenset(self._leaves(node)), []).append(Value(c, node))
            if constant:
                together.setdefault(frozenset(), []).append(Value(constant, None))
            for parts in together.values():
                term = self._term(parts)
                groups.setdefault(term.key, []).append((place, term))
        return tuple(loop for group in groups.values() for loop in self._split(group))

    def _is_leaf(self, node: int) -> bool:
        return node in self.place or isinstance(self.graph.nodes[node], Variable)

    def _leaves(self, root: int) -> Iterable[int]:
        """The coordinates and long sums that a node is computed from."""
        return (node for node in self._below([root]) if self._is_operand(node))

    def _is_operand(self, node: int) -> bool:
        found = self.graph.nodes[node]
        return node in self.place or (isinstance(found, Variable) and found.place < self.dimension)

    def _below(self, roots: Iterable[int]) -> list[int]:
        """The nodes between ``roots`` and their leaves, in an order that depends on nothing but the pattern."""
        found = dict.fromkeys(roots)
        order = list(found)
        for node in order:
            for child in () if self._is_leaf(node) else self._children(node):
                if child not in found:
                    found[child] = None
                    order.append(child)
        return order

    def _children(self, node: int) -> Sequence[int]:
        """Children in the order of their shapes, coefficients and exponents."""
        found = self.graph.nodes[node]
        if isinstance(found, Sum):
            return [child for child, _ in sorted(found.terms, key=lambda term: (self._shape(term[0]), -term[1]))]
        if isinstance(found, Product):
            return [child for child, _ in sorted(found.factors, key=lambda factor: (self._shape(factor[0]), factor[1]))]
        return tuple(children(found))

    def _shape(self, node: int) -> int:
        """Something that sorts nodes of different kinds, whatever their places."""
        if self._is_leaf(node):
            found = self.graph.nodes[node]
            return -1 if node in self.place else 0 if self._is_operand(node) else 1 + getattr(found, "place", 0)
        found = self.graph.nodes[node]
        kind = (Literal, Sum, Product, Application).index(type(found))
        return 10**9 * (1 + kind) + len(tuple(children(found)))

    def _term(self, parts: Sequence[Value]) -> _Term:
        parts = sorted(parts, key=lambda part: (0 if part.node is None else self._shape(part.node), -part.coefficient))
        nodes = self._below(part.node for part in parts if part.node is not None)
        local = {node: i for i, node in enumerate(nodes)}
        data: list[Exact] = []

        def constant(value: Exact) -> object:
            if modulus(value) > 0 and modulus(value) != 1:
                data.append(modulus(value))
                return "+c" if value > 0 else "-c"
            return int(value)

        key: list[object] = [(constant(c), None if node is None else local[node]) for c, node in parts]
        leaves = []
        for node in nodes:
            found = self.graph.nodes[node]
            if self._is_operand(node):
                key.append(("operand", self.place.get(node, (COORDINATES, 0))[0]))
                leaves.append(node)
            elif isinstance(found, Variable):
                key.append(("parameter", found.place))
            else:
                key.append(self._described(node, found, local, constant))
        return _Term(tuple(key), tuple(parts), tuple(nodes), tuple(leaves), tuple(data))

    def _described(
        self, node: int, found: object, local: dict[int, int], constant: Callable[[Exact], object]
    ) -> tuple[object, ...]:
        if isinstance(found, Sum):
            factors = dict(found.terms)
            ordered = ((constant(factors[child]), local[child]) for child in self._children(node))
            return "sum", constant(found.constant), *ordered
        if isinstance(found, Product):
            exponents = dict(found.factors)
            return "product", *((exponents[child], local[child]) for child in self._children(node))
        if isinstance(found, Application):
            return found.function, *(local[child] for child in found.operands)
        assert isinstance(found, Literal)
        return "literal", constant(found.value)

    def _split(self, group: Sequence[tuple[int, _Term]]) -> Iterator[Loop]:
        """The loops of a pattern: one for each run of neighbouring places, and one for the others."""
        terms = [term for _, term in group]
        sums = np.array([place for place, _ in group], np.int64)
        places = np.array([[self._place(node) for node in term.leaves] for term in terms], np.int64)
        places = places.reshape(len(terms), -1)
        columns = list(zip(*(term.data for term in terms), strict=True))
        differing = [column for column in columns if len(set(column)) > 1]
        pattern = _Pattern(self, terms[0], columns)
        arrays = [self.place.get(node, (COORDINATES, 0))[0] for node in terms[0].leaves]
        for rows in runs([*places.T, sums], len(terms)):
            chosen = np.arange(len(terms))[rows]
            operands = tuple(Operand(array, column[rows]) for array, column in zip(arrays, places.T, strict=True))
            data = tuple(tuple(column[i] for i in chosen) for column in differing)
            yield Loop(pattern.graph, pattern.value, operands, data, self.parameters, sums[rows])

    def _place(self, node: int) -> int:
        if node in self.place:
            return self.place[node][1]
        found = self.graph.nodes[node]
        assert isinstance(found, Variable)
        return found.place


class _Pattern:
    """Writes the first term of a group into a graph of its own, with variables for what differs between the terms."""

    def __init__(self, reader: _Reader, term: _Term, columns: Sequence[Sequence[Exact]]) -> None:
        self.graph = graph = Graph()
        differing = [len(set(column)) > 1 for column in columns]
        variables = [x.value for x in graph.variables(len(term.leaves) + sum(differing) + reader.parameters)]
        behind = iter(variables[len(term.leaves) :])
        #: The constants of the term in the order of its data: exact, or a variable.
        self._constants = [
            next(behind) if differs else Value(c, None) for c, differs in zip(term.data, differing, strict=True)
        ]
        parameters = variables[len(variables) - reader.parameters :]
        self._values = dict(zip(term.leaves, variables, strict=False))
        for node in term.nodes:
            found = reader.graph.nodes[node]
            if isinstance(found, Variable) and node not in self._values:
                self._values[node] = parameters[found.place - reader.dimension]
        # The order of the data is that of the key; nodes are written once all that they need is there.
        data = iter(range(len(term.data)))
        places = [self._taken(part.coefficient, data) for part in term.parts]
        needed = {
            node: self._needed(reader, node, data) for node in term.nodes if node not in self._values
        }
        for node in sorted(needed):
            self._values[node] = self._written(reader.graph.nodes[node], needed[node])
        self.value = ZERO
        for (c, node), at in zip(term.parts, places, strict=True):
            factor = self._constant(c, at)
            part = factor if node is None else graph.multiply(factor, self._values[node])
            self.value = self._total([self.value, part])

    def _taken(self, c: Exact, data: Iterable[int]) -> int | None:
        return next(iter(data)) if modulus(c) not in (0, 1) else None

    def _needed(self, reader: _Reader, node: int, data: Iterable[int]) -> list[tuple[int | None, Exact, int | None]]:
        """The constants and the children of a node, with the places of the constants in the data."""
        found = reader.graph.nodes[node]
        if isinstance(found, Sum):
            factors = dict(found.terms)
            entries: list[tuple[int | None, Exact, int | None]] = [
                (self._taken(found.constant, data), found.constant, None)
            ]
            for child in reader._children(node):
                entries.append((self._taken(factors[child], data), factors[child], child))
            return entries
        if isinstance(found, Literal):
            return [(self._taken(found.value, data), found.value, None)]
        return []

    def _constant(self, c: Exact, at: int | None) -> Value:
        if at is None:
            return Value(c, None)
        return self.graph.times(1 if c > 0 else -1, self._constants[at])

    def _written(self, found: object, entries: Sequence[tuple[int | None, Exact, int | None]]) -> Value:
        if isinstance(found, Sum):
            parts = [self._constant(c, at) for at, c, child in entries if child is None and c]
            parts += [
                self.graph.multiply(self._constant(c, at), self._values[child])
                for at, c, child in entries
                if child is not None
            ]
            return self._total(parts)
        if isinstance(found, Product):
            value = Value(1, None)
            for child, e in found.factors:
                value = self.graph.multiply(value, self.graph.power(self._values[child], e))
            return value
        if isinstance(found, Application):
            return self.graph.apply(found.function, *(self._values[child] for child in found.operands))
        ((at, c, _),) = entries
        return self._constant(c, at)

    def _total(self, parts: Sequence[Value]) -> Value:
        """The sum of values as one node."""
        constant: Exact = 0
        terms: dict[int, Exact] = {}
        for c, node in parts:
            if node is None:
                constant = exact(constant + c)
            else:
                terms[node] = exact(terms.get(node, 0) + c)
        return self.graph.combination(constant, terms)
