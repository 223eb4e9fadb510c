"""Programs of expressions: operations in an order with short chains, and expansion into polynomials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence, Set
from fractions import Fraction
from heapq import heapify, heappop, heappush
from typing import Any

from nearharmonic.core.expression import (
    Application,
    Exact,
    Graph,
    Literal,
    Node,
    Product,
    Sum,
    Value,
    Variable,
    children,
    displacements,
    exact,
    modulus,
)
from nearharmonic.core.number import Constant

# --- Sequences of operations that run on numbers of any type.

#: Number of operations from which on their order is chosen to save registers.
MANY_OPERATIONS = 200
#: Time for which an operation occupies the processor, in half cycles; others take 1.
WORK = {"divide": 8, "root": 9}

#: An operation: its name and its operands. An operand is the place of a result, or an exact constant.
Operation = tuple[Any, ...]


class Program:
    """Operations that turn arguments into results.

    ``operations`` are names with the places of the operands, and a result has the place of its operation; ``results``
    are places. ``chain`` is the longest chain of operations in cycles, ``work`` the sum over the operations of the time
    for which each occupies the processor, in half cycles.
    """

    def __init__(self, operations: list[Operation], results: list[int], chain: int) -> None:
        needed = set(results)
        for place in range(len(operations) - 1, -1, -1):
            if place in needed:
                needed.update(_places(operations[place]))
        kept = sorted(needed)
        if len(kept) > MANY_OPERATIONS:
            kept = _used_soon(operations, kept)
        moved = {old: new for new, old in enumerate(kept)}
        self.operations = [_moved(operations[place], moved) for place in kept]
        self.results, self.chain = [moved[place] for place in results], chain
        uses = Counter(x for operation in self.operations for x in _places(operation))
        fused = sum(
            any(self.operations[x][0] == "multiply" and uses[x] == 1 for x in _places(operation))
            for operation in self.operations
            if operation[0] in ("add", "subtract")
        )
        names = [operation[0] for operation in self.operations]
        self.work = sum(WORK.get(name, name not in ("variable", "constant", "negate")) for name in names) - fused

    def run(
        self, arguments: Sequence[Any], constant: Callable[[Constant], Any], function: Callable[..., Any]
    ) -> tuple[Any, ...]:
        """Return the results for ``arguments``, of one type with + - * / and abs.

        ``constant`` converts an exact constant to that type; ``function(name, x, ...)`` is the value of a function of
        formulas, of "root" or of "sign".
        """
        values: list[Any] = []
        for name, *operands in self.operations:
            if name == "constant":
                values.append(constant(operands[0]))
            elif name == "variable":
                values.append(arguments[operands[0]])
            elif name in ARITHMETIC:
                values.append(ARITHMETIC[name](*[values[x] for x in operands]))
            else:
                values.append(function(name, *[values[x] for x in operands]))
        return tuple(values[place] for place in self.results)


#: Operations that Python's operators do.
ARITHMETIC: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "subtract": lambda a, b: a - b,
    "multiply": lambda a, b: a * b,
    "divide": lambda a, b: a / b,
    "negate": lambda a: -a,
    "abs": abs,
}


def _places(operation: Operation) -> tuple[int, ...]:
    return () if operation[0] in ("constant", "variable") else operation[1:]


def _used_soon(operations: list[Operation], kept: Sequence[int]) -> list[int]:
    """An order of the places ``kept`` in which each result is used soon after its computation, to save registers."""
    missing = {place: len(set(_places(operations[place]))) for place in kept}
    users: dict[int, list[int]] = {}
    for place in kept:
        for operand in set(_places(operations[place])):
            users.setdefault(operand, []).append(place)
    order = [place for place in kept if not missing[place]]  # arguments and constants
    ready: list[int] = []
    for place in order:
        for user in users.get(place, ()):
            missing[user] -= 1
            if not missing[user]:
                ready.append(user)
    ready.sort(reverse=True)
    while ready:
        place = ready.pop()
        order.append(place)
        for user in reversed(users.get(place, ())):
            missing[user] -= 1
            if not missing[user]:
                ready.append(user)
    return order


def _moved(operation: Operation, moved: dict[int, int]) -> Operation:
    name, *operands = operation
    return operation if name in ("constant", "variable") else (name, *(moved[x] for x in operands))


# --- The operations that compute expressions, in an order with short chains of operations.
#
# One trajectory is bound by the latency of the longest chain from the coordinates to the force. The latencies of the
# processor decide the order of sums and products: operands that are ready late come last, and a product that is added
# is fused.

#: Cycles from an operand to a result on current processors; a function is counted as a polynomial of degree ten.
LATENCY = {
    "add": 3, "subtract": 3, "multiply": 4, "fused": 4, "divide": 13, "root": 18, "negate": 1, "abs": 1, "sign": 2,
}  # fmt: skip
FUNCTION = 50
#: Number of terms from which on a sum is added in groups, and number of terms of a group.
LONG_SUM, GROUP = 12, 4


def program(graph: Graph, roots: Sequence[Value]) -> Program:
    writer = _Writer(graph, roots)
    for node in graph.reachable(roots):
        if node not in writer.joined:
            writer.value(1, node)
    results = [writer.result(root) for root in roots]
    return Program(writer.operations, results, max((writer.ready[place] for place in results), default=0))


class _Writer:
    """Writes the operations of a graph; equal operations are written once."""

    def __init__(self, graph: Graph, roots: Sequence[Value]) -> None:
        self.graph = graph
        self.operations: list[Operation] = []
        self.ready: list[int] = []
        self._places: dict[Operation, int] = {}
        self._values: dict[tuple[Exact, int], int] = {}
        reachable = graph.reachable(roots)
        self.uses = Counter(child for i in reachable for child in children(graph.nodes[i]))
        self.uses.update(root.node for root in roots if root.node is not None)
        #: Sums that are used once, in a sum, and products that are used once, in a product.
        self.joined = self._joined(reachable, displacements(graph, roots))
        self._inverses = self._negative_powers(reachable)

    def _joined(self, reachable: Sequence[int], kept: frozenset[int]) -> frozenset[int]:
        joined: set[int] = set()
        for i in reachable:
            node = self.graph.nodes[i]
            if isinstance(node, Sum):
                candidates = [n for n, _ in node.terms if isinstance(self.graph.nodes[n], Sum) and n not in kept]
            elif isinstance(node, Product):
                candidates = [n for n, e in node.factors if isinstance(self.graph.nodes[n], Product) and e == 1]
            else:
                continue
            joined.update(n for n in candidates if self.uses[n] == 1)
        return frozenset(joined)

    def _negative_powers(self, reachable: Sequence[int]) -> dict[int, set[Exact]]:
        """Nodes that several products divide by, with the exponents."""
        found: dict[int, list[Exact]] = {}
        for i in reachable:
            if isinstance(self.graph.nodes[i], Product) and i not in self.joined:
                for base, e in self._factors(i).items():
                    if e < 0:
                        found.setdefault(base, []).append(e)
        return {base: set(exponents) for base, exponents in found.items() if len(exponents) > 1}

    def write(self, name: str, *operands: Any) -> int:
        """Return the place of an operation."""
        operation = (name, *operands)
        place = self._places.get(operation)
        if place is None:
            place = self._places[operation] = len(self.operations)
            self.operations.append(operation)
            if name in ("constant", "variable"):
                self.ready.append(0)
            elif name in ("add", "subtract") and any(self.operations[x][0] == "multiply" for x in operands):
                self.ready.append(max(map(self._fusible, operands)) + LATENCY["fused"])
            else:
                self.ready.append(max(self.ready[x] for x in operands) + LATENCY.get(name, FUNCTION))
        return place

    def constant(self, value: Exact) -> int:
        return self.write("constant", Constant(value))

    def _fusible(self, place: int) -> int:
        """Cycle in which an addend is ready; a product is ready with its operands, as it is fused."""
        operation = self.operations[place]
        return max(self.ready[x] for x in operation[1:]) if operation[0] == "multiply" else self.ready[place]

    def result(self, root: Value) -> int:
        return self.constant(root.coefficient) if root.node is None else self.value(root.coefficient, root.node)

    def value(self, c: Exact, node: int) -> int:
        place = self._values.get((c, node))
        if place is None:
            found = self.graph.nodes[node]
            place = self._values[c, node] = self._written(c, node, found)
        return place

    def _written(self, c: Exact, node: int, found: Node) -> int:
        if c != -1 or self.uses[node] == 1:  # a force and its reaction differ in sign
            if isinstance(found, Product):
                return self._product(c, self._factors(node))
            if isinstance(found, Sum) and modulus(c) == 1:
                return self._sum(*self._terms(c, node))
        if c != 1:
            x = self.value(1, node)
            return self.write("negate", x) if c == -1 else self.write("multiply", x, self.constant(c))
        if isinstance(found, Application):
            return self.write(found.function, *(self.value(1, x) for x in found.operands))
        assert isinstance(found, Variable | Literal)
        return self.write("variable", found.place) if isinstance(found, Variable) else self.constant(found.value)

    def _terms(self, c: Exact, node: int) -> tuple[Exact, list[tuple[int, Exact]]]:
        """The constant and the terms of a sum times ``c``, with the terms of the sums that are joined to it."""
        constant: Exact = 0
        terms, pending = [], [(node, c)]
        while pending:
            inner, factor = pending.pop()
            found = self.graph.nodes[inner]
            if isinstance(found, Sum) and (inner == node or inner in self.joined):
                constant = exact(constant + factor * found.constant)
                pending.extend((n, exact(factor * share)) for n, share in reversed(found.terms))
            else:
                terms.append((inner, factor))
        return constant, terms

    def _sum(self, constant: Exact, terms: list[tuple[int, Exact]]) -> int:
        parts = [self._term(c, node) for node, c in terms] if len(terms) <= LONG_SUM else self._collected(terms)
        if constant:
            parts.append((1 if constant > 0 else -1, self.constant(modulus(constant))))
        return self._added(parts)

    def _collected(self, terms: list[tuple[int, Exact]]) -> list[tuple[int, int]]:
        """The parts of a long sum; a factor that several terms share is taken out of them."""
        groups: dict[Exact, list[tuple[int, Exact]]] = {}
        for node, c in terms:
            groups.setdefault(modulus(c), []).append((node, c))
        parts = []
        for factor, group in groups.items():
            if factor == 1 or len(group) <= GROUP:
                parts += [self._term(c, node) for node, c in group]
            else:
                total = self._added([self._term(1 if c > 0 else -1, node) for node, c in group])
                parts.append((1, self._scaled(factor, [total])))
        return parts

    def _added(self, parts: list[tuple[int, int]]) -> int:
        """The sum of places with their signs: sequential, or in groups if it is long, for a shorter chain."""
        while len(parts) > LONG_SUM:
            parts = [(1, self._added(parts[i : i + GROUP])) for i in range(0, len(parts), GROUP)]
        parts.sort(key=lambda part: (self._fusible(part[1]), self.operations[part[1]][0] == "multiply"))
        first = next((part for part in parts if part[0] > 0), parts[0])
        parts.remove(first)
        total = first[1] if first[0] > 0 else self.write("negate", first[1])
        for sign, part in parts:
            # The first operand is the one that is fused if both are products.
            if sign > 0:
                total = self.write("add", part, total)
            elif self.operations[total][0] == "multiply" and self.operations[part][0] == "multiply":
                total = self.write("add", self.write("negate", part), total)
            else:
                total = self.write("subtract", total, part)
        return total

    def _term(self, c: Exact, node: int) -> tuple[int, int]:
        """The sign of a term, and the place of its modulus."""
        return (1 if c > 0 else -1), self.value(modulus(c), node)

    def _factors(self, node: int) -> dict[int, Exact]:
        """The factors of a product, with the factors of the products that are joined to it."""
        factors: dict[int, Exact] = {}
        pending: list[tuple[int, Exact]] = [(node, 1)]
        while pending:
            inner, e = pending.pop()
            found = self.graph.nodes[inner]
            if isinstance(found, Product) and (inner == node or (inner in self.joined and e == 1)):
                pending.extend(reversed(found.factors))
            else:
                factors[inner] = exact(factors.get(inner, 0) + e)
        return {base: e for base, e in factors.items() if e}

    def _product(self, c: Exact, factors: dict[int, Exact]) -> int:
        top: list[int] = []
        bottom: list[int] = []
        for base, e in factors.items():
            if e < 0 and base not in self._inverses:
                # The division runs at the same time as the root: s^(-3/2) = sqrt(s) / s^2.
                whole = -int(e // 1)
                bottom.append(self._whole_power(self.value(1, base), whole))
                if e.denominator == 2:
                    top.append(self.write("root", self.value(1, base)))
            else:
                top.extend(self._power(base, e))
        if bottom:
            below = self._multiplied(bottom)
            late = [x for x in top if self.operations[x][0] == "root"]
            early = [x for x in top if x not in late]
            above = self._scaled(c, early)
            return self._multiplied([self.write("divide", above, below), *late])
        shared = next((n for n, e in factors.items() if e == 1 and self._is_quotient(n)), None) if c != 1 else None
        if shared is not None:
            top.remove(self.value(1, shared))
            return self._multiplied([*top, self.value(c, shared)])
        return self._scaled(c, top)

    def _is_quotient(self, node: int) -> bool:
        """Return True if a node is a constant divided by a value: the constant can take up another factor."""
        found = self.graph.nodes[node]
        return isinstance(found, Product) and all(e < 0 and n not in self._inverses for n, e in found.factors)

    def _power(self, base: int, e: Exact) -> list[int]:
        """Factors of a power of a node; the inverse of the node is a factor if several products divide by it."""
        x = self.value(1, base)
        if e < 0:
            exponents = self._inverses[base]
            if len(exponents) == 1:
                rest = [self.write("root", x)] if e.denominator == 2 else []
                quotient = self.write("divide", self.constant(1), self._whole_power(x, -int(e // 1)))
                return [self._multiplied([quotient, *rest])]
            if any(other.denominator == 2 for other in exponents):
                inverse = self.write("divide", self.constant(1), self.write("root", x))
                return [self._whole_power(inverse, int(-2 * e))]
            return [self._whole_power(self.write("divide", self.constant(1), x), int(-e))]
        whole = int(e)
        parts = [self._whole_power(x, whole)] if whole else []
        return [*parts, self.write("root", x)] if e.denominator == 2 else parts

    def _whole_power(self, x: int, exponent: int) -> int:
        if exponent == 1:
            return x
        if exponent % 2:
            return self.write("multiply", self._whole_power(x, exponent - 1), x)
        half = self._whole_power(x, exponent // 2)
        return self.write("multiply", half, half)

    def _scaled(self, c: Exact, factors: list[int]) -> int:
        """Return ``c`` times a product; the constant joins the factor that is ready first."""
        if not factors:
            return self.constant(c)
        if c == 1:
            return self._multiplied(factors)
        if abs(c) != 1:
            return self._multiplied([*factors, self.constant(c)])
        first, *rest = sorted(factors, key=self.ready.__getitem__)
        return self._multiplied([self.write("negate", first), *rest])

    def _multiplied(self, factors: list[int]) -> int:
        """Return a product: each multiplication takes the two factors that are ready first."""
        left = [(self.ready[x], i, x) for i, x in enumerate(factors)]
        heapify(left)
        while len(left) > 1:
            (_, i, a), (_, _, b) = heappop(left), heappop(left)
            product = self.write("multiply", a, b)
            heappush(left, (self.ready[product], i, product))
        return left[0][2]


# --- Expressions as polynomials: expansion where it takes fewer operations, and degree in some variables.

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
    """A bound on the degree of the polynomial before cancellation; 3 for all larger degrees and other functions."""
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
