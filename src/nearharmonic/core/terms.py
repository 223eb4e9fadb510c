"""Sums of many terms as loops: terms, tables of places, patterns, and an energy with its gradient."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.expression import (
    Application,
    Exact,
    Graph,
    Literal,
    Product,
    Sum,
    Value,
    Variable,
    check_size,
    children,
    exact,
    gradient,
    modulus,
    operations_of,
)
from nearharmonic.core.layout import BLOCK
from nearharmonic.core.program import Program, shortest_program

# --- The long sums of an expression and their terms; terms of one pattern have the same key.
#
# A few terms of a sum that use the same coordinates form one term: d^2/2 + d^4/40 of one distance is one term.

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
    """A term of a long sum."""

    key: tuple[object, ...]  # equal for terms that differ only in the places of their operands and in their data
    nodes: dict[int | None, tuple[Entry, ...]]  # children by the index of a node; ``None`` is the term itself
    operands: tuple[int, ...]  # nodes of the coordinates and long sums that the term uses
    data: tuple[Exact, ...]  # moduli of the constants of the term other than 0, 1 and -1


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
        #: Number of levels below the root.
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


# --- Tables of places: neighbouring places are loaded as a block, any others are looked up one by one.

Places = NDArray[np.int64]

#: Largest number of runs of neighbouring places with a loop each; if there are more, all places are looked up.
MOST_RUNS = 4


def runs(columns: Sequence[Places], count: int) -> Iterator[slice | Places]:
    """Yield the parts of ``count`` rows: runs in which each column is constant or ascends by 1, and the other rows.

    There are at most :data:`MOST_RUNS` runs, each of at least :data:`BLOCK` rows.
    """
    steps = np.stack([np.diff(column) for column in columns], axis=1) if columns else np.zeros((count - 1, 0))
    regular = np.all(np.isin(steps, (0, 1)), axis=1)
    alike = np.all(steps[1:] == steps[:-1], axis=1)
    found: list[slice] = []
    start = 0
    while start < len(regular):
        end = start
        if regular[start]:
            while end < len(alike) and alike[end]:
                end += 1
            if end + 2 - start >= BLOCK:
                found.append(slice(start, end + 2))
                start = end + 1
        start = max(start, end) + 1
    if len(found) > MOST_RUNS:
        found = []
    yield from found
    left = np.ones(count, bool)
    for run in found:
        left[run] = False
    if left.any():
        yield np.flatnonzero(left)


# --- Loops over the terms of one pattern, such as the thousand terms of two neighbours in a chain of a thousand sites.
#
# A hundred bodies have 4950 pairs of one pattern, each of six coordinates and a product of masses. A :class:`Loop` is
# a pattern with the tables of its operands and data. Sums on which the terms of other sums depend come first, in
# levels of their own.


@dataclass(frozen=True, eq=False)
class Operand:
    """Values of a variable of a pattern, one for each repetition, at ``places`` (count,) of an array."""

    array: int
    places: Places


@dataclass(frozen=True, eq=False)
class Loop:
    """A pattern with its repetitions; its variables are the operands, the data and the parameters, in this order."""

    graph: Graph
    value: Value
    operands: tuple[Operand, ...]  # coordinates and sums
    data: tuple[tuple[Exact, ...], ...]  # positive constants that differ between repetitions, each (count,)
    parameters: int  # number of parameters
    sums: Places  # (count,) indices, in their level, of the sums to which the repetitions belong

    @property
    def count(self) -> int:
        """Number of repetitions."""
        return len(self.sums)


@dataclass(frozen=True, eq=False)
class Level:
    """Sums that depend only on coordinates and on sums of lower levels: their number and their loops."""

    size: int
    loops: tuple[Loop, ...]


def levels(graph: Graph, root: Value, dimension: int, parameters: int) -> tuple[Level, ...]:
    """Return the loops that compute the energy ``root``, the only sum of the last level.

    The variables of the graph are the coordinates and the parameters, in this order. Patterns that take too long to
    compile raise a FormulaError.
    """
    sums = LongSums(graph, root, dimension)
    return tuple(_level(sums, sums.terms(level), parameters) for level in range(1, sums.levels + 2))


def _level(sums: LongSums, terms: Sequence[Sequence[Term]], parameters: int) -> Level:
    groups: dict[tuple[object, ...], list[tuple[int, Term]]] = {}
    operations = 0
    for place, of_sum in enumerate(terms):
        for term in of_sum:
            if term.key not in groups:
                operations += len(term.nodes)
                check_size(operations)
            groups.setdefault(term.key, []).append((place, term))
    return Level(len(terms), tuple(loop for group in groups.values() for loop in _loops(sums, group, parameters)))


def _loops(sums: LongSums, group: Sequence[tuple[int, Term]], parameters: int) -> Iterator[Loop]:
    """The loops of one pattern: one for each run of neighbouring places, and one for all other places.

    The terms of a sum are in the order of their places, not in the order of the formula.
    """
    group = sorted(group, key=lambda pair: (pair[0], [sums.operand(node)[1] for node in pair[1].operands]))
    terms, targets = [term for _, term in group], np.array([place for place, _ in group], np.int64)
    places = np.array([[sums.operand(node)[1] for node in term.operands] for term in terms], np.int64)
    places = places.reshape(len(terms), -1)
    columns = list(zip(*(term.data for term in terms), strict=True))
    differing = [column for column in columns if len(set(column)) > 1]
    graph, value = _pattern(sums, terms[0], columns, parameters)
    arrays = [sums.operand(node)[0] for node in terms[0].operands]
    for rows in runs([*places.T, targets], len(terms)):
        chosen = np.arange(len(terms))[rows]
        operands = tuple(Operand(array, column[rows]) for array, column in zip(arrays, places.T, strict=True))
        data = tuple(tuple(column[i] for i in chosen) for column in differing)
        yield Loop(graph, value, operands, data, parameters, targets[rows])


def _pattern(sums: LongSums, term: Term, columns: Sequence[Sequence[Exact]], parameters: int) -> tuple[Graph, Value]:
    """A graph with the first term of a group, in which operands and data are variables."""
    graph = Graph()
    differs = [len(set(column)) > 1 for column in columns]
    count = len(term.operands)
    variables = [x.value for x in graph.variables(count + sum(differs) + parameters)]
    behind = iter(variables[count:])
    constants = [next(behind) if one else Value(c, None) for c, one in zip(term.data, differs, strict=True)]
    given = list(behind)
    values = dict(zip(term.operands, variables, strict=False))

    def made(found: object, entries: Sequence[Entry]) -> Value:
        operands = [values[child] for _, _, child in entries if child is not None]
        if isinstance(found, Product):
            value = Value(1, None)
            for (e, _, _), operand in zip(entries, operands, strict=True):
                value = graph.multiply(value, graph.power(operand, e))
            return value
        if isinstance(found, Application):
            return graph.apply(found.function, *operands)
        parts = []
        for c, place, child in entries:
            part = Value(c, None) if place is None else graph.times(1 if c > 0 else -1, constants[place])
            parts.append(part if child is None else graph.multiply(part, values[child]))
        return parts[0] if isinstance(found, Literal) else graph.total(parts)

    # A node has a larger index than its children.
    inner = {child for entries in term.nodes.values() for _, _, child in entries if child is not None}
    for node in sorted(inner - set(term.operands)):
        found = sums.graph.nodes[node]
        if isinstance(found, Variable):
            values[node] = given[found.place - sums.dimension]
        else:
            values[node] = made(found, term.nodes[node])
    return graph, made(None, term.nodes[None])


# --- An energy and its gradient as loops: their computations, the places of results, and sums of results.
#
# A loop over the terms of a sum stores the derivatives of each term with respect to its operands. Each component of
# the gradient is then the sum of its derivatives, in the order of the loops. No repetition changes a result of
# another, so a block of repetitions can be computed in SIMD lanes.


@dataclass(frozen=True, eq=False)
class Work:
    """A loop with its programs: ``value``, and ``both``, which returns the stored derivatives and then the value."""

    loop: Loop
    value: Program
    both: Program
    kept: tuple[tuple[int, Places], ...]  # of each derivative in ``both``: the array of its gradient, and its places
    #: Level whose adjoints multiply the derivatives, as the last variable of ``both``. None in the last level.
    scaled: int | None


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums of stored numbers: ``targets`` (n,) in an array, and the ``sources`` (n, terms) of their terms."""

    targets: Places
    sources: Places


