"""Linear stability: for which step sizes an integrator keeps the harmonic oscillator bounded.

A symmetric step has K11 = K22 and det K = 1, hence (tr K / 2)^2 - 1 = K12 K21: the trace leaves [-2, 2] where K12 K21
becomes positive. Both entries are odd polynomials in tau. Their roots are counted by Sturm's theorem and narrowed down
by bisection, so that gaps of any narrowness are found.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm
from typing import Any

from mpmath import inf, mp, mpf, sqrt

from nearharmonic.decomposition import step_polynomials, tableau_of
from nearharmonic.tableau import First, Tableau

#: Digits of the edges that are returned.
EDGE_DIGITS = 30

#: Whole coefficients of x^0, x^1, ..., x = tau^2; a positive factor does not matter.
Polynomial = list[int]


def stability_gaps(integrator: str | Tableau, *, first: First | None = None) -> list[tuple[Any, Any]]:
    """The intervals (start, end) of step sizes with |tr K| > 2, in ascending order, as mpf to 30 digits.

    The last one ends at infinity. Where the trace only touches 2 there is no interval.

    Raises:
        UnknownNameError: no integrator has this name.
        SettingError: ``first`` is no operator.
    """
    K = step_polynomials(tableau_of(integrator, first))
    entries = [_whole(entry[1::2]) for entry in (K.K12, K.K21)]
    edges = sorted(edge for entry in entries for edge in _positive_roots(entry))
    gaps: list[tuple[Any, Any]] = []
    with mp.workdps(EDGE_DIGITS):
        for start, end in [*pairwise(edges), (edges[-1], None)]:
            inside = start + 1 if end is None else (start + end) / 2
            if start != end and _sign(entries[0], inside) * _sign(entries[1], inside) > 0:
                gaps.append((_square_root(start), inf if end is None else _square_root(end)))
    return gaps


def stability_limit(integrator: str | Tableau, *, first: First | None = None) -> Any:
    """The step size up to which every smaller one is stable: where the first gap opens, as mpf to 30 digits.

    Raises:
        UnknownNameError: no integrator has this name.
        SettingError: ``first`` is no operator.
    """
    return stability_gaps(integrator, first=first)[0][0]


def stability_end(integrator: str | Tableau, *, first: First | None = None) -> Any:
    """The step size beyond which no larger one is stable: where the last gap opens, as mpf to 30 digits.

    Raises:
        UnknownNameError: no integrator has this name.
        SettingError: ``first`` is no operator.
    """
    return stability_gaps(integrator, first=first)[-1][0]


def _positive_roots(polynomial: Polynomial) -> list[Fraction]:
    """The distinct roots above 0, ascending, each to a relative 2^-110 below or at its true value."""
    if len(polynomial) == 1:
        return []
    chain = _sturm_chain(polynomial)
    bound = 1 + max(abs(c) for c in polynomial[:-1]) // abs(polynomial[-1]) + 1  # Cauchy's, on all roots
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
    crosses = _sign(chain[0], low) * _sign(chain[0], high) < 0
    while (high - low) * 2**110 > low:
        middle = (low + high) / 2
        if crosses:
            below = _sign(chain[0], low) != _sign(chain[0], middle)
        else:
            below = _sign_changes(chain, low) != _sign_changes(chain, middle)
        low, high = (low, middle) if below else (middle, high)
    return low


def _sturm_chain(polynomial: Polynomial) -> list[Polynomial]:
    chain = [polynomial, _primitive([n * c for n, c in enumerate(polynomial)][1:])]
    while len(chain[-1]) > 1:
        rest, divisor = list(chain[-2]), chain[-1]
        while len(rest) >= len(divisor):
            # Multiplied by a positive number, so that the quotient is whole and no sign is changed.
            factor, sign, shift = abs(divisor[-1]), (divisor[-1] > 0) - (divisor[-1] < 0), len(rest) - len(divisor)
            top = sign * rest[-1]
            rest = [factor * c - top * (divisor[n - shift] if n >= shift else 0) for n, c in enumerate(rest)][:-1]
        rest = _without_high_zeros(rest)
        if not rest:
            break
        chain.append(_primitive([-c for c in rest]))
    return chain


def _sign_changes(chain: Sequence[Polynomial], x: Fraction) -> int:
    signs = [sign for sign in (_sign(link, x) for link in chain) if sign]
    return sum(a != b for a, b in pairwise(signs))


def _sign(polynomial: Polynomial, x: Fraction) -> int:
    """Sign of the polynomial at ``x``, by Horner's rule in whole numbers."""
    total, scale = 0, 1
    for coefficient in reversed(polynomial):
        total = total * x.numerator + coefficient * scale
        scale *= x.denominator
    return (total > 0) - (total < 0)


def _whole(row: Sequence[Fraction]) -> Polynomial:
    """``row`` times its common denominator."""
    unit = lcm(*(c.denominator for c in row))
    return _primitive(_without_high_zeros([int(c * unit) for c in row]))


def _primitive(row: Sequence[int]) -> Polynomial:
    common = gcd(*row)
    return [c // common for c in row]


def _without_high_zeros(row: Sequence[int]) -> Polynomial:
    kept = list(row)
    while kept and kept[-1] == 0:
        kept.pop()
    return kept


def _square_root(x: Fraction) -> Any:
    return sqrt(mpf(x.numerator) / x.denominator)
