"""The longest chain of operations in a formula: its latency bounds the time of one trajectory on every processor."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from nearharmonic.core.formulas.number import Constant, Number
from nearharmonic.core.formulas.program import FUNCTION, LATENCY

#: The last operation of a chain, the cycle in which it ends, and the chain before it.
Link = tuple[str, int, "Link | None"]


@dataclass(frozen=True)
class Chain:
    """The longest chain from the arguments of a formula to its results.

    Attributes
    ----------
    operations : tuple of (str, int)
        Names of its operations, in order, with the cycles that each takes on a current processor. "fused" is a product
        that is added to a number, "root" a square root.
    """

    operations: tuple[tuple[str, int], ...]

    @property
    def cycles(self) -> int:
        """Cycles of the whole chain."""
        return sum(cycles for _, cycles in self.operations)

    @property
    def dominant(self) -> str:
        """The operation that takes most of these cycles, "" for an empty chain."""
        spent: Counter[str] = Counter()
        for name, cycles in self.operations:
            spent[name] += cycles
        return max(spent, key=spent.__getitem__, default="")

    def __str__(self) -> str:
        names = " > ".join(f"{name} {cycles}" for name, cycles in self.operations)
        return f"{self.cycles} cycles, most in {self.dominant}: {names}" if names else "0 cycles"


class Chained(Number):
    """A number with the chain of operations that computes it; products are fused as in kernels."""

    __slots__ = ("_factors", "_link")

    def __init__(self, link: Link | None = None, factors: tuple[Chained, Chained] | None = None) -> None:
        self._link, self._factors = link, factors

    @property
    def link(self) -> Link | None:
        """The last operation; a pending product is multiplied out."""
        if self._factors is not None and self._link is None:
            self._link = _later("multiply", *self._factors)
        return self._link

    @property
    def ready(self) -> int:
        """Cycles until the number is known."""
        return self.link[1] if self.link else 0

    def _add(self, other: Chained | Constant) -> Chained:
        if isinstance(other, Constant) and other == 0:
            return self
        addend = self._lift(other)
        for product, rest in ((self, addend), (addend, self)):
            if product._factors is not None:
                return Chained(_later("fused", *product._factors, rest))
        return Chained(_later("add", self, addend))

    def _multiply(self, other: Chained | Constant) -> Chained:
        if isinstance(other, Constant) and other == 1:
            return self
        return Chained(None, (self, self._lift(other)))

    def __neg__(self) -> Chained:
        if self._factors is not None:
            return Chained(None, (-self._factors[0], self._factors[1]))
        return Chained(self._link)  # additions and fused products take an operand of either sign at no cost

    def _divide(self, other: Chained | Constant) -> Chained:
        if isinstance(other, Constant) and other.denominator == 1 and other.numerator.bit_count() == 1:
            return self._multiply(1 / other)
        return Chained(_later("divide", self, self._lift(other)))

    def __abs__(self) -> Chained:
        return Chained(_later("abs", self))

    def sign(self) -> Chained:
        return Chained(_later("sign", self))

    def sqrt(self) -> Chained:
        return Chained(_later("root", self))

    def lifted(self, number: Constant) -> Chained:
        return Chained()

    def apply(self, function: str, *others: Chained | Constant) -> Chained:
        return Chained(_later(function, self, *map(self._lift, others)))


def _later(name: str, *operands: Chained) -> Link:
    last = max(operands, key=lambda one: one.ready)
    return name, last.ready + LATENCY.get(name, FUNCTION), last.link


def longest_chain(results: Iterable[Any]) -> Chain:
    """Return the longest chain that ends in one of ``results``; constants have no chain."""
    ends = [one.link for one in results if isinstance(one, Chained) and one.link]
    link = max(ends, key=lambda one: one[1], default=None)
    operations: list[tuple[str, int]] = []
    while link is not None:
        name, done, link = link
        operations.append((name, done - (link[1] if link else 0)))
    return Chain(tuple(reversed(operations)))
