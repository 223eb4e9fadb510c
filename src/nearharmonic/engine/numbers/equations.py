"""Coefficients of a collocation method with oscillators inside its equations, for a step size."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache

import numpy as np

from nearharmonic.core.layout import collocation_columns
from nearharmonic.engine.numbers.rotations import pair_of
from nearharmonic.integrators.collocation import gauss, integrals
from nearharmonic.numerics.portable import product
from nearharmonic.numerics.types import Floats


@lru_cache(maxsize=1024)
def equations(stages: int, tau: Fraction, frequencies: tuple[Fraction, ...]) -> Floats:
    """Return the moves (3, columns) of a method of s stages, as :func:`collocation_columns` has them.

    Each of the three rows is the same, as a step is one move. Without frequencies it is the step size alone.
    """
    row = np.zeros(collocation_columns(stages, len(frequencies)))
    row[:2] = pair_of(tau)
    for k, frequency in enumerate(frequencies):
        row[collocation_columns(stages, k) : collocation_columns(stages, k + 1)] = _oscillator(stages, tau, frequency)
    return np.tile(row, (3, 1))


def _oscillator(stages: int, tau: Fraction, frequency: Fraction) -> Floats:
    """w^2 as a pair, G 1, G c and h^2 B by columns: one iteration of a step removes the rounding of G and B."""
    nodes, squares = _matrices(stages)
    h = float(tau)
    known = np.column_stack([np.ones(stages), nodes, squares * (h * h)])
    found = _solved(np.eye(stages) + squares * float((tau * frequency) ** 2), known)
    return np.concatenate([pair_of(frequency * frequency), *found.T])


@lru_cache
def _matrices(stages: int) -> tuple[Floats, Floats]:
    """The nodes, and the square of the matrix of the method."""
    nodes, _ = gauss(stages)
    matrix = np.array([[float(x) for x in row] for row in integrals(nodes)])
    return np.array([float(c) for c in nodes]), product(matrix, matrix)


def _solved(matrix: Floats, known: Floats) -> Floats:
    """Solve a linear system by elimination with pivots, in operations whose bits no library chooses."""
    rows = np.hstack([matrix, known])
    size = len(rows)
    for k in range(size):
        pivot = k + int(np.argmax(np.abs(rows[k:, k])))
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] /= rows[k, k]
        others = np.arange(size) != k
        rows[others] -= rows[others, k, None] * rows[k]
    return rows[:, size:]
