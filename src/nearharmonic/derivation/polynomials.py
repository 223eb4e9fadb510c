"""Sparse polynomials with rational coefficients, power series of them, and real roots counted by Sturm's theorem."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm

#: Exponents of a monomial in y_1, ..., y_k.
Monomial = tuple[int, ...]
Polynomial = dict[Monomial, Fraction]
#: Coefficients of x^0, x^1, ...
Series = list[Polynomial]
#: A polynomial in one variable with integer coefficients, lowest power first.
Univariate = list[int]


def add(p: Polynomial, q: Polynomial, factor: Fraction | int = 1) -> Polynomial:
    """p + factor q."""
    total = dict(p)
    for monomial, c in q.items():
        value = total.get(monomial, Fraction(0)) + factor * c
        if value:
            total[monomial] = value
        else:
            total.pop(monomial, None)
    return total


def times(p: Polynomial, q: Polynomial) -> Polynomial:
    """p q."""
    total: Polynomial = {}
    for m, c in p.items():
        for n, d in q.items():
            key = tuple(a + b for a, b in zip(m, n, strict=True))
            total[key] = total.get(key, Fraction(0)) + c * d
    return {m: c for m, c in total.items() if c}


def product(p: Series, q: Series, length: int) -> Series:
    """The first ``length`` coefficients of p q."""
    total: Series = [{} for _ in range(length)]
    for i, a in enumerate(p[:length]):
        for j, b in enumerate(q[: length - i]):
            total[i + j] = add(total[i + j], times(a, b))
    return total


def inverse(p: Series, length: int) -> Series:
    """The first ``length`` coefficients of 1/p, for a ``p`` that starts with 1."""
    total: Series = [p[0]]
    for i in range(1, length):
        value: Polynomial = {}
        for j in range(1, min(i + 1, len(p))):
            value = add(value, times(p[j], total[i - j]), -1)
        total.append(value)
    return total


def constants(numbers: Sequence[Fraction], variables: int) -> Series:
    """The series with these numbers as coefficients, among polynomials in ``variables`` variables."""
    return [{(0,) * variables: c} if c else {} for c in numbers]


def variable(i: int, variables: int) -> Polynomial:
    """y_(i+1)."""
    return {tuple(int(j == i) for j in range(variables)): Fraction(1)}


def integral(numbers: Sequence[Fraction]) -> Univariate:
    """The multiple of a rational polynomial that has integer coefficients without a common factor."""
    unit = lcm(*(c.denominator for c in numbers))
    return _primitive([int(c * unit) for c in numbers])


def sturm_chain(p: Univariate) -> list[Univariate]:
    """p, its derivative and the negated remainders: ends with a constant if and only if p has no multiple root."""
    chain = [_primitive(p), _primitive([n * c for n, c in enumerate(p)][1:])]
    while len(chain[-1]) > 1:
        remainder, divisor = list(chain[-2]), chain[-1]
        while len(remainder) >= len(divisor):
            # Scaled by a positive number only: the sign of the remainder is what counts.
            factor, shift = remainder[-1] * (1 if divisor[-1] > 0 else -1), len(remainder) - len(divisor)
            remainder = [abs(divisor[-1]) * c for c in remainder]
            for n, c in enumerate(divisor):
                remainder[shift + n] -= factor * c
            while remainder and remainder[-1] == 0:
                remainder.pop()
        if not remainder:
            break
        chain.append(_primitive([-c for c in remainder]))
    return chain


def real_roots(p: Univariate, precision: int) -> list[Fraction]:
    """Each distinct real root of ``p`` within 2^-precision, ascending: isolated by Sturm's theorem, then bisected."""
    chain = sturm_chain(p)
    # Cauchy: every root is smaller than 1 + max |c_i / c_n|.
    bound = Fraction(2 + max(map(abs, p)) // abs(p[-1]))
    roots, open_intervals = [], [(-bound, bound, _changes(chain, -bound), _changes(chain, bound))]
    while open_intervals:
        low, high, before, after = open_intervals.pop()
        if before == after:
            continue
        if before - after == 1:
            roots.append(_bisected(p, low, high, precision))
            continue
        middle = (low + high) / 2
        at_middle = _changes(chain, middle)
        open_intervals += [(low, middle, before, at_middle), (middle, high, at_middle, after)]
    return sorted(roots)


def _bisected(p: Univariate, low: Fraction, high: Fraction, precision: int) -> Fraction:
    """The one root in (low, high], a simple one of a polynomial without multiple roots."""
    end = _sign(p, high)
    while end and high - low > Fraction(1, 2**precision):
        middle = (low + high) / 2
        sign = _sign(p, middle)
        if sign == 0:
            return middle
        low, high = (low, middle) if sign == end else (middle, high)
    return (low + high) / 2 if end else high


def _sign(p: Univariate, x: Fraction) -> int:
    """Sign of p(x), by Horner's rule in integers."""
    value, power = 0, 1
    for c in reversed(p):
        value = value * x.numerator + c * power
        power *= x.denominator
    return (value > 0) - (value < 0)


def _changes(chain: Sequence[Univariate], x: Fraction) -> int:
    """Sign changes along a Sturm chain at x, zeros left out."""
    signs = [s for s in (_sign(p, x) for p in chain) if s]
    return sum(a != b for a, b in pairwise(signs))


def _primitive(p: Univariate) -> Univariate:
    divisor = gcd(*p) or 1
    return [c // divisor for c in p]
