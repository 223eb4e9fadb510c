"""Sparse polynomials in several variables with rational coefficients, and power series with such coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TypeVar

Key = TypeVar("Key")
#: Exponents of a monomial in y_1, ..., y_k.
Monomial = tuple[int, ...]
Multivariate = dict[Monomial, Fraction]
#: Coefficients of x^0, x^1, ...
PowerSeries = list[Multivariate]


def add(p: dict[Key, Fraction], q: dict[Key, Fraction], factor: Fraction | int = 1) -> dict[Key, Fraction]:
    """p + factor q, without zeros; also for sparse vectors by index."""
    total = dict(p)
    for monomial, c in q.items():
        value = total.get(monomial, Fraction(0)) + factor * c
        if value:
            total[monomial] = value
        else:
            total.pop(monomial, None)
    return total


def times(p: Multivariate, q: Multivariate) -> Multivariate:
    """p q."""
    total: Multivariate = {}
    for m, c in p.items():
        for n, d in q.items():
            key = tuple(a + b for a, b in zip(m, n, strict=True))
            total[key] = total.get(key, Fraction(0)) + c * d
    return {m: c for m, c in total.items() if c}


def product(p: PowerSeries, q: PowerSeries, length: int) -> PowerSeries:
    """The first ``length`` coefficients of p q."""
    total: PowerSeries = [{} for _ in range(length)]
    for i, a in enumerate(p[:length]):
        for j, b in enumerate(q[: length - i]):
            total[i + j] = add(total[i + j], times(a, b))
    return total


def inverse(p: PowerSeries, length: int) -> PowerSeries:
    """The first ``length`` coefficients of 1/p, if the first coefficient of ``p`` is 1."""
    total: PowerSeries = [p[0]]
    for i in range(1, length):
        value: Multivariate = {}
        for j in range(1, min(i + 1, len(p))):
            value = add(value, times(p[j], total[i - j]), -1)
        total.append(value)
    return total


def constants(numbers: Sequence[Fraction], variables: int) -> PowerSeries:
    """The series with these numbers as coefficients, which are polynomials in ``variables`` variables."""
    return [{(0,) * variables: c} if c else {} for c in numbers]


def variable(i: int, variables: int) -> Multivariate:
    """y_(i+1)."""
    return {tuple(int(j == i) for j in range(variables)): Fraction(1)}
