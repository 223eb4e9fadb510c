"""Loops over the terms of one pattern, such as the thousand terms of two neighbours in a chain of a thousand sites.

A hundred bodies have 4950 pairs of one pattern, each of six coordinates and a product of masses. A :class:`Loop` is a
pattern with the tables of its operands and data. Sums on which the terms of other sums depend come first, in levels of
their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.expression.nodes import Application, Exact, Literal, Product, Value, Variable
from nearharmonic.core.formulas.expression.size import check_size
from nearharmonic.core.large.tables import Places, runs
from nearharmonic.core.large.terms import Entry, LongSums, Term


@dataclass(frozen=True, eq=False)
class Operand:
    """Values of a variable of a pattern, one for each repetition, at ``places`` (count,) of an array."""

    array: int
    places: Places


@dataclass(frozen=True, eq=False)
class Loop:
    """A pattern with its repetitions.

    Attributes
    ----------
    graph, value
        The pattern. Its variables are the operands, the data and the parameters, in this order.
    operands : tuple of Operand
        Coordinates and sums.
    data : tuple of tuples of exact numbers
        Positive constants that differ between repetitions, each (count,).
    parameters : int
        Number of parameters.
    sums : array of int, (count,)
        Indices, in their level, of the sums to which the repetitions belong.
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
    """Sums that depend only on coordinates and on sums of lower levels: their number and their loops."""

    size: int
    loops: tuple[Loop, ...]


def levels(graph: Graph, root: Value, dimension: int, parameters: int) -> tuple[Level, ...]:
    """Return the loops that compute the energy ``root``, the only sum of the last level.

    The variables of the graph are the coordinates and the parameters, in this order.

    Raises
    ------
    FormulaError
        The terms have so many patterns that they take too long to compile.
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
    for node in sorted(_nodes(sums.graph, term)):
        found = sums.graph.nodes[node]
        if isinstance(found, Variable):
            values[node] = given[found.place - sums.dimension]
        else:
            values[node] = made(found, term.nodes[node])
    return graph, made(None, term.nodes[None])


def _nodes(graph: Graph, term: Term) -> set[int]:
    """The nodes of a term, parameters included and operands excluded."""
    found = {child for entries in term.nodes.values() for _, _, child in entries if child is not None}
    return found - set(term.operands)
