"""Expressions of formulas: exact numbers, a graph of nodes, derivatives, and sizes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

from nearharmonic.core.number import FUNCTIONS, Constant, FormulaError, Number

# --- Nodes of expressions, and their exact numbers.

#: An exact number. Integers are of type ``int``, whose arithmetic is faster.
Exact = int | Fraction


def exact(value: Fraction | int) -> Exact:
    """Return ``value`` as an int if it is an integer."""
    return value.numerator if value.denominator == 1 else Fraction(value.numerator, value.denominator)


def modulus(value: Exact) -> Exact:
    return value if value >= 0 else -value


class Variable(NamedTuple):
    """An argument of a formula, by its position."""

    place: int


class Literal(NamedTuple):
    """An exact constant as an operand of a function."""

    value: Exact


class Sum(NamedTuple):
    """``constant`` + sum of coefficient * node over ``terms``, sorted by node."""

    constant: Exact
    terms: tuple[tuple[int, Exact], ...]


class Product(NamedTuple):
    """Product of node ** exponent over ``factors``, sorted by node; exponents are integers or half-integers."""

    factors: tuple[tuple[int, Exact], ...]


class Application(NamedTuple):
    """A function of :data:`~nearharmonic.core.number.FUNCTIONS`, ``abs`` or ``sign``, of nodes."""

    function: str
    operands: tuple[int, ...]


Node = Variable | Literal | Sum | Product | Application


class Value(NamedTuple):
    """``coefficient`` times a node, or the coefficient alone if ``node`` is None."""

    coefficient: Exact
    node: int | None


ZERO, ONE = Value(0, None), Value(1, None)


def children(node: Node) -> Iterable[int]:
    if isinstance(node, Sum):
        return (child for child, _ in node.terms)
    if isinstance(node, Product):
        return (child for child, _ in node.factors)
    return node.operands if isinstance(node, Application) else ()


# --- Expressions of formulas: a directed acyclic graph in which equal subexpressions are one node.
#
# A formula that is called with the variables of a :class:`Graph` records its operations there. Nodes are tuples in a
# list and refer to earlier nodes by their index. Nodes can therefore be evaluated in the order of the list, and a
# deep formula does not reach Python's recursion limit. Every value is a coefficient times a node. A node has no
# constant factor, and the first coefficient of a sum is positive, so that a - b and b - a share a node.

#: Largest number of nodes: enough for three hundred bodies, which take half a minute and 650 megabytes to compile.
MOST_NODES = 500_000
#: Largest power of a coefficient that is computed.
MOST_POWER = 64


class Graph:
    """The nodes of some formulas, and the arithmetic of values."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self._places: dict[tuple[Any, ...], int] = {}

    def variables(self, count: int) -> tuple[Expression, ...]:
        return tuple(Expression(self, Value(1, self.place(Variable(i)))) for i in range(count))

    def place(self, node: Node) -> int:
        """Return the index of ``node``, which is appended if no node is equal to it and there is room."""
        key = (type(node), *node)
        found = self._places.get(key)
        if found is None:
            if len(self.nodes) >= MOST_NODES:
                raise FormulaError(f"takes more than {MOST_NODES} different operations")
            found = self._places[key] = len(self.nodes)
            self.nodes.append(node)
        return found

    def node_of(self, value: Value) -> int:
        """Return a node for a value with its coefficient, as an operand of a function."""
        if value.node is None:
            return self.place(Literal(value.coefficient))
        return value.node if value.coefficient == 1 else self.place(Sum(0, ((value.node, value.coefficient),)))

    def combination(self, constant: Exact, terms: dict[int, Exact]) -> Value:
        """Return ``constant`` + sum of coefficient * node."""
        left = sorted((node, c) for node, c in terms.items() if c)
        if not left:
            return Value(constant, None)
        if len(left) == 1 and not constant:
            return self.times(left[0][1], Value(1, left[0][0]))
        if left[0][1] < 0:
            left = [(node, -c) for node, c in left]
            return Value(-1, self.place(Sum(-constant, tuple(left))))
        return Value(1, self.place(Sum(constant, tuple(left))))

    def total(self, values: Iterable[Value]) -> Value:
        """Return the sum of values as one node."""
        constant: Exact = 0
        terms: dict[int, Exact] = {}
        for c, node in values:
            if node is None:
                constant = exact(constant + c)
            else:
                terms[node] = exact(terms.get(node, 0) + c)
        return self.combination(constant, terms)

    def terms(self, value: Value) -> tuple[Exact, dict[int, Exact]]:
        """Return the constant and the terms of a value; a sum is split into its terms."""
        c, node = value
        if node is None:
            return c, {}
        found = self.nodes[node]
        if isinstance(found, Sum):
            return exact(c * found.constant), {n: exact(c * factor) for n, factor in found.terms}
        return 0, {node: c}

    def add(self, a: Value, b: Value) -> Value:
        """Return a + b. If a or b is a sum, it stays a node of its own unless terms cancel or can be collected."""
        (constant_a, terms_a), (constant_b, terms_b) = self.terms(a), self.terms(b)
        merged = _collected(terms_a, terms_b)
        if a.node is not None and b.node is not None:
            if a.node == b.node:
                c = exact(a.coefficient + b.coefficient)
                return Value(c, a.node) if c else ZERO
            # Terms are joined only if that takes fewer operations: a sum such as the distance of two coordinates may be
            # small while its terms are large, and (x - y) - (z - x) is more accurate than 2 x - y - z.
            if sum(map(bool, merged.values())) > max(len(terms_a), len(terms_b)):
                return self.combination(0, {a.node: a.coefficient, b.node: b.coefficient})
        return self.combination(exact(constant_a + constant_b), merged)

    def times(self, factor: Exact, value: Value) -> Value:
        """Return an exact multiple of ``value``; the factor of a single term becomes part of the coefficient."""
        c, node = exact(factor * value.coefficient), value.node
        if not c or node is None:
            return Value(c, None)
        found = self.nodes[node]
        if isinstance(found, Sum) and len(found.terms) == 1 and not found.constant:
            return Value(exact(c * found.terms[0][1]), found.terms[0][0])
        return Value(c, node)

    def factors(self, node: int) -> dict[int, Exact]:
        """Return the factors of the product ``node``, as powers of nodes."""
        found = self.nodes[node]
        return dict(found.factors) if isinstance(found, Product) else {node: 1}

    def product_of(self, factors: dict[int, Exact]) -> Value:
        """Return the product of node ** exponent."""
        self._join_moduli(factors)
        left = sorted((node, e) for node, e in factors.items() if e)
        if not left:
            return ONE
        return Value(1, left[0][0] if len(left) == 1 and left[0][1] == 1 else self.place(Product(tuple(left))))

    def _join_moduli(self, factors: dict[int, Exact]) -> None:
        """Replace |x| sign(x) by x, which needs neither."""
        for node in tuple(factors):
            found = self.nodes[node]
            if isinstance(found, Application) and found.function == "sign" and factors[node] == 1:
                modulus = self._places.get((Application, "abs", found.operands))
                if modulus is not None and factors.get(modulus, 0) >= 1:
                    (x,) = found.operands
                    del factors[node]
                    factors[modulus] = exact(factors[modulus] - 1)
                    factors[x] = exact(factors.get(x, 0) + 1)

    def multiply(self, a: Value, b: Value) -> Value:
        """Return a b. If a or b is a product, it stays a node of its own unless both share a factor."""
        c = exact(a.coefficient * b.coefficient)
        if a.node is None or b.node is None or not c:
            return self.times(c, Value(1, b.node if a.node is None else a.node)) if c else ZERO
        merged, more = self.factors(a.node), self.factors(b.node)
        if merged.keys().isdisjoint(more) and not self._is_sign(a.node) and not self._is_sign(b.node):
            merged, more = {a.node: 1}, {b.node: 1}
        return self.times(c, self.product_of(_collected(merged, more)))

    def _is_sign(self, node: int) -> bool:
        found = self.nodes[node]
        return isinstance(found, Application) and found.function == "sign"

    def power(self, value: Value, exponent: Exact) -> Value:
        """Return a value that is not constant to an integer or half-integer power.

        The root of a square is not simplified: it is a modulus.
        """
        c, node = value
        if node is None:
            node = self.place(Literal(c))
            c = 1
        whole = exponent.denominator == 1
        root: Exact | None = c if whole else _root(c)
        if root is None or modulus(exponent) > MOST_POWER:
            c, node = 1, self.node_of(value)
            root = 1
        scale = exact(Fraction(root) ** (int(exponent) if whole else int(2 * exponent)))
        # (b^e)^k = b^(e k) for integers k; a product stays one factor, which others may share.
        factors = self.factors(node)
        if whole and len(factors) == 1:
            ((base, e),) = factors.items()
            return self.times(scale, self.product_of({base: exact(e * exponent)}))
        return self.times(scale, self.product_of({node: exponent}))

    def apply(self, function: str, *operands: Value) -> Value:
        if function == "pow" and operands[1].node is None and operands[1].coefficient.denominator <= 2:
            return self.power(operands[0], operands[1].coefficient) if operands[1].coefficient else ONE
        return Value(1, self.place(Application(function, tuple(map(self.node_of, operands)))))

    def reachable(self, roots: Iterable[Value]) -> list[int]:
        """Return the nodes that ``roots`` need, ascending: each node comes after the nodes that it refers to."""
        found, pending = set(), [root.node for root in roots if root.node is not None]
        while pending:
            node = pending.pop()
            if node not in found:
                found.add(node)
                pending.extend(children(self.nodes[node]))
        return sorted(found)


