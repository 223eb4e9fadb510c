"""Order conditions as linear conditions on the logarithm of a step, in the free Lie algebra and in a quotient of it.

The logarithm of a product of exponentials is a Lie series. In degree n it has one coordinate for each Lyndon word of n
letters (A < B), in the *Lyndon basis*. The basis element of a word w = uv, where v is the longest proper suffix of w
that is a Lyndon word, is the bracket [u, v]. Reutenauer (1993), Free Lie Algebras, chapter 5.

For the kinetic energy T = p.p/2 some brackets vanish for every potential: V and the modified potentials [X, [Y, T]] of
potentials X and Y depend only on q, and therefore commute. These identities generate an ideal. The quotient by this
ideal is the Lie algebra of classical mechanics, McLachlan & Murua (2019), J. Comput. Dyn. 6, 345,
doi:10.3934/jcd.2019017. The one identity [B, [B, [B, A]]] = 0 generates all of it up to degree 7, but not beyond.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from itertools import combinations, product
from math import gcd
from operator import mul
from typing import NamedTuple

from nearharmonic.exact.lie.trees import KINETIC, POTENTIAL, Hamiltonian, poisson_bracket, surviving_rows
from nearharmonic.exact.words import LETTERS

#: An element of the free Lie algebra, as coefficients of words.
Element = dict[str, int]
#: A vector up to a positive factor, so that its entries can be integers.
Components = list[int]


class Condition(NamedTuple):
    """One independent order condition of a degree.

    ``weights`` are numbers for the Lyndon words of the degree, in lexicographic order; the largest modulus is 1. A step
    fulfils the condition if the weighted sum of the coefficients of its logarithm on these words is 0. The squares of
    these sums, each divided by its ``scale``, add up to the square of the norm.
    """

    weights: tuple[Fraction, ...]
    scale: Fraction


@cache
def lyndon_words(length: int) -> tuple[str, ...]:
    """The words of ``length`` letters that are smaller than all their proper suffixes, in lexicographic order."""
    candidates = map("".join, product(LETTERS, repeat=length))
    return tuple(word for word in candidates if all(word < word[k:] for k in range(1, length)))


@cache
def bracketing(word: str) -> Element:
    """The element of the Lyndon basis for the Lyndon ``word``."""
    if len(word) == 1:
        return {word: 1}
    left, right = factors(word)
    return bracket(bracketing(left), bracketing(right))


def factors(word: str) -> tuple[str, str]:
    """The Lyndon words u and v of a longer Lyndon word uv, v the longest proper suffix that is one."""
    split = next(k for k in range(1, len(word)) if word[k:] in lyndon_words(len(word) - k))
    return word[:split], word[split:]


@cache
def hamiltonian(word: str) -> Hamiltonian:
    """The element of the Lyndon basis for quadratic kinetic energy, as Poisson brackets of T (A) and V (B)."""
    if len(word) == 1:
        return KINETIC if word == "A" else POTENTIAL
    left, right = factors(word)
    return poisson_bracket(hamiltonian(left), hamiltonian(right))


def bracket(x: Element, y: Element) -> Element:
    """The commutator xy - yx."""
    result: Element = {}
    for (u, a), (v, b) in product(x.items(), y.items()):
        result[u + v] = result.get(u + v, 0) + a * b
        result[v + u] = result.get(v + u, 0) - a * b
    return {word: number for word, number in result.items() if number}


@cache
def conditions(degree: int, *, quadratic: bool, potential_degree: int | None = None) -> tuple[Condition, ...]:
    """The order conditions of ``degree``: for any separable H, or only for ``quadratic`` kinetic energy.

    With a ``potential_degree`` they are those for quadratic T and for every polynomial V of this degree. Their norm is
    the Euclidean norm of the coordinates in the Lyndon basis. In the quotient it is the smallest norm of all
    representatives.
    """
    to_basis = _to_basis(degree)
    if potential_degree is None:
        vanishing = [_on_lyndon_words(x, degree) for x in _ideal(degree)] if quadratic else []
        normals = _orthogonal_complement([[_dot(row, x) for row in to_basis] for x in vanishing], len(to_basis))
    else:
        elements = [hamiltonian(word) for word in lyndon_words(degree)]
        normals = _orthogonal([], surviving_rows(elements, potential_degree))
    found = []
    for normal in normals:
        row = [0] * len(to_basis)
        for a, coordinates in zip(normal, to_basis, strict=True):
            if a:
                row = _combination(1, row, a, coordinates)
        largest = max(map(abs, row))
        found.append(Condition(tuple(Fraction(x, largest) for x in row), Fraction(_dot(normal, normal), largest**2)))
    return tuple(found)


def _on_lyndon_words(x: Element, degree: int) -> Components:
    return [x.get(word, 0) for word in lyndon_words(degree)]


@cache
def _to_basis(degree: int) -> list[Components]:
    """The matrix that turns coefficients on Lyndon words into coordinates in the Lyndon basis.

    The smallest word of a bracketing is its own word, so the inverse is unit triangular.
    """
    size = len(lyndon_words(degree))
    rows = _units(size)
    for j, word in enumerate(lyndon_words(degree)):
        for i, x in enumerate(_on_lyndon_words(bracketing(word), degree)):
            if i > j and x:
                rows[i] = _combination(1, rows[i], -x, rows[j])
    return rows


@cache
def _potentials(degree: int) -> tuple[Element, ...]:
    """V and the modified potentials of ``degree``: [X, [Y, A]] for each unordered pair of smaller ones."""
    if degree == 1:
        return ({"B": 1},)
    return tuple(
        bracket(x, bracket(y, {"A": 1}))
        for d in range(1, (degree - 1) // 2 + 1)
        for i, x in enumerate(_potentials(d))
        for j, y in enumerate(_potentials(degree - 1 - d))
        if d != degree - 1 - d or i <= j
    )


@cache
def _ideal(degree: int) -> tuple[Element, ...]:
    """A basis of the elements of ``degree`` that vanish for quadratic kinetic energy.

    They are brackets of A and B with the vanishing elements one degree below, and commutators of potentials.
    """
    if degree < 2:
        return ()
    candidates = [bracket({letter: 1}, x) for letter in LETTERS for x in _ideal(degree - 1)]
    for d in range(1, degree // 2 + 1):
        low, high = _potentials(d), _potentials(degree - d)
        pairs = combinations(low, 2) if 2 * d == degree else product(low, high)
        candidates += [bracket(x, y) for x, y in pairs]
    return tuple(_independent(candidates, degree))


def _independent(candidates: Sequence[Element], degree: int) -> list[Element]:
    """The ``candidates`` that are not linear combinations of previous ones."""
    chosen: list[Element] = []
    echelon: list[tuple[int, Components]] = []
    for x in candidates:
        row = _on_lyndon_words(x, degree)
        for pivot, other in echelon:
            if row[pivot]:
                row = _primitive(_combination(other[pivot], row, -row[pivot], other))
        lead = next((i for i, a in enumerate(row) if a), None)
        if lead is not None:
            echelon.append((lead, row))
            chosen.append(x)
    return chosen


def _orthogonal_complement(vectors: Sequence[Components], size: int) -> list[Components]:
    """Orthogonal vectors that span the orthogonal complement of independent ``vectors``."""
    return _orthogonal(vectors, _units(size)) if vectors else _units(size)


def _orthogonal(before: Sequence[Components], vectors: Iterable[Components]) -> list[Components]:
    """The parts of ``vectors`` orthogonal to ``before`` and to previous ones, by the exact Gram-Schmidt method.

    Parts that are zero are left out.
    """
    found: list[tuple[Components, int]] = []
    for vector in (*before, *vectors):
        rest = vector
        for other, square in found:
            along = _dot(rest, other)
            if along:
                rest = _primitive(_combination(square, rest, -along, other))
        if any(rest):
            found.append((rest, _dot(rest, rest)))
    return [vector for vector, _ in found[len(before) :]]


def _units(size: int) -> list[Components]:
    return [[int(i == j) for j in range(size)] for i in range(size)]


def _combination(a: int, x: Components, b: int, y: Components) -> Components:
    return [a * u + b * v if v else a * u for u, v in zip(x, y, strict=True)]


def _primitive(vector: Components) -> Components:
    """The shortest vector of integers in the same direction."""
    divisor = gcd(*vector)
    return [x // divisor for x in vector] if divisor > 1 else vector


def _dot(x: Components, y: Components) -> int:
    return sum(map(mul, x, y))
