"""Exact linear algebra in the ring of polynomials modulo weighted conditions, one per variable."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product as cartesian

from nearharmonic.exact.multivariate import Monomial, Multivariate

#: Nonzero entries by index.
SparseVector = dict[int, Fraction]


def weight(monomial: Monomial) -> int:
    """Weight of a monomial, if y_i has weight i."""
    return sum((i + 1) * exponent for i, exponent in enumerate(monomial))


def monomials(variables: int, highest: int) -> list[Monomial]:
    """All monomials up to a weight, the highest weight first."""
    ranges = [range(highest // (i + 1) + 1) for i in range(variables)]
    kept = [m for m in cartesian(*ranges) if weight(m) <= highest]
    return sorted(kept, key=lambda m: (-weight(m), m))


class Echelon:
    """Rows in echelon form with their combinations of inserted vectors; it finds linear relations between these."""

    def __init__(self) -> None:
        self._rows: dict[int, tuple[SparseVector, SparseVector]] = {}

    def insert(self, vector: SparseVector, label: int) -> SparseVector | None:
        """Add a vector; if it depends on previous vectors, return the vanishing combination by labels."""
        rest, made_of = self._reduced(vector)
        made_of[label] = Fraction(1)
        if not rest:
            return made_of
        lead = min(rest)
        scale = 1 / rest[lead]
        self._rows[lead] = ({j: c * scale for j, c in rest.items()}, {j: c * scale for j, c in made_of.items()})
        return None

    def express(self, vector: SparseVector) -> SparseVector:
        """``vector`` as a combination of labels."""
        rest, made_of = self._reduced(vector)
        assert not rest
        return {label: -c for label, c in made_of.items()}

    def _reduced(self, vector: SparseVector) -> tuple[SparseVector, SparseVector]:
        rest, made_of, kept = dict(vector), dict[int, Fraction](), dict[int, Fraction]()
        while rest:
            lead = min(rest)
            if lead not in self._rows:
                kept[lead] = rest.pop(lead)
                continue
            c = rest[lead]
            row, parts = self._rows[lead]
            _subtract(rest, row, c)
            _subtract(made_of, parts, c)
        return kept, made_of


class Quotient:
    """The ring of polynomials in y modulo the conditions, as vectors over the irreducible monomials."""

    def __init__(self, conditions: Sequence[Multivariate], weights: Sequence[int]) -> None:
        k = len(weights)
        # Above the weight sum(w) - sum(i) of the socle every monomial is reducible; a product with y_1 adds one to a
        # weight.
        socle = sum(weights) - k * (k + 1) // 2
        self._monomials = monomials(k, max(socle + 1, k))
        self._index = {m: i for i, m in enumerate(self._monomials)}
        self._pivots: dict[int, SparseVector] = {}
        top = weight(self._monomials[0])
        rows = [
            {self._index[tuple(a + b for a, b in zip(m, n, strict=True))]: c for n, c in p.items()}
            for p, w in zip(conditions, weights, strict=True)
            for m in monomials(k, top - w)
        ]
        for row in sorted(rows, key=len):
            self._insert(row)
        self.dimension = len(self._monomials) - len(self._pivots)
        self.one: SparseVector = {self._index[(0,) * k]: Fraction(1)}

    def coordinate(self, i: int) -> SparseVector:
        """y_(i+1)."""
        monomial = tuple(int(j == i) for j in range(len(self._monomials[0])))
        return self._normal({self._index[monomial]: Fraction(1)})

    def times_first(self, vector: SparseVector) -> SparseVector:
        """y_1 times ``vector``."""
        moved = {}
        for i, c in vector.items():
            first, *others = self._monomials[i]
            moved[self._index[first + 1, *others]] = c
        return self._normal(moved)

    def _insert(self, row: SparseVector) -> None:
        while row:
            lead = min(row)
            if lead not in self._pivots:
                self._pivots[lead] = {j: c / row[lead] for j, c in row.items()}
                return
            _subtract(row, self._pivots[lead], row[lead])

    def _normal(self, vector: SparseVector) -> SparseVector:
        rest, kept = dict(vector), {}
        while rest:
            lead = min(rest)
            if lead in self._pivots:
                _subtract(rest, self._pivots[lead], rest[lead])
            else:
                kept[lead] = rest.pop(lead)
        return kept


def _subtract(row: SparseVector, other: SparseVector, factor: Fraction) -> None:
    for j, c in other.items():
        value = row.get(j, Fraction(0)) - factor * c
        if value:
            row[j] = value
        else:
            row.pop(j, None)