def _collected(a: dict[int, Exact], b: dict[int, Exact]) -> dict[int, Exact]:
    merged = dict(a)
    for node, c in b.items():
        merged[node] = exact(merged.get(node, 0) + c)
    return merged


def _root(c: Exact) -> Exact | None:
    """The square root of the square of a fraction, or None."""
    if c <= 0:
        return None
    root = Constant(c).sqrt() if c != 1 else Constant(1)
    return exact(root) if root * root == c else None


class Expression(Number):
    """A value of a :class:`Graph` as a number of formulas."""

    __slots__ = ("graph", "value")

    def __init__(self, graph: Graph, value: Value) -> None:
        self.graph, self.value = graph, value

    def _made(self, value: Value) -> Any:
        return Constant(value.coefficient) if value.node is None else Expression(self.graph, value)

    def _operand(self, other: Any) -> Any:
        if isinstance(other, Expression) and other.graph is not self.graph:
            raise FormulaError("uses a value of an earlier call: a formula must keep none")
        return super()._operand(other)

    def lifted(self, number: Constant) -> Expression:
        return Expression(self.graph, value_of(number))

    def _add(self, other: Expression | Constant) -> Any:
        return self._made(self.graph.add(self.value, value_of(other)))

    def _multiply(self, other: Expression | Constant) -> Any:
        return self._made(self.graph.multiply(self.value, value_of(other)))

    def _divide(self, other: Expression | Constant) -> Any:
        if isinstance(other, Constant):
            return self._multiply(1 / other)
        return self._made(self.graph.multiply(self.value, self.graph.power(other.value, -1)))

    def __neg__(self) -> Any:
        return self._made(self.graph.times(-1, self.value))

    def __abs__(self) -> Any:
        c, node = self.value
        return self._made(self.graph.times(modulus(c), self.graph.apply("abs", Value(1, node))))

    def whole_power(self, exponent: int) -> Any:
        return self._made(self.graph.power(self.value, exponent))

    def sqrt(self) -> Any:
        return self._made(self.graph.power(self.value, Fraction(1, 2)))

    def apply(self, function: str, *others: Any) -> Any:
        given, expected = len(others) + 1, len(FUNCTIONS[function])
        if given != expected:
            raise FormulaError(f"calls {function} with {given} arguments, expected {expected}")
        return self._made(self.graph.apply(function, self.value, *map(value_of, others)))


