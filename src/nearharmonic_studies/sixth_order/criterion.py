"""Criterion for the ranking of sixth-order near-harmonic methods; it uses no test problem.

    J = log10 [ (e_H + epsilon e_N) (A / 2) (2 s / tau*) ],
    e_N = |E_7| (s h)^6,    e_H = |K_7| (s h)^6 + |K_9| (s h)^8 + |K_11| (s h)^10

- |E_7| is the norm of the leading error term for quadratic kinetic energy
  (:func:`nearharmonic.theory.order.error_norm`): e_N is the local error per unit time at h = tau/s, the
  time between two evaluations of the force, so at equal cost.
- |K_d| is the norm of the error of degree d of the step matrix on the harmonic oscillator: e_H is defined in the same
  way. Terms beyond the leading one are needed because a harmonic order makes it vanish. Errors of even degree follow
  from det K = 1.
- A near-harmonic system is a harmonic system plus epsilon times another one: its error is e_H + epsilon e_N. A harmonic
  order improves J only until the anharmonic errors dominate.
- A, the sum of the absolute values of all coefficients, is at least 2: A/2 is the length of all substeps relative to a
  step without backward substeps. Rounding errors and higher error terms grow with it.
- tau*/s, the linear stability limit per stage, is at most 2, the limit of leapfrog: 2s/tau* is the reduction.

Both factors are at least 1. h and epsilon set the scale: h = 0.1 corresponds to 63 evaluations of the force per period,
where such methods begin to be efficient, and epsilon = 0.1 is the meaning of "near".
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.words import LETTERS
from nearharmonic.integrators.tableau import First
from nearharmonic.theory.order_conditions import ConditionedSteps, Equation, alternating

# --- Equations of symmetric integrators of Nystrom order six with a harmonic order, which are linear in word sums.
#
# A step is a product of exponentials exp(c X), X being A for a drift and B for a kick; S(w) is the coefficient of the
# word w in this product; in the exact exp(A + B) it is 1/n! for a word of n letters. The logarithm of a symmetric step
# has no terms of even degree. The equations by degree are therefore:
#
# - degree 1: both rows sum to 1, which eliminates the innermost value of each row;
# - degree 3: the two order conditions of :func:`~nearharmonic.exact.lie`;
# - degree 5: the four that remain for quadratic kinetic energy. If the lower degrees are exact, the logarithm of the
# step
#   has the coefficients S(w) - 1/n! on words of five letters, and each condition is a weighted sum of these;
# - degree 7 and beyond, for the harmonic oscillator only: there A and B are nilpotent, so that the powers of tau in the
#   step matrix are the alternating words, and kappa_l = 0 (Nielsen 2015, Eq. 17) reads S(ABAB...) = 1/l!, l letters.
#   Up to l = 6 that follows from the order.
#
# With s stages there are s + 1 coefficients, two sums and lambda_H further equations: s - 1 - lambda_H are free.

Doubles = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

#: Order for quadratic kinetic energy.
NYSTROM_ORDER = 6


@dataclass(frozen=True)
class WordTable:
    """Words in the form for kernels: word i is word ``parent[i]`` followed by the letter ``LETTERS[letter[i]]``.

    The empty word is first, shorter words precede longer ones, and the table has all prefixes of its words.
    """

    words: tuple[str, ...]
    parent: Integers
    letter: Integers

    @classmethod
    def of(cls, needed: Iterable[str]) -> WordTable:
        """Return the table of ``needed`` and their prefixes."""
        closed = {word[:n] for word in needed for n in range(len(word) + 1)}
        words = tuple(sorted(closed, key=lambda word: (len(word), word)))
        place = {word: i for i, word in enumerate(words)}
        parent = np.array([-1, *(place[word[:-1]] for word in words[1:])])
        letter = np.array([-1, *(LETTERS.index(word[-1]) for word in words[1:])])
        return cls(words, parent, letter)

    def weights(self, equations: Sequence[Equation]) -> tuple[Doubles, Doubles]:
        """Return ``equations`` as a matrix (equation, word) and the right-hand sides (equation)."""
        rows = [[float(left.get(word, 0)) for word in self.words] for left, _ in equations]
        return np.array(rows), np.array([float(right) for _, right in equations])


@dataclass(frozen=True)
class NystromEquations(ConditionedSteps):
    """The equations for s ``stages``, the ``first`` operator, and a ``harmonic_order`` lambda_H from 6 to s - 1."""

    stages: int
    first: First
    harmonic_order: int
    order: int = field(default=NYSTROM_ORDER, init=False, repr=False)

    @property
    def free(self) -> int:
        """Number of free parameters."""
        return self.unknowns - self.harmonic_order


#: h and epsilon of the criterion.
TAU_PER_STAGE, ANHARMONICITY = 0.1, 0.1
#: Degrees of the harmonic error terms.
HARMONIC_DEGREES = (7, 9, 11)
#: Spacing of the step sizes in the search for the stability limit, and upper end of the search.
SCAN, FARTHEST = 0.02, 8.0


@dataclass(frozen=True)
class Merit:
    """The ingredients of the criterion, e_N, e_H, A and tau*, and its value J."""

    nystrom_error: float
    harmonic_error: float
    sum_of_absolute_values: float
    stability_limit: float
    value: float


def leading_nystrom_error() -> tuple[Equation, ...]:
    """Return the orthonormal coordinates of the error term of degree 7, as equations for its vanishing.

    Words also contain errors of degree 5 that vanish for quadratic kinetic energy. With X = A + B and errors E_5, E_7
    the step is exp(X + E_5 + E_7). Its part of degree 7 is X^7/7! + E_7 + (X X E_5 + X E_5 X + E_5 X X)/6, and E_5 is
    its part of degree 5 minus X^5/5!.
    """
    degree, found = NYSTROM_ORDER + 1, []
    words = lyndon_words(degree)
    for row in conditions(degree, quadratic=True):
        left: dict[str, Fraction] = {}
        right = Fraction(0)
        # The conversion to doubles takes the square root; the weights here are rational.
        for word, weight in zip(words, row.weights, strict=True):
            if weight:
                parts = [(word, Fraction(1)), *((word[k : k + 5], Fraction(-1, 6)) for k in range(3))]
                for part, factor in parts:
                    left[part] = left.get(part, Fraction(0)) + weight * factor
                right += weight * (Fraction(1, 5040) - Fraction(3, 6 * 120))
        found.append((left, right))
    return tuple(found)


class System(NamedTuple):
    """Arrays of the equations ``weights`` S = ``wanted`` for a step of coefficients ``directions`` x + ``offset``.

    ``parent`` and ``letter`` belong to the table of words, ``letters`` to the operators of the step.
    """

    parent: Integers  # (word,)
    letter: Integers  # (word,)
    letters: Integers  # (operator,)
    directions: Doubles  # (operator, unknown)
    offset: Doubles  # (operator,)
    weights: Doubles  # (equation, word)
    wanted: Doubles  # (equation,)


class Criterion(NamedTuple):
    """Arrays of the criterion: errors are ``weights`` S - ``wanted``; ``places`` are indices of alternating words."""

    parent: Integers  # (word,)
    letter: Integers  # (word,)
    weights: Doubles  # (error, word)
    wanted: Doubles  # (error,)
    places: Integers  # (first letter, length)


@cache
def criterion_of(stages: int) -> Criterion:
    """Return the arrays of the criterion for a number of stages."""
    equations = leading_nystrom_error()
    chains = [[alternating(n, start) for n in range(1, 2 * stages + 2)] for start in "AB"]
    table = WordTable.of([*(word for left, _ in equations for word in left), *chains[0], *chains[1]])
    weights, wanted = table.weights(equations)
    for i, row in enumerate(conditions(NYSTROM_ORDER + 1, quadratic=True)):
        weights[i] /= float(row.scale) ** 0.5
        wanted[i] /= float(row.scale) ** 0.5
    places = np.array([[table.words.index(word) for word in chain] for chain in chains])
    return Criterion(table.parent, table.letter, weights, wanted, places)


@cache
def system_of(equations: NystromEquations) -> System:
    """Return the arrays of ``equations``."""
    table = WordTable.of(word for left, _ in equations.equations for word in left)
    letters = (np.arange(2 * equations.stages + 1) + (equations.first == "kick")) % 2  # 0 for a drift, 1 for a kick
    weights, wanted = table.weights(equations.equations)
    return System(table.parent, table.letter, letters, *equations.placement, weights, wanted)
