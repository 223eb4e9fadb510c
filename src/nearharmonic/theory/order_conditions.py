"""Order conditions of an integrator, checked on its printed coefficients in exact arithmetic.

A step is the product of exponentials of the operators of a tableau. The exact flow is exp(A + B), with the drift A and
the kick B. The logarithm of the step, A + B + error terms, is compared with A + B degree by degree. This gives the
order for all separable H (:mod:`nearharmonic.exact.words`, :mod:`nearharmonic.exact.lie`).

Printed coefficients fulfil an order condition only to their digits. If each of the m coefficients has an error of at
most 10^-digits, then the errors of the coefficients of the logarithm on words of n letters are at most

    m 10^-digits M^(n-1) [x^(n-1)] e^x / (2 - e^x)  <=  m 10^-digits M^(n-1) (3/2)^n

in total, where M is the sum of the absolute values of all coefficients. This is the first-order perturbation of log(1 +
X) with every term replaced by its absolute value. A condition counts as fulfilled if its residual is within this bound.
Coefficients with only a dozen digits may therefore seem to have a higher order than they have: their digits cannot show
a small violation.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from math import ceil, lcm

from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.step import Factor, Step, composed
from nearharmonic.exact.words import logarithm
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau

#: Order up to which methods are examined by default; the number of words doubles with each order.
HIGHEST = 8
#: Order up to which methods are examined if they declare it.
HIGHEST_DECLARED = 10


@lru_cache(maxsize=1024)
def tolerance(tableau: Tableau, degree: int) -> Fraction:
    """Return the tolerance of a condition of ``degree`` for the guaranteed digits: the bound above."""
    count = len(step_of(tableau)) if tableau.modified else 2 * tableau.stages + 1
    return count * Fraction(1, 10**tableau.digits) * _size(tableau) ** (degree - 1) * Fraction(3, 2) ** degree


@lru_cache(maxsize=256)
def _size(tableau: Tableau) -> Fraction:
    """Return the sum of all |coefficients|, plus a bound of the cubic root of the contribution of squares.

    With b the sum of 4 |m|, 4 the size of C, and c^3 = 40 b, exp(b x^3) has no larger coefficients than exp(c x) up to
    x^11, as (3 j)! / j! is less than 40^j for j <= 3.
    """
    step = step_of(tableau)
    plain, squares = (sum((abs(c) for x, c in step if x in letters), Fraction(0)) for letters in ("AB", "C"))
    return plain + Fraction(ceil(1000 * float(160 * squares) ** (1 / 3)), 1000)


def highest_of(tableau: Tableau) -> int:
    """Return the default order up to which a tableau is examined."""
    return max(HIGHEST, min(tableau.order, HIGHEST_DECLARED))


def step_of(tableau: Tableau) -> Step:
    """Return one step, with modified kicks as products of B and C, which commute for quadratic T.

    The step of a processed method begins with the inverse processor and ends with the processor.
    """
    step = _composed(tableau)
    if tableau.processor is None:
        return step
    behind = tuple((letter, c) for letter, c in _composed(tableau.processor) if c)
    return (*((letter, -c) for letter, c in reversed(behind)), *step, *behind)


def _composed(given: Composition) -> Step:
    rows = (map(Fraction, row) for row in (given.kick, given.drift, given.square))
    return tuple((letter, c) for letter, c in composed(given.first, *rows) if letter != "C" or c)


def proved_order(tableau: Tableau, highest: int, *, quadratic: bool, potential_degree: int | None = None) -> int:
    """Return the order for every separable H, or for every H with quadratic T; at most ``highest``.

    With a ``potential_degree`` it is the order for quadratic T and every polynomial V of this degree.
    """
    for degree in range(1, highest + 1):
        errors, allowed = errors_of(tableau, degree), tolerance(tableau, degree)
        rows = conditions(degree, quadratic=quadratic, potential_degree=potential_degree)
        if any(abs(weighted(row.weights, errors)) > allowed for row in rows):
            return degree - 1
    return highest


@lru_cache(maxsize=512)
def errors_of(tableau: Tableau, degree: int) -> tuple[tuple[int, ...], int]:
    """Return log(step) - (A + B) on the Lyndon words of ``degree``: numerators, and their denominator."""
    if degree % 2 == 0 and tableau.symmetric and not tableau.processed:  # its logarithm is odd in tau
        return (0,) * len(lyndon_words(degree)), 1
    return errors_on_words(step_of(tableau), degree)


def errors_on_words(step: Sequence[Factor], degree: int) -> tuple[tuple[int, ...], int]:
    """Return the result of :func:`errors_of` for any step of rational numbers, symmetric or not."""
    words = lyndon_words(degree)
    found = logarithm(step, words)
    errors = [found[word] - (degree == 1) for word in words]
    unit = lcm(*(x.denominator for x in errors))
    return tuple(x.numerator * (unit // x.denominator) for x in errors), unit


def weighted(weights: tuple[Fraction, ...], errors: tuple[tuple[int, ...], int]) -> Fraction:
    """Return the sum of ``errors``, numerators and their denominator, each times its weight."""
    numerators, denominator = errors
    unit = lcm(*(w.denominator for w in weights))
    total = sum(w.numerator * (unit // w.denominator) * x for w, x in zip(weights, numerators, strict=True))
    return Fraction(total, unit * denominator)
