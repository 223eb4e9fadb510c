"""Equations of symmetric integrators of Nystrom order six with a harmonic order, which are linear in word sums.

A step is a product of exponentials exp(c X), X being A for a drift and B for a kick; S(w) is the coefficient of the
word w in this product; in the exact exp(A + B) it is 1/n! for a word of n letters. The logarithm of a symmetric step
has no terms of even degree. The equations by degree are therefore:

- degree 1: both rows sum to 1, which eliminates the innermost value of each row;
- degree 3: the two order conditions of :func:`~nearharmonic.exact.lie`;
- degree 5: the four that remain for quadratic kinetic energy. If the lower degrees are exact, the logarithm of the step
  has the coefficients S(w) - 1/n! on words of five letters, and each condition is a weighted sum of these;
- degree 7 and beyond, for the harmonic oscillator only: there A and B are nilpotent, so that the powers of tau in the
  step matrix are the alternating words, and kappa_l = 0 (Nielsen 2015, Eq. 17) reads S(ABAB...) = 1/l!, l letters.
  Up to l = 6 that follows from the order.

With s stages there are s + 1 coefficients, two sums and lambda_H further equations: s - 1 - lambda_H are free.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from nearharmonic.exact.words import LETTERS
from nearharmonic.integrators.tableau import First
from nearharmonic.theory.symmetric import ConditionedSteps, Equation

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
