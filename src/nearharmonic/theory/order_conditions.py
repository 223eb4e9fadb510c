"""Order conditions of integrators in exact arithmetic, and as equations of symmetric steps.

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

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cached_property, lru_cache
from math import ceil, factorial, gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.exact.lie import Condition, conditions, logarithm_weights, lyndon_words
from nearharmonic.exact.words import LETTERS, Factor, Step, composed, scaled_logarithm, word_slopes, word_sums
from nearharmonic.integrators.tableau import Composition, First, Tableau
from nearharmonic.numerics.portable import Floats

#: Order up to which methods are examined if they declare it.
HIGHEST_DECLARED = 10


@lru_cache(maxsize=1024)
@lru_cache(maxsize=512)
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


@lru_cache(maxsize=256)
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
        if any(errors[0]):
            rows = conditions(degree, quadratic=quadratic, potential_degree=potential_degree)
            if any(abs(weighted(row, errors)) > allowed for row in rows):
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
    found, scale = scaled_logarithm(step, lyndon_words(degree))
    unit = scale[degree]
    errors = [x - unit * (degree == 1) for x in found.values()]
    shared = gcd(unit, *errors)
    return tuple(x // shared for x in errors), unit // shared


def weighted(row: Condition, errors: tuple[tuple[int, ...], int]) -> Fraction:
    """Return the sum of ``errors``, numerators and their denominator, each times its weight in a condition."""
    numerators, denominator = errors
    return Fraction(sum(n * numerators[i] for i, n in row.numbers.items()), row.largest * denominator)


# --- Symmetric steps, given by half of their coefficients, and their order conditions, which are linear in word sums.
#
# The logarithm of a symmetric step has no terms of even degree. If the conditions of lower degree hold, a condition of
# odd degree n compares the coefficients of the step on words with 1/n!, the coefficient of exp(A + B). From degree
# seven on the logarithm may have brackets of lower degree that vanish for quadratic T, or for the V in question, and
# change these coefficients. A condition then is one of the logarithm, a weighted sum over more words
# (:mod:`nearharmonic.exact.lie`).
#
# On the oscillator A and B are nilpotent: only alternating words contribute to the step matrix, and kappa_l = 0
# (Nielsen 2015, Eq. 17) is the equation S(ABAB...) = 1/l! with l letters.

#: An equation: weights of words, and the required value of the weighted sum.
Equation = tuple[dict[str, Fraction], Fraction]


class SymmetricSteps:
    """Symmetric steps of s stages; both rows sum to 1.

    Unknowns are the first half of the outer row without its innermost value, which follows from the sum, the first half
    of the inner row without its innermost value, and the coefficients of the squares, beginning with the outermost
    kick. Unknowns may be fractions, floats, arrays of floats, mpmath numbers or intervals; results have the same type.
    """

    stages: int
    first: First
    squares: tuple[int, ...] = ()

    @property
    def halves(self) -> tuple[int, int]:
        """Numbers of unknowns of the outer and of the inner row."""
        return self.stages // 2, (self.stages - 1) // 2

    @property
    def unknowns(self) -> int:
        """Number n of unknowns: s - 1 plus the number of squares."""
        return self.stages - 1 + len(self.squares)

    def palindromes(self, x: Sequence[Any] | Floats) -> tuple[list[Any], list[Any]]:
        """Return the outer row (s + 1 values) and the inner row (s values) for the n unknowns ``x``."""
        outer, inner = self.halves
        one = 1 + 0 * x[0]
        return _closed(x[:outer], self.stages + 1, one), _closed(x[outer : outer + inner], self.stages, one)

    def halved(self, outer: Sequence[Any], inner: Sequence[Any], squares: Sequence[Any] = ()) -> list[Any]:
        """Return the unknowns of a step with these rows: the inverse of :meth:`palindromes`."""
        counts = self.halves
        return [*outer[: counts[0]], *inner[: counts[1]], *(squares[i] for i in self.squares)]

    def rows(self, x: Sequence[Any] | Floats) -> tuple[list[Any], list[Any], list[Any]]:
        """Return all kicks, drifts and squares of a step."""
        outer, inner = self.palindromes(x)
        kicks, drifts = (outer, inner) if self.first == "kick" else (inner, outer)
        squares: list[Any] = [0 * kick for kick in kicks]
        for place, value in zip(self.squares, x[self.stages - 1 :], strict=True):
            squares[place] = squares[-1 - place] = value
        return kicks, drifts, squares

    def is_modified(self, kick: int) -> bool:
        """Return True if a kick has a square."""
        kicks = self.stages + (self.first == "kick")
        return min(kick, kicks - 1 - kick) in self.squares

    def step(self, x: Sequence[Any] | Floats) -> Step:
        """Return the step of the unknowns ``x``."""
        kicks, drifts, squares = self.rows(x)
        given = [m if self.is_modified(i) else None for i, m in enumerate(squares)]
        return composed(self.first, kicks, drifts, given)

    @cached_property
    def placement(self) -> tuple[Floats, Floats]:
        """Matrix (F, n) and vector (F,) of the affine map from n unknowns to the F numbers of a step, in doubles."""
        size = (self.unknowns, self.unknowns)
        units, zeros = (np.array([c for _, c in self.step(x)]) for x in (np.eye(*size), np.zeros(size)))
        return units - zeros, zeros[:, 0]


class ConditionedSteps(SymmetricSteps):
    """Symmetric steps with a given order for quadratic T and a given order on the harmonic oscillator.

    With a ``potential_degree`` they have the order for every V that is a polynomial of at most this degree, which
    takes fewer equations from order six on. A ``generalised_order`` (r1, r2, ...) for H = T + epsilon V adds the
    equations of epsilon^k below the power r_k of the step size.
    """

    order: int
    harmonic_order: int
    potential_degree: int | None = None
    generalised_order: tuple[int, ...] = ()

    @cached_property
    def equations(self) -> tuple[Equation, ...]:
        """Equations, multiplied by n! for words of n letters so that residuals have similar sizes."""
        found: list[Equation] = []
        for degree in range(3, max((self.order, *self.generalised_order)), 2):
            n, words = factorial(degree), lyndon_words(degree)
            for row in conditions(degree, quadratic=True, potential_degree=self.potential_degree):
                left = {word: n * w for word, w in zip(words, row.weights, strict=True) if w}
                if degree >= self._order_of_words(left):
                    continue
                if self._has_vanishing(degree, left):
                    found.append((_of_logarithm(left), Fraction(0)))
                else:
                    found.append((left, sum(row.weights, Fraction(0))))
        powers = range(self.order + 1, self.harmonic_order + 1)
        return (*found, *(({alternating(n): Fraction(factorial(n))}, Fraction(1)) for n in powers))

    def _has_vanishing(self, degree: int, words: Iterable[str]) -> bool:
        """Return True if the logarithm may have elements of lower degree that vanish for such a potential.

        They are no error, but their products with A and B change the coefficients of the step on longer words. The
        first have five letters, three of them B for any potential and at least one for potentials of a given degree.
        """
        return degree > 5 and (self.potential_degree is not None or max(word.count("B") for word in words) > 2)

    def _order_of_words(self, words: Iterable[str]) -> int:
        """Return the required order of a condition; all its words have as many kicks, the power of epsilon."""
        power = max(word.count("B") for word in words)
        generalised = self.generalised_order[power - 1 : power]
        return max((self.order, *generalised))

    def residuals(self, x: Sequence[Any] | Floats) -> list[Any]:
        """Return the values of the equations, 0 where they hold, for n numbers, mpmath numbers or arrays of floats."""
        return self._weighted(x, word_sums(self.step(x), self._words), 1)

    def slopes(self, x: Sequence[Any] | Floats) -> Any:
        """Return the derivatives (equations, n) of the residuals at n numbers, or (C, equations, n) at arrays of C."""
        return self.linearised(x)[1]

    def linearised(self, x: Sequence[Any] | Floats) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the residuals (equations, ...) and their derivatives (..., equations, n)."""
        sums, slopes = word_slopes(self.step(x), self._words)
        by_factor = np.stack(self._weighted(x, slopes, 0))
        by_unknown = np.moveaxis(by_factor, (0, 1), (-2, -1)) @ self.placement[0]
        return np.stack(self._weighted(x, sums, 1)), by_unknown

    def _weighted(self, x: Sequence[Any] | Floats, of_words: dict[str, Any], constant: int) -> list[Any]:
        """Return the weighted sum of each equation, minus its required value if ``constant`` is 1."""
        from mpmath import mpf  # here, because it is slow to load

        from nearharmonic.exact.polynomials import as_mpf

        number = as_mpf if isinstance(x[0], mpf) else float
        return [
            sum(number(w) * of_words[word] for word, w in left.items()) - constant * number(right)
            for left, right in self.equations
        ]

    @cached_property
    def _words(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(word for left, _ in self.equations for word in left))


def _of_logarithm(weights: dict[str, Fraction]) -> dict[str, Fraction]:
    """Return weights of words for a weighted sum of the logarithm.

    A symmetric step has equal coefficients on reversed words.
    """
    found: dict[str, Fraction] = {}
    for word, weight in weights.items():
        for other, part in logarithm_weights(word).items():
            key = min(other, other[::-1])
            found[key] = found.get(key, Fraction(0)) + weight * part
    return {word: weight for word, weight in found.items() if weight}


def alternating(length: int, start: str = "A") -> str:
    """Return the word ABAB... of ``length`` letters, or BABA... for ``start`` B."""
    return "".join((start if i % 2 == 0 else LETTERS.replace(start, "")) for i in range(length))


def _closed(half: Sequence[Any] | Floats, length: int, one: Any) -> list[Any]:
    """Return the palindrome of sum ``one`` that begins with ``half``."""
    start = list(half)
    rest = one - 2 * sum(start[1:], start[0] if start else 0 * one)
    inmost = [rest] if length % 2 else [rest / 2, rest / 2]
    return [*start, *inmost, *reversed(start)]