def value_of(number: Expression | Constant) -> Value:
    """Return the value of the result of a formula."""
    return number.value if isinstance(number, Expression) else Value(exact(number), None)


def displacements(graph: Graph, roots: Sequence[Value]) -> frozenset[int]:
    """Return the sums of variables and constants in ``roots``: such a sum may be small while its terms are large."""
    return frozenset(
        i
        for i in graph.reachable(roots)
        if isinstance(found := graph.nodes[i], Sum)
        and (len(found.terms) > 1 or found.constant)
        and all(isinstance(graph.nodes[node], Variable) for node, _ in found.terms)
    )


# --- Derivatives of expressions: the gradient in reverse mode, and the Hessian times a vector.
#
# In reverse mode a gradient takes a small multiple of the operations of the formula, for any number of variables.
# Source: Griewank & Walther, Evaluating Derivatives (2008), doi:10.1137/1.9780898717761, Sections 3.2 and 5.2.


def gradient(graph: Graph, root: Value, variables: Sequence[Value]) -> tuple[Value, ...]:
    """Return the derivatives of ``root`` with respect to ``variables``, in reverse mode."""
    adjoints: dict[int, Value] = {} if root.node is None else {root.node: Value(root.coefficient, None)}
    for node in reversed(graph.reachable([root])):
        adjoint = adjoints.get(node, ZERO)
        if adjoint.coefficient:
            for child, partial in _partials(graph, node):
                share = graph.multiply(adjoint, partial)
                adjoints[child] = graph.add(adjoints[child], share) if child in adjoints else share
    return tuple(adjoints.get(v.node, ZERO) for v in variables if v.node is not None)


