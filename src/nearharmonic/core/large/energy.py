"""An energy and its gradient as loops: their computations, the places of results, and sums of results.

A loop over the terms of a sum stores the derivatives of each term with respect to its operands. Each component of the
gradient is then the sum of its derivatives, in the order of the loops. No repetition changes a result of another, so a
block of repetitions can be computed in SIMD lanes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from nearharmonic.core.formulas.expression.derivative import gradient
from nearharmonic.core.formulas.expression.graph import Graph
from nearharmonic.core.formulas.expression.nodes import Value
from nearharmonic.core.formulas.expression.polynomial import shortest_program
from nearharmonic.core.formulas.expression.program import Program
from nearharmonic.core.formulas.expression.size import operations_of
from nearharmonic.core.large.patterns import Level, Loop, levels
from nearharmonic.core.large.tables import BLOCK, Places, runs
from nearharmonic.core.large.terms import COORDINATES


@dataclass(frozen=True, eq=False)
class Work:
    """A loop with its programs: ``value``, and ``both``, which returns the stored derivatives and then the value.

    Attributes
    ----------
    kept : tuple of (int, Places)
        For each derivative in ``both``, the array of its gradient, and its places in that array.
    scaled : int or None
        Level whose adjoints multiply the derivatives, as the last variable of ``both``. None in the last level.
    """

    loop: Loop
    value: Program
    both: Program
    kept: tuple[tuple[int, Places], ...]
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
