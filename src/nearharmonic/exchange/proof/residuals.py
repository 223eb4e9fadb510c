"""Exact residuals of the order conditions of a step, and their bounds due to the digits of its coefficients.

Let c be the coefficients of a file. Each differs by at most u_i, a few units of its last digit, from the number that
its author rounded. One coefficient of each row may in addition have been changed to make the sum of the row exact, by
at most the sum of the u_i of the row. A condition of degree n is a polynomial r(c) of degree n, and with g_i = dr/dc_i

    |r(c) - r(true c)|  <=  sum_i |g_i| u_i  +  sum_rows max |g_i| sum u_i  +  2 U^2 d^2/dM^2 [f_n M^n]  at M + 2 U,

with M the sum of all |c_i| and U that of all u_i. This is Taylor's formula. The second derivative is bounded by
replacing every term of log(product of exponentials) by its absolute value; f_n = [x^n] (-log(2 - e^x)). The true
coefficients fulfil a condition only if |r(c)| is within this bound. A larger residual therefore proves that no
coefficients that round to the given ones fulfil the condition. A residual within the bound is zero to the given digits;
more cannot be concluded from them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np

from nearharmonic.exact.lie.conditions import conditions, lyndon_words
from nearharmonic.exact.step import Step
from nearharmonic.exact.words import LETTERS, logarithm_slopes
from nearharmonic.exchange.composition import is_palindrome, size_of, uncertainty_of
from nearharmonic.integrators.order_conditions import errors_on_words, weighted

#: Addition to the bound for the rounding errors of derivatives in double precision, relative to the bound of the
#: derivatives.
ROUNDING = Fraction(1, 10**9)


class Residual(NamedTuple):
    """The value of a condition of ``degree`` in tau, and its bound by the digits of the coefficients; both exact."""

    degree: int
    value: Fraction
    allowed: Fraction

    @property
    def vanishes(self) -> bool:
        """True if the value is zero to the digits given."""
        return abs(self.value) <= self.allowed


class Order(NamedTuple):
    """An order, the first residual that fails (None if all examined conditions hold), and the largest that vanishes.

    The largest residual is in units of its bound.
    """

    order: int
    failing: Residual | None
    largest: Residual


def proved_order(step: Step, highest: int, *, quadratic: bool, potential_degree: int | None = None) -> Order:
    """Return the order of a step for every separable H, or for every H with quadratic T; at most ``highest``.

    Parameters
    ----------
    step : tuple of (str, Printed)
        Drifts and kicks.
    highest : int
        Highest degree of the examined conditions.
    quadratic : bool
        True for T = p.p/2.
    potential_degree : int, optional
        Degree of V, for T = p.p/2; None is for every V.
    """
    largest = Residual(1, Fraction(0), Fraction(0))
    for degree in range(1, highest + 1):
        found = residuals(step, degree, quadratic=quadratic, potential_degree=potential_degree)
        failing = [one for one in found if not one.vanishes]
        if failing:
            return Order(degree - 1, max(failing, key=lambda one: abs(one.value)), largest)
        largest = max([largest, *found], key=lambda one: abs(one.value) / one.allowed if one.allowed else 0)
    return Order(highest, None, largest)


def residuals(step: Step, degree: int, *, quadratic: bool, potential_degree: int | None = None) -> list[Residual]:
    """Return the residual of each condition of ``degree``.

    A palindrome with step -tau is the inverse of the step with tau, so that its conditions of even degree hold.
    """
    rows = conditions(degree, quadratic=quadratic, potential_degree=potential_degree)
    if degree % 2 == 0 and is_palindrome(step, exactly=True):
        return [Residual(degree, Fraction(0), Fraction(0)) for _ in rows]
    errors = errors_on_words(step, degree)
    weights = [row.weights for row in rows]
    allowed = allowances(step, degree, weights)
    return [Residual(degree, weighted(w, errors), most) for w, most in zip(weights, allowed, strict=True)]


def allowances(step: Step, degree: int, weights: Sequence[Sequence[Fraction]]) -> list[Fraction]:
    """Return the bound, due to the digits, of the error of each weighted sum of coefficients on Lyndon words."""
    total = uncertainty_of(step)
    if total == 0:
        return [Fraction(0)] * len(weights)
    size = size_of(step)
    slack = ROUNDING * total * degree * majorant(degree) * size ** (degree - 1)
    slack += 2 * total**2 * degree * (degree - 1) * majorant(degree) * (size + 2 * total) ** max(degree - 2, 0)
    return [linear_allowance(step, row) + slack for row in _gradients(step, degree, weights)]


def linear_allowance(step: Step, gradient: Iterable[float]) -> Fraction:
    """Return the bound, due to the digits, of the first-order error of a function with this ``gradient``."""
    slopes = [abs(Fraction(float(g))) for g in gradient]
    single = sum((g * c.uncertainty for g, (_, c) in zip(slopes, step, strict=True)), Fraction(0))
    for letter in LETTERS:
        row = [(g, c.uncertainty) for g, (x, c) in zip(slopes, step, strict=True) if x == letter]
        single += max((g for g, _ in row), default=Fraction(0)) * sum((u for _, u in row), Fraction(0))
    return single


def _gradients(step: Step, degree: int, weights: Sequence[Sequence[Fraction]]) -> np.ndarray:
    """Return the derivatives (weights, flows) of the weighted sums by the coefficients, in double precision."""
    slopes = logarithm_slopes([(letter, float(c)) for letter, c in step], lyndon_words(degree))
    result: np.ndarray = np.array(weights, dtype=float) @ np.stack(list(slopes.values()))
    return result


@cache
def majorant(degree: int) -> Fraction:
    """Return f_n, the coefficient of x^n in -log(2 - e^x), n >= 1."""
    # Its derivative is e^x / (2 - e^x) = 2 / (2 - e^x) - 1, and 1 / (2 - e^x) generates the Fubini numbers.
    return Fraction((2 if degree > 1 else 1) * _fubini(degree - 1), factorial(degree))


@cache
def _fubini(n: int) -> int:
    return 1 if n == 0 else sum(comb(n, k) * _fubini(n - k) for k in range(1, n + 1))
