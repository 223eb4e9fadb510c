"""Brackets of A and B as Hamiltonians: combinations of trees, of which some vanish if V is a polynomial.

For T = p.p/2 every bracket of T and V is a sum of contractions of derivatives of V and of momenta. A contraction is a
free tree: a vertex is a derivative of V, an edge contracts two of them, and a vertex has a number of momenta. The order
of the derivative is the number of its edges and momenta. {V, T} is the vertex with one momentum, {V, {V, T}} two
vertices with an edge. Different trees are linearly independent functions of q and p for general V: these Hamiltonians
are the Lie algebra of classical mechanics, McLachlan & Murua (2019), J. Comput. Dyn. 6, 345,
doi:10.3934/jcd.2019017. A tree vanishes for every V of degree k if it has a derivative of higher order than k, and the
others stay independent. Fewer conditions for cubic and quartic V: Escorihuela-Tomas (2026), arXiv:2605.06975.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cache

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


def highest_derivative(tree: Tree | None) -> int:
    """Return the highest order of the derivatives of V in a tree; 0 for the kinetic energy."""
    if tree is None:
        return 0
    momenta, neighbours = _graph(tree)
    return max(m + len(around) for m, around in zip(momenta, neighbours, strict=True))


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
        if highest_derivative(tree) <= potential_degree:
            yield [one.get(tree, 0) for one in elements]
