"""Nodes of expressions, and their exact numbers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

#: An exact number. Integers are of type ``int``, whose arithmetic is faster than that of ``Fraction``.
Exact = int | Fraction


def exact(value: Fraction | int) -> Exact:
    """Return ``value`` as an int if it is an integer."""
    return value.numerator if value.denominator == 1 else Fraction(value.numerator, value.denominator)


def modulus(value: Exact) -> Exact:
    """Return |value|."""
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
    """A function of :data:`~nearharmonic.core.formulas.number.FUNCTIONS`, ``abs`` or ``sign``, of nodes."""

    function: str
    operands: tuple[int, ...]


Node = Variable | Literal | Sum | Product | Application


class Value(NamedTuple):
    """``coefficient`` times a node, or the coefficient alone if ``node`` is None."""

    coefficient: Exact
    node: int | None


ZERO, ONE = Value(0, None), Value(1, None)


def children(node: Node) -> Iterable[int]:
    """Return the nodes that ``node`` refers to."""
    if isinstance(node, Sum):
        return (child for child, _ in node.terms)
    if isinstance(node, Product):
        return (child for child, _ in node.factors)
    return node.operands if isinstance(node, Application) else ()
