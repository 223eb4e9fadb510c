"""Expressions as polynomials: expansion where it takes fewer operations, and degree in some variables."""

from __future__ import annotations

from collections.abc import Sequence, Set
from fractions import Fraction

from nearharmonic.core.formulas.expression.graph import Graph, displacements
from nearharmonic.core.formulas.expression.nodes import Exact, Product, Sum, Value, children, exact
from nearharmonic.core.formulas.expression.program import Program
from nearharmonic.core.formulas.expression.writer import program

#: A product of powers of nodes, sorted by node.
Monomial = tuple[tuple[int, Exact], ...]
Polynomial = dict[Monomial, Exact]

#: Largest number of terms of a polynomial that replaces an expression: larger polynomials take more operations.
MOST_TERMS = 64
#: Largest number of factors of a term.
MOST_FACTORS = 64
#: Largest number of terms in the proof that a polynomial has a low degree.
MOST_TERMS_OF_PROOF = 100_000


class _TooLargeError(Exception):
    pass


def shortest_program(graph: Graph, roots: Sequence[Value], formula: Value) -> Program:
    """Return operations that compute ``roots``, expanded if that takes fewer operations and no longer chain.

    Sums of variables and constants in the energy ``formula`` are displacements, which may be small while their terms
    are large; they are never expanded.
    """
    plain = program(graph, roots)
    try:
        polynomials = _polynomials(graph, roots, displacements(graph, [formula]), MOST_TERMS)
    except _TooLargeError:
        return plain
    expanded = program(graph, [_as_value(graph, polynomials, root) for root in roots])
    return expanded if expanded.work < plain.work and expanded.chain <= plain.chain else plain


def is_quadratic(graph: Graph, root: Value, variables: Set[int]) -> bool:
    """Return True if ``root``, in any form, is a polynomial of degree at most 2 in the nodes ``variables``."""
    if root.node is None:
        return True
    if _bound(graph, root, variables) <= 2:
        return True
    depends = _dependent(graph, root, variables)
    try:
        polynomial = _polynomials(graph, [root], frozenset(), MOST_TERMS_OF_PROOF)[root.node]
    except _TooLargeError:
        return False
    for monomial in polynomial:
        degree: Exact = 0
        for node, e in monomial:
            if node in variables and e.denominator == 1 and e > 0:
                degree += e
            elif node in depends:
                return False
        if degree > 2:
            return False
    return True


def polynomial_of(graph: Graph, root: Value) -> Polynomial:
    """Return a polynomial by its coefficients; an empty one if it has too many terms."""
    if root.node is None:
        return {(): root.coefficient} if root.coefficient else {}
    try:
        found = _polynomials(graph, [root], frozenset(), MOST_TERMS_OF_PROOF)[root.node]
    except _TooLargeError:
        return {}
    return {monomial: exact(root.coefficient * c) for monomial, c in found.items()}


def _dependent(graph: Graph, root: Value, variables: Set[int]) -> set[int]:
    """The nodes that depend on the variables."""
    found = set(variables)
    for i in graph.reachable([root]):
        if any(child in found for child in children(graph.nodes[i])):
            found.add(i)
    return found


def _bound(graph: Graph, root: Value, variables: Set[int]) -> Exact:
    """A bound on the degree: that of the polynomial before cancellation; 3 for all larger ones and other functions."""
    degrees: dict[int, Exact] = {}
    for i in graph.reachable([root]):
        node = graph.nodes[i]
        if i in variables:
            degrees[i] = 1
        elif isinstance(node, Sum):
            degrees[i] = max(degrees[n] for n, _ in node.terms)
        elif isinstance(node, Product):
            powers = [(degrees[n], e) for n, e in node.factors if degrees[n]]
            regular = all(e.denominator == 1 and e > 0 for _, e in powers)
            degrees[i] = min(3, sum(d * e for d, e in powers)) if regular else 3
        else:
            degrees[i] = 3 if any(degrees[n] for n in children(node)) else 0
    assert root.node is not None
    return degrees[root.node]


def _polynomials(graph: Graph, roots: Sequence[Value], kept: Set[int], most_terms: int) -> dict[int, Polynomial]:
    """Every node below ``roots`` as a polynomial in the nodes ``kept`` and in nodes other than sums and products."""
    found: dict[int, Polynomial] = {}
    for i in graph.reachable(roots):
        node = graph.nodes[i]
        if isinstance(node, Sum) and i not in kept:
            total: Polynomial = {(): node.constant} if node.constant else {}
            for n, c in node.terms:
                for monomial, factor in found[n].items():
                    total[monomial] = exact(total.get(monomial, 0) + c * factor)
            found[i] = _without_zeros(total, most_terms)
        elif isinstance(node, Product):
            found[i] = {(): 1}
            for n, e in node.factors:
                found[i] = _times(found[i], _power(found[n], n, e, most_terms), most_terms)
        else:
            found[i] = {((i, 1),): 1}
    return found


def _power(polynomial: Polynomial, node: int, e: Exact, most_terms: int) -> Polynomial:
    if len(polynomial) == 1 and e.denominator == 1:
        ((monomial, c),) = polynomial.items()
        if c == 1 or e > 0:
            return {tuple((n, exact(k * e)) for n, k in monomial): exact(Fraction(c) ** int(e))}
    if e.denominator != 1 or e < 0:
        return {((node, e),): 1}
    if e > most_terms:
        raise _TooLargeError
    result: Polynomial = {(): 1}
    for _ in range(int(e)):
        result = _times(result, polynomial, most_terms)
    return result


def _times(a: Polynomial, b: Polynomial, most_terms: int) -> Polynomial:
    if len(a) * len(b) > 50 * most_terms:
        raise _TooLargeError
    result: Polynomial = {}
    for left, c in a.items():
        for right, d in b.items():
            powers = dict(left)
            for node, e in right:
                powers[node] = exact(powers.get(node, 0) + e)
            if len(powers) > MOST_FACTORS:
                raise _TooLargeError
            monomial = tuple(sorted((node, e) for node, e in powers.items() if e))
            result[monomial] = exact(result.get(monomial, 0) + c * d)
    return _without_zeros(result, most_terms)


def _without_zeros(polynomial: Polynomial, most_terms: int) -> Polynomial:
    left = {monomial: c for monomial, c in polynomial.items() if c}
    if len(left) > most_terms:
        raise _TooLargeError
    return left


def _as_value(graph: Graph, polynomials: dict[int, Polynomial], root: Value) -> Value:
    if root.node is None:
        return root
    products = ((c, graph.product_of(dict(monomial))) for monomial, c in polynomials[root.node].items())
    # Two monomials may be equal as products: |x| sign(x) is x.
    return graph.total(Value(exact(root.coefficient * c * x.coefficient), x.node) for c, x in products)
