"""Real roots of polynomials with whole coefficients: counted by Sturm's theorem, narrowed down by bisection, exactly.

A polynomial is the list of its coefficients of x^0, x^1, ..., the last one not 0. Sources: Sturm (1829); Yun (1976),
doi:10.1145/800205.806320, for multiple roots.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm

Polynomial = list[int]

#: Roots are narrowed down to a relative 2^-NARROW_BITS.
NARROW_BITS = 110


def whole(row: Sequence[Fraction]) -> Polynomial:
    """``row`` times the least positive number that makes it whole; [] for a row of zeros."""
    unit = lcm(*(c.denominator for c in row))
    return _primitive(_without_high_zeros([int(c * unit) for c in row]))


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """a b."""
    terms = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            terms[i + j] += x * y
    return terms


def derivative(polynomial: Polynomial) -> Polynomial:
    """d/dx, times a positive number; [] for a constant."""
    return _primitive([n * c for n, c in enumerate(polynomial)][1:])


def sign_at(polynomial: Polynomial, x: Fraction) -> int:
    """Sign of the polynomial at ``x``, by Horner's rule in whole numbers."""
    total, scale = 0, 1
    for coefficient in reversed(polynomial):
        total = total * x.numerator + coefficient * scale
        scale *= x.denominator
    return (total > 0) - (total < 0)


def common_divisor(a: Polynomial, b: Polynomial) -> Polynomial:
    """The greatest common divisor of two polynomials, the second possibly [], as one with positive leading term."""
    divisor = _remainders(a, b)[-1] if b else a
    return divisor if divisor[-1] > 0 else [-c for c in divisor]


def by_parity(polynomial: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Two polynomials with simple roots: those at which ``polynomial`` changes sign, and those it only touches."""
    odd: Polynomial = [1]
    even: Polynomial = [1]
    common = common_divisor(polynomial, derivative(polynomial))
    rest, multiplicity = _quotient(polynomial, common), 1
    while len(rest) > 1:
        shared = common_divisor(rest, common)
        exactly = _quotient(rest, shared)  # the roots of this multiplicity and no higher one
        if multiplicity % 2:
            odd = product(odd, exactly)
        else:
            even = product(even, exactly)
        rest, common, multiplicity = shared, _quotient(common, shared), multiplicity + 1
    return odd, even


def positive_roots(polynomial: Polynomial) -> list[Fraction]:
    """The distinct roots above 0, ascending, each within a relative 2^-110 below its true value or at it."""
    if len(polynomial) == 1:
        return []
    chain = _remainders(polynomial, derivative(polynomial))
    bound = 2 + max(abs(c) for c in polynomial[:-1]) // abs(polynomial[-1])  # Cauchy's, on all roots
    waiting, roots = [(Fraction(0), Fraction(2) ** bound.bit_length())], []
    while waiting:
        low, high = waiting.pop()
        count = _sign_changes(chain, low) - _sign_changes(chain, high)
        if count == 1 and low > 0:
            roots.append(_narrowed(chain, low, high))
        elif count:
            middle = (low + high) / 2
            waiting += [(low, middle), (middle, high)]
    return sorted(roots)


def _narrowed(chain: Sequence[Polynomial], low: Fraction, high: Fraction) -> Fraction:
    """The one root in (low, high]: by signs of the polynomial alone where they differ, by all its chain elsewhere."""
    crosses = sign_at(chain[0], low) * sign_at(chain[0], high) < 0
    while (high - low) * 2**NARROW_BITS > low:
        middle = (low + high) / 2
        if crosses:
            below = sign_at(chain[0], low) != sign_at(chain[0], middle)
        else:
            below = _sign_changes(chain, low) != _sign_changes(chain, middle)
        low, high = (low, middle) if below else (middle, high)
    return low


def _sign_changes(chain: Sequence[Polynomial], x: Fraction) -> int:
    signs = [sign for sign in (sign_at(link, x) for link in chain) if sign]
    return sum(a != b for a, b in pairwise(signs))


def _remainders(a: Polynomial, b: Polynomial) -> list[Polynomial]:
    """Sturm's chain a, b, -(a mod b), ...; its last link divides both."""
    chain = [a, b]
    while len(chain[-1]) > 1:
        _, rest = _divided(chain[-2], chain[-1])
        if not rest:
            break
        chain.append(_primitive([-c for c in rest]))
    return chain


def _quotient(a: Polynomial, b: Polynomial) -> Polynomial:
    """a / b, which leaves no rest, times a positive number."""
    return _primitive(_divided(a, b)[0])


def _divided(a: Polynomial, b: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Quotient and rest of a positive multiple of ``a``, such that both are whole."""
    rest, quotient = list(a), [0] * max(1, len(a) - len(b) + 1)
    factor, sign = abs(b[-1]), (b[-1] > 0) - (b[-1] < 0)
    while len(rest) >= len(b):
        top, shift = sign * rest[-1], len(rest) - len(b)
        quotient = [factor * c for c in quotient]
        quotient[shift] += top
        rest = [factor * c - top * (b[n - shift] if n >= shift else 0) for n, c in enumerate(rest)][:-1]
    return quotient, _without_high_zeros(rest)


def _primitive(row: Sequence[int]) -> Polynomial:
    common = gcd(*row)
    return [c // common for c in row]


def _without_high_zeros(row: Sequence[int]) -> Polynomial:
    kept = list(row)
    while kept and kept[-1] == 0:
        kept.pop()
    return kept