def hessian_vector(
    graph: Graph, root: Value, variables: Sequence[Value], directions: Sequence[Value]
) -> tuple[Value, ...]:
    """Return the Hessian of ``root`` times ``directions``: the gradient of the directional derivative."""
    slope = ZERO
    for derivative, direction in zip(gradient(graph, root, variables), directions, strict=True):
        slope = graph.add(slope, graph.multiply(derivative, direction))
    return gradient(graph, slope, variables)


def _partials(graph: Graph, node: int) -> list[tuple[int, Value]]:
    """The derivatives of a node with respect to its children."""
    found = graph.nodes[node]
    if isinstance(found, Sum):
        return [(child, Value(c, None)) for child, c in found.terms]
    if isinstance(found, Product):
        return [(child, _lowered(graph, dict(found.factors), child, e)) for child, e in found.factors]
    if not isinstance(found, Application):
        return []
    if found.function in ("abs", "sign"):
        (child,) = found.operands
        return [(child, graph.apply("sign", Value(1, child)) if found.function == "abs" else ZERO)]
    value, *operands = (_number(graph, one) for one in (node, *found.operands))
    slopes = zip(found.operands, FUNCTIONS[found.function], strict=True)
    # A function of the same node twice, such as hypot(x, x), has two partial derivatives for it.
    return [
        (child, value_of(slope(value, *operands)))
        for child, slope in slopes
        if not isinstance(graph.nodes[child], Literal)
    ]


def _lowered(graph: Graph, factors: dict[int, Exact], child: int, e: Exact) -> Value:
    factors[child] = exact(e - 1)
    return graph.times(e, graph.product_of(factors))


def _number(graph: Graph, node: int) -> Expression:
    found = graph.nodes[node]
    value = Value(found.value, None) if isinstance(found, Literal) else graph.times(1, Value(1, node))
    return Expression(graph, value)


# --- Size of expressions in operations: the limit above which they become loops, and the largest size.

#: Coordinates and operations up to which a kernel has no loops over coordinates. It takes 5 to 20 ms per operation to
#: compile; larger formulas become loops.
MOST_UNROLLED, MOST_OPERATIONS_UNROLLED = 50, 1000
#: Largest number of operations of a kernel of loops, each pattern counted once.
MOST_OPERATIONS = 4000
#: Number of operations that take as long to compile as one function.
OPERATIONS_OF_A_FUNCTION = 10


def operations(graph: Graph, roots: Sequence[Value]) -> int:
    return sum(_operations(graph.nodes[node]) for node in graph.reachable(roots))


def operations_of(name: str) -> int:
    """Return the weight of an operation of this name, in operations."""
    return OPERATIONS_OF_A_FUNCTION if name in FUNCTIONS else 1


def becomes_loops(dimension: int, operations: int) -> bool:
    """Return True if a formula of so many coordinates and operations is compiled as loops."""
    return dimension > MOST_UNROLLED or operations > MOST_OPERATIONS_UNROLLED


def check_size(operations: int) -> None:
    """Raise a FormulaError for formulas of more than :data:`MOST_OPERATIONS`."""
    if operations > MOST_OPERATIONS:
        raise FormulaError(
            f"takes {operations} operations, a function counted as {OPERATIONS_OF_A_FUNCTION} and terms of one form "
            f"once: at most {MOST_OPERATIONS} are compiled, which takes about a minute"
        )


def _operations(node: Node) -> int:
    if isinstance(node, Sum):
        return len(node.terms)
    if isinstance(node, Product):
        return len(node.factors)
    return operations_of(node.function) if isinstance(node, Application) else 1