class LoopedEnergy:
    """V or T of a system of many coordinates, an expression of the coordinates and the parameters, in this order."""

    def __init__(self, graph: Graph, root: Value, dimension: int, parameters: int) -> None:
        self.dimension, self.parameters = dimension, parameters
        self.levels: tuple[Level, ...] = levels(graph, root, dimension, parameters)

    @cached_property
    def work(self) -> tuple[tuple[Work, ...], ...]:
        """Computations of the loops of each level."""
        last = len(self.levels)
        return tuple(
            tuple(_work(loop, None if number == last else number) for loop in level.loops)
            for number, level in enumerate(self.levels, start=1)
        )

    @property
    def operations(self) -> int:
        """Operations of all patterns with their derivatives, each pattern once: the size of the code."""
        return sum(operations_of(name) for level in self.work for work in level for name, *_ in work.both.operations)

    @property
    def work_of_loops(self) -> int:
        """Operations of all repetitions of all loops, with their derivatives."""
        return sum(work.both.work * work.loop.count for level in self.work for work in level)

    @cached_property
    def digest(self) -> str:
        """Digest of the operations of all loops and of their tables."""
        text = sha256(f"{self.dimension} {self.parameters}".encode())
        for level in self.work:
            for work in level:
                programs = [(one.operations, one.results) for one in (work.value, work.both)]
                arrays = [operand.array for operand in work.loop.operands]
                text.update(repr((programs, arrays, work.loop.data, work.scaled)).encode())
                for places in (work.loop.sums, *(operand.places for operand in work.loop.operands)):
                    text.update(places.tobytes())
        return text.hexdigest()

    @cached_property
    def offsets(self) -> dict[tuple[str, int, int], int]:
        """Offsets of the stored numbers.

        Keys are ("gradient", array, 0), ("value", level, 0) for sums, and for loops ("term", level, loop) and
        ("derivative 0", level, loop), ...; ("end", 0, 0) is the total number.
        """
        found: dict[tuple[str, int, int], int] = {}
        at = 0

        def keep(key: tuple[str, int, int], count: int) -> None:
            nonlocal at
            found[key] = at
            at += -(-count // BLOCK) * BLOCK  # blocks across cache lines take twice as long to store

        keep(("gradient", COORDINATES, 0), self.dimension)
        for number, (level, work) in enumerate(zip(self.levels, self.work, strict=True), start=1):
            if number < len(self.levels):
                keep(("value", number, 0), level.size)
                keep(("gradient", number, 0), level.size)
            for i, one in enumerate(work):
                if number < len(self.levels):
                    keep(("term", number, i), one.loop.count)
                for k in range(len(one.kept)):
                    keep((f"derivative {k}", number, i), one.loop.count)
        found["end", 0, 0] = at
        return found

    @property
    def room(self) -> int:
        """Number of stored numbers."""
        return self.offsets["end", 0, 0]

    def values_of(self, level: int) -> list[Totals]:
        """The sums of a level other than the last, with the places of their terms."""
        terms = [
            (one.loop.sums, self.offsets["term", level, i] + np.arange(one.loop.count))
            for i, one in enumerate(self.work[level - 1])
        ]
        return _totals(terms, self.levels[level - 1].size)

    def gradient_of(self, array: int) -> list[Totals]:
        """The derivatives for an array, with the places of their terms, which loops of higher levels store."""
        terms = [
            (places, self.offsets[f"derivative {k}", number, i] + np.arange(one.loop.count))
            for number, level in enumerate(self.work, start=1)
            if number > array
            for i, one in enumerate(level)
            for k, (of, places) in enumerate(one.kept)
            if of == array
        ]
        return _totals(terms, self.dimension if array == COORDINATES else self.levels[array - 1].size)


def _work(loop: Loop, scaled: int | None) -> Work:
    graph, value = loop.graph, loop.value
    variables = len(loop.operands) + len(loop.data) + loop.parameters
    scaled_value = value
    if scaled is not None:
        scaled_value = graph.multiply(graph.variables(variables + 1)[-1].value, value)
    operands = [x.value for x in graph.variables(len(loop.operands))]
    derivatives = gradient(graph, scaled_value, operands)
    # A term that does not depend on its operand, such as x - x, adds nothing.
    kept = [k for k, derivative in enumerate(derivatives) if derivative.coefficient]
    both = shortest_program(graph, [*(derivatives[k] for k in kept), value], value)
    where = tuple((loop.operands[k].array, loop.operands[k].places) for k in kept)
    return Work(loop, shortest_program(graph, [value], value), both, where, scaled)


def _totals(terms: Sequence[tuple[Places, Places]], size: int) -> list[Totals]:
    """The sums of the ``sources`` in pairs of (targets, sources), for all ``size`` targets."""
    targets = np.concatenate([places for places, _ in terms] or [np.zeros(0, np.int64)])
    sources = np.concatenate([places for _, places in terms] or [np.zeros(0, np.int64)])
    order = np.argsort(targets, kind="stable")
    counts = np.bincount(targets, minlength=size)
    starts = np.concatenate([[0], np.cumsum(counts)])
    found = []
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        table = sources[order[starts[chosen][:, None] + np.arange(count)]]
        found += [Totals(chosen[run], table[run]) for run in runs([chosen, *table.T], len(chosen))]
    return found
