"""Order conditions in the free Lie algebra: logarithms of steps, brackets as Hamiltonians, linear conditions."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache, reduce
from itertools import combinations, pairwise, product
from math import gcd
from typing import NamedTuple

from nearharmonic.exact.words import LETTERS

# --- Coefficients of a logarithm as linear functions of the coefficients of a step.
#
# A step S is a product of exponentials of Lie elements. Then the product of its coefficients on two words is the sum
# of its coefficients on all shuffles of the words (Ree 1958, Ann. Math. 68, 210; Reutenauer 1993, Free Lie Algebras,
# Theorem 3.2). Each power of S - 1 in log S = (S - 1) - (S - 1)^2 / 2 + ... has products of coefficients, which
# become sums.


@cache
def logarithm_weights(word: str) -> Mapping[str, Fraction]:
    """Return weights of words: the weighted sum of a step's coefficients is its logarithm's coefficient on ``word``.

    The words are rearrangements of ``word``.
    """
    found: dict[str, Fraction] = {}
    for parts in range(1, len(word) + 1):
        for cuts in combinations(range(1, len(word)), parts - 1):
            ends = (0, *cuts, len(word))
            pieces = [word[a:b] for a, b in pairwise(ends)]
            for shuffle, count in reduce(_times, pieces[1:], Counter({pieces[0]: 1})).items():
                found[shuffle] = found.get(shuffle, Fraction(0)) - Fraction((-1) ** parts * count, parts)
    return {shuffle: weight for shuffle, weight in found.items() if weight}


def _times(left: Mapping[str, int], word: str) -> Counter[str]:
    """Return the shuffles of each word on the left, as often as it stands there, with one word."""
    found: Counter[str] = Counter()
    for other, count in left.items():
        for shuffle, times in _shuffles(other, word).items():
            found[shuffle] += count * times
    return found


@cache
def _shuffles(u: str, v: str) -> Mapping[str, int]:
    """Return the shuffles of two words and how often each occurs."""
    if not u or not v:
        return {u + v: 1}
    found: Counter[str] = Counter()
    for first, x, y in ((u[0], u[1:], v), (v[0], u, v[1:])):
        for rest, count in _shuffles(x, y).items():
            found[first + rest] += count
    return found


# --- Brackets of A and B as Hamiltonians: combinations of trees, of which some vanish if V is a polynomial.
#
# For T = p.p/2 every bracket of T and V is a sum of contractions of derivatives of V and of momenta. A contraction is
# a free tree: a vertex is a derivative of V, an edge contracts two of them, and a vertex has a number of momenta. The
# order of the derivative is the number of its edges and momenta. {V, T} is the vertex with one momentum, {V, {V, T}}
# two vertices with an edge. Different trees are linearly independent functions of q and p for general V: these
# Hamiltonians are the Lie algebra of classical mechanics, McLachlan & Murua (2019), J. Comput. Dyn. 6, 345,
# doi:10.3934/jcd.2019017. A tree vanishes for every V of degree k if it has a derivative of higher order than k, and
# the others stay independent. Fewer conditions for cubic and quartic V: Escorihuela-Tomas (2026), arXiv:2605.06975.

#: A tree seen from one of its vertices: the momenta there, and the branches in ascending order.
Tree = tuple[int, tuple["Tree", ...]]
#: A sum of trees with integer coefficients; the kinetic energy is no tree, and has the key ``None``.
Hamiltonian = Mapping[Tree | None, int]
#: Momenta of each vertex, and its neighbours.
Graph = tuple[list[int], list[list[int]]]

#: T and V.
KINETIC: Hamiltonian = {None: 1}
POTENTIAL: Hamiltonian = {(0, ()): 1}


def poisson_bracket(f: Hamiltonian, g: Hamiltonian) -> Hamiltonian:
    """Return {f, g} = sum_i df/dq_i dg/dp_i - df/dp_i dg/dq_i."""
    found: Counter[Tree | None] = Counter()
    for x, a in f.items():
        for y, b in g.items():
            for tree, count in _contracted(x, y).items():
                found[tree] += a * b * count
            for tree, count in _contracted(y, x).items():
                found[tree] -= a * b * count
    return {tree: count for tree, count in found.items() if count}


@cache
def _contracted(x: Tree | None, y: Tree | None) -> Mapping[Tree, int]:
    """Return sum_i dx/dq_i dy/dp_i: each vertex of x gains an edge to each momentum of y."""
    if x is None:
        return {}
    momenta, neighbours = _graph(x)
    if y is None:  # its derivative is p, another momentum
        more = [([*momenta[:v], m + 1, *momenta[v + 1 :]], neighbours) for v, m in enumerate(momenta)]
        return Counter(_tree(graph) for graph in more)
    found: Counter[Tree] = Counter()
    other, beyond = _graph(y)
    size = len(momenta)
    for w, count in enumerate(other):
        for v in range(size if count else 0):
            joined = [list(around) for around in neighbours] + [[i + size for i in around] for around in beyond]
            joined[v].append(w + size)
            joined[w + size].append(v)
            found[_tree((momenta + other[:w] + [count - 1] + other[w + 1 :], joined))] += count
    return found


def _graph(tree: Tree) -> Graph:
    momenta: list[int] = []
    neighbours: list[list[int]] = []
    waiting: list[tuple[Tree, int | None]] = [(tree, None)]
    while waiting:
        (count, branches), above = waiting.pop()
        here = len(momenta)
        momenta.append(count)
        neighbours.append([] if above is None else [above])
        if above is not None:
            neighbours[above].append(here)
        waiting += [(branch, here) for branch in branches]
    return momenta, neighbours


def _tree(graph: Graph) -> Tree:
    """Return the smallest of the views of a graph from its vertices: equal trees have equal ones."""
    return min(_seen_from(graph, v, None) for v in range(len(graph[0])))


def _seen_from(graph: Graph, vertex: int, above: int | None) -> Tree:
    momenta, neighbours = graph
    branches = sorted(_seen_from(graph, w, vertex) for w in neighbours[vertex] if w != above)
    return momenta[vertex], tuple(branches)


def surviving_rows(elements: Sequence[Hamiltonian], potential_degree: int) -> Iterator[list[int]]:
    """Yield the coefficients of each tree in the ``elements``, for trees that do not vanish for V of this degree."""
    trees = dict.fromkeys(tree for one in elements for tree in one)
    for tree in trees:
        # The order of a derivative of V is the number of momenta and edges of its vertex.
        vertices = [] if tree is None else zip(*_graph(tree), strict=True)
        if all(momenta + len(around) <= potential_degree for momenta, around in vertices):
            yield [one.get(tree, 0) for one in elements]


# --- Order conditions as linear conditions on the logarithm of a step, in the free Lie algebra and in a quotient of it.
#
# The logarithm of a product of exponentials is a Lie series. In degree n it has one coordinate for each Lyndon word
# of n letters (A < B), in the *Lyndon basis*. The basis element of a word w = uv, where v is the longest proper
# suffix of w that is a Lyndon word, is the bracket [u, v]. Reutenauer (1993), Free Lie Algebras, chapter 5.
#
# For the kinetic energy T = p.p/2 some brackets vanish for every potential: V and the modified potentials [X, [Y, T]]
# of potentials X and Y depend only on q, and therefore commute. These identities generate an ideal. The quotient by
# this ideal is the Lie algebra of classical mechanics, McLachlan & Murua (2019), J. Comput. Dyn. 6, 345,
# doi:10.3934/jcd.2019017. The one identity [B, [B, [B, A]]] = 0 generates all of it up to degree 7, but not beyond.

#: An element of the free Lie algebra, as coefficients of words.
Element = dict[str, int]
#: A vector up to a positive factor, so that its entries can be integers: those that are not 0, by index. One in ten is.
Components = dict[int, int]


class Condition(NamedTuple):
    """One independent order condition of a degree.

    ``numbers`` has integers for the Lyndon words of the degree, ``words`` in lexicographic order, by index and without
    zeros; ``largest`` is the largest modulus. A step fulfils the condition if the sum of the coefficients of its
    logarithm on these words, times the numbers, is 0. The squares of these sums over ``largest``, each divided by its
    ``scale``, add up to the square of the norm.
    """

    numbers: Components
    words: int
    largest: int
    scale: Fraction

    @property
    def weights(self) -> tuple[Fraction, ...]:
        """The numbers of all words over the largest modulus."""
        return tuple(Fraction(self.numbers.get(i, 0), self.largest) for i in range(self.words))


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
        within = [{i: c for i, row in enumerate(to_basis) if (c := _dot(row, x))} for x in vanishing]
        normals = _orthogonal(within, _units(len(to_basis))) if quadratic else _units(len(to_basis))
    else:
        elements = [hamiltonian(word) for word in lyndon_words(degree)]
        rows = surviving_rows(elements, potential_degree)
        normals = _orthogonal([], ({i: c for i, c in enumerate(row) if c} for row in rows))
    found = []
    for normal in normals:
        row: Components = {}
        for i, a in normal.items():
            row = _combination(1, row, a, to_basis[i])
        largest = max(map(abs, row.values()))
        found.append(Condition(row, len(to_basis), largest, Fraction(_dot(normal, normal), largest**2)))
    return tuple(found)


def _on_lyndon_words(x: Element, degree: int) -> Components:
    return {i: x[word] for i, word in enumerate(lyndon_words(degree)) if x.get(word)}


@cache
def _to_basis(degree: int) -> list[Components]:
    """The matrix that turns coefficients on Lyndon words into coordinates in the Lyndon basis.

    The smallest word of a bracketing is its own word, so the inverse is unit triangular.
    """
    size = len(lyndon_words(degree))
    rows = _units(size)
    for j, word in enumerate(lyndon_words(degree)):
        for i, x in _on_lyndon_words(bracketing(word), degree).items():
            if i > j:
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
        candidates += [bracket(x, y) for x, y in (combinations(low, 2) if 2 * d == degree else product(low, high))]
    return tuple(_independent(candidates, degree))


def _independent(candidates: Sequence[Element], degree: int) -> list[Element]:
    """The ``candidates`` that are not linear combinations of previous ones."""
    chosen: list[Element] = []
    echelon: list[tuple[int, Components]] = []
    for x in candidates:
        row = _on_lyndon_words(x, degree)
        for pivot, other in echelon:
            if pivot in row:
                row = _primitive(_combination(other[pivot], row, -row[pivot], other))
        if row:
            echelon.append((min(row), row))
            chosen.append(x)
    return chosen


def _orthogonal(before: Sequence[Components], vectors: Iterable[Components]) -> list[Components]:
    """The parts of ``vectors`` orthogonal to ``before`` and to previous ones, by the exact Gram-Schmidt method.

    Parts that are zero are left out.
    """
    found: list[tuple[Components, int]] = []
    for vector in (*before, *vectors):
        rest = vector
        for other, square in found:
            if not other.keys().isdisjoint(rest) and (along := _dot(rest, other)):
                rest = _primitive(_combination(square, rest, -along, other))
        if rest:
            found.append((rest, _dot(rest, rest)))
    return [vector for vector, _ in found[len(before) :]]


def _units(size: int) -> list[Components]:
    return [{i: 1} for i in range(size)]


def _combination(a: int, x: Components, b: int, y: Components) -> Components:
    total = {i: a * c for i, c in x.items()}
    for i, c in y.items():
        total[i] = total.get(i, 0) + b * c
        if not total[i]:
            del total[i]
    return total


def _primitive(vector: Components) -> Components:
    """The shortest vector of integers in the same direction."""
    divisor = gcd(*vector.values())
    return {i: c // divisor for i, c in vector.items()} if divisor > 1 else vector


def _dot(x: Components, y: Components) -> int:
    return sum([c * y[i] for i, c in x.items() if i in y])
