"""The order conditions of an integrator, checked on its printed coefficients in exact arithmetic.

A step is the product of exponentials of a tableau's operators; the exact flow is exp(A + B), where A drifts and B
kicks. The logarithm of the step, A + B + error terms, is compared with A + B degree by degree, which settles the order
for every separable H at once (:mod:`nearharmonic.exact.words`, :mod:`nearharmonic.exact.lie`).

Printed coefficients fulfil an order condition only to their digits. If each of the m coefficients is off by up to
10^-digits, then the logarithm's coefficients on words of n letters are off by at most

    m 10^-digits M^(n-1) [x^(n-1)] e^x / (2 - e^x)  <=  m 10^-digits M^(n-1) (3/2)^n

in total, M being the sum of the absolute values of all coefficients: the first-order perturbation of log(1 + X) with
every term replaced by its absolute value. A condition counts as fulfilled within this bound, and not otherwise: so
coefficients of a dozen digits may show a higher order than they have, since nothing they violate can be told from them.
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

#: Up to this order methods are examined unless they declare more; the number of words doubles with each more.
HIGHEST = 8
#: Up to this order methods are examined if they declare it.
HIGHEST_DECLARED = 10


@lru_cache(maxsize=1024)
def tolerance(tableau: Tableau, degree: int) -> Fraction:
    """Return what guaranteed digits allow a condition of ``degree`` to be off by: the bound above."""
    count = len(step_of(tableau)) if tableau.modified else 2 * tableau.stages + 1
    return count * Fraction(1, 10**tableau.digits) * _size(tableau) ** (degree - 1) * Fraction(3, 2) ** degree


@lru_cache(maxsize=256)
def _size(tableau: Tableau) -> Fraction:
    """The sum of the absolute values of all coefficients, and more than the cubic root of what squares contribute.

    With b the sum of 4 |m|, 4 the size of C, and c^3 = 40 b, exp(b x^3) has no larger coefficients than exp(c x) up to
    x^11, as (3 j)! / j! is less than 40^j for j <= 3.
    """
    step = step_of(tableau)
    plain, squares = (sum((abs(c) for x, c in step if x in letters), Fraction(0)) for letters in ("AB", "C"))
    return plain + Fraction(ceil(1000 * float(160 * squares) ** (1 / 3)), 1000)


def highest_of(tableau: Tableau) -> int:
    """Return the order up to which a tableau is examined unless told otherwise."""
    return max(HIGHEST, min(tableau.order, HIGHEST_DECLARED))


def step_of(tableau: Tableau) -> Step:
    """Return one step, its kicks of a modified potential as B and C: for quadratic T the two commute.

    A processed method has the inverse processor in front and the processor behind.
    """
    step = _composed(tableau)
    if tableau.processor is None:
        return step
    behind = tuple((letter, c) for letter, c in _composed(tableau.processor) if c)
    return (*((letter, -c) for letter, c in reversed(behind)), *step, *behind)


def _composed(given: Composition) -> Step:
    rows = (map(Fraction, row) for row in (given.kick, given.drift, given.square))
    return tuple((letter, c) for letter, c in composed(given.first, *rows) if letter != "C" or c)


def proved_order(tableau: Tableau, highest: int, *, quadratic: bool) -> int:
    """Return the order for every separable H, or for those of quadratic T; ``highest`` if it is that or more."""
    for degree in range(1, highest + 1):
        errors, allowed = errors_of(tableau, degree), tolerance(tableau, degree)
        rows = conditions(degree, quadratic=quadratic)
        if any(abs(weighted(row.weights, errors)) > allowed for row in rows):
            return degree - 1
    return highest


@lru_cache(maxsize=512)
def errors_of(tableau: Tableau, degree: int) -> tuple[tuple[int, ...], int]:
    """Return log(step) - (A + B) on the Lyndon words of ``degree``: numerators, and their denominator."""
    if (
        degree % 2 == 0 and tableau.symmetric and not tableau.processed
    ):  # it undoes itself with tau reversed: its logarithm is odd in tau
        return (0,) * len(lyndon_words(degree)), 1
    return errors_on_words(step_of(tableau), degree)


def errors_on_words(step: Sequence[Factor], degree: int) -> tuple[tuple[int, ...], int]:
    """Return what :func:`errors_of` does for any step of rational numbers, symmetric or not."""
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
