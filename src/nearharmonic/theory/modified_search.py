"""Symmetric methods with kicks of a modified potential of a given order: their equations, and a search for solutions.

A step is a product of exponentials of A, B and C = [B, [A, B]], whose coefficients on words are those of
:mod:`nearharmonic.exact.words`: with arrays, each entry is a start of the search; with mpmath numbers, Newton's
method finds the digits. A symmetric step fulfils the conditions of even degree by itself. Where those
of lower degree hold, one of odd degree n compares the coefficients on words with those of exp(A + B), which are 1/n!.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from mpmath import mp, mpf

from nearharmonic.exact.decimals import BigFloat, as_mpf
from nearharmonic.exact.lie import conditions, lyndon_words
from nearharmonic.exact.newton import Limit, newton
from nearharmonic.exact.step import Factor
from nearharmonic.exact.words import word_sums
from nearharmonic.integrators.tableau import First
from nearharmonic.numerics.types import Floats

#: An equation: weights of words, and what the weighted sum has to be.
Equation = tuple[list[tuple[Fraction, str]], Fraction]

#: Mean and spread of kicks and drifts that the search begins with, and spread of the squares.
MEAN, SPREAD, SPREAD_OF_SQUARES = 0.2, 0.35, 0.01
#: Most iterations of a start, the longest step of each, and the step of differences.
ITERATIONS, LONGEST, DIFFERENCE = 100, 0.2, 1e-7
#: Residual of a solution in double precision, and the largest coefficient that it may have.
SOLVED, LARGEST = 1e-13, 3.0


@dataclass(frozen=True)
class ModifiedEquations:
    """The equations of symmetric methods of an even order for quadratic T.

    The unknowns are the kicks, the drifts and the squares of half a step, the outer ones first.

    Parameters
    ----------
    stages : int
        Stages of a step.
    first : {"drift", "kick"}
        Operator that comes first and last.
    order : int
        Order that solutions have.
    """

    stages: int
    first: First
    order: int

    @property
    def counts(self) -> tuple[int, int, int]:
        """Number of kicks, drifts and squares among the unknowns."""
        kicks = (self.stages + (self.first == "kick") + 1) // 2
        return kicks, (self.stages + (self.first == "drift") + 1) // 2, kicks

    def rows(self, point: Sequence[Any] | Floats) -> tuple[list[Any], list[Any], list[Any]]:
        """Return all kicks, drifts and squares of a step."""
        kicks, drifts, _ = self.counts
        parts = point[:kicks], point[kicks : kicks + drifts], point[kicks + drifts :]
        lengths = [self.stages + (self.first == name) for name in ("kick", "drift", "kick")]
        found = [[part[min(i, n - 1 - i)] for i in range(n)] for part, n in zip(parts, lengths, strict=True)]
        return found[0], found[1], found[2]

    def factors(self, point: Sequence[Any] | Floats) -> list[Factor]:
        """Return the operators of a step in their order."""
        kicks, drifts, squares = self.rows(point)
        modified: list[list[Factor]] = [[("B", k), ("C", m)] for k, m in zip(kicks, squares, strict=True)]
        plain: list[list[Factor]] = [[("A", c)] for c in drifts]
        rows = (modified, plain) if self.first == "kick" else (plain, modified)
        return [x for i in range(self.stages + 1) for row in rows for group in row[i : i + 1] for x in group]

    def residuals(self, point: Sequence[Any] | Floats) -> list[Any]:
        """Return the values of the equations, 0 at a solution, for numbers or arrays of floats or mpmath numbers."""
        number = as_mpf if isinstance(point[0], mpf) else float
        step = word_sums(self.factors(point), [word for row, _ in self._equations for _, word in row])
        return [sum(step[word] * number(w) for w, word in row) - number(total) for row, total in self._equations]

    def jacobian(self, point: Sequence[BigFloat]) -> list[list[BigFloat]]:
        """Return the derivatives at a point of mpmath numbers, by differences of half the working precision."""
        h, here, columns = mpf(10) ** (-mp.dps // 2), self.residuals(point), []
        for j in range(len(point)):
            there = self.residuals([x + h * (i == j) for i, x in enumerate(point)])
            columns.append([(b - a) / h for a, b in zip(here, there, strict=True)])
        return [list(row) for row in zip(*columns, strict=True)]

    @cached_property
    def _equations(self) -> list[Equation]:
        return [
            (
                [(w, word) for w, word in zip(row.weights, lyndon_words(degree), strict=True) if w],
                sum(row.weights, Fraction(0)) / factorial(degree),
            )
            for degree in range(1, self.order, 2)
            for row in conditions(degree, quadratic=True)
        ]


def solutions(equations: ModifiedEquations, starts: int, seed: int) -> Floats:
    """Return solutions (R, unknowns) in double precision that Newton's method reaches from random ``starts``.

    With more unknowns than equations each step is the shortest, and solutions are points of families.
    """
    kicks, drifts, squares = equations.counts
    random = np.random.default_rng(seed)
    x = np.concatenate(
        [random.normal(MEAN, SPREAD, (kicks + drifts, starts)), random.normal(0, SPREAD_OF_SQUARES, (squares, starts))]
    )
    for _ in range(ITERATIONS):
        values = np.array(equations.residuals(x))
        slopes = [(np.array(equations.residuals(x + DIFFERENCE * e)) - values) / DIFFERENCE for e in _units(len(x))]
        J = np.stack(slopes, axis=1).transpose(2, 0, 1)
        step = -np.einsum("rue,er->ur", np.linalg.pinv(J), values)
        x = x + step * np.minimum(1, LONGEST / np.maximum(np.abs(step).max(axis=0), LONGEST))
        x = x[:, np.isfinite(x).all(axis=0) & (np.abs(x).max(axis=0) < 10 * LARGEST)]
    solved = np.abs(np.array(equations.residuals(x))).max(axis=0) < SOLVED
    return x[:, solved & (np.abs(x).max(axis=0) < LARGEST)].T


def _units(count: int) -> Floats:
    """Unit vectors, as columns."""
    return np.eye(count)[:, :, None]


def digits_of(equations: ModifiedEquations, start: Sequence[float | str], fixed: Sequence[int], digits: int) -> Limit:
    """Return the solution near ``start`` to so many digits; unknowns that are ``fixed`` keep their values.

    Parameters
    ----------
    equations : ModifiedEquations
        What is solved.
    start : sequence of numbers
        One per unknown; decimal strings are exact.
    fixed : sequence of int
        Indices of unknowns.
    digits : int
        Decimals.
    """
    with mp.workdps(2 * digits):
        given = [mpf(x) for x in start]
    return newton(equations.residuals, equations.jacobian, given, digits=digits, fixed=fixed)
