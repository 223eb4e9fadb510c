"""Exact linear algebra in the ring of polynomials modulo weighted conditions, one per variable."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product as cartesian

from nearharmonic.exact.multivariate import Monomial, Multivariate, add

#: Nonzero entries by index.
SparseVector = dict[int, Fraction]
#: First index of labels, above the indices of entries.
LABELS = 1 << 32


def weight(monomial: Monomial) -> int:
    """Weight of a monomial, if y_i has weight i."""
    return sum((i + 1) * exponent for i, exponent in enumerate(monomial))


def monomials(variables: int, highest: int) -> list[Monomial]:
    """All monomials up to a weight, the highest weight first."""
    ranges = [range(highest // (i + 1) + 1) for i in range(variables)]
    kept = [m for m in cartesian(*ranges) if weight(m) <= highest]
    return sorted(kept, key=lambda m: (-weight(m), m))


class Echelon:
    """Rows in echelon form; it finds linear relations between vectors with labels.

    The entries of a row from :data:`LABELS` on are the combination of inserted vectors, by label, that makes the row.
    """

    def __init__(self) -> None:
        self._rows: dict[int, SparseVector] = {}

    def insert(self, vector: SparseVector, label: int) -> SparseVector | None:
        """Add a vector; if it depends on previous vectors, return the vanishing combination by labels."""
        rest = _reduced(vector | {LABELS + label: Fraction(1)}, self._rows)
        if min(rest) >= LABELS:
            return {j - LABELS: c for j, c in rest.items()}
        _keep(rest, self._rows)
        return None

    def express(self, vector: SparseVector) -> SparseVector:
        """``vector`` as a combination of labels."""
        rest = _reduced(vector, self._rows)
        assert all(j >= LABELS for j in rest)
        return {j - LABELS: -c for j, c in rest.items()}


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
            if rest := _reduced(row, self._pivots):
                _keep(rest, self._pivots)
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

    def _normal(self, vector: SparseVector) -> SparseVector:
        return _reduced(vector, self._pivots)


def _keep(row: SparseVector, rows: dict[int, SparseVector]) -> None:
    """Add a reduced row to rows in echelon form, by the index of its first entry, which becomes 1."""
    lead = min(row)
    rows[lead] = {j: c / row[lead] for j, c in row.items()}


def _reduced(vector: SparseVector, rows: dict[int, SparseVector]) -> SparseVector:
    """``vector`` minus multiples of rows, so that no first entry of a row is left."""
    rest, kept = dict(vector), {}
    while rest:
        lead = min(rest)
        if lead in rows:
            rest = add(rest, rows[lead], -rest[lead])
        else:
            kept[lead] = rest.pop(lead)
    return kept
