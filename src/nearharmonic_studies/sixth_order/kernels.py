"""Compiled part of the search: word sums of a step, solutions from many points, and a descent along solutions.

A step is given by ``letters`` and coefficients ``c`` of its operators. A factor exp(c X) at the end of a product adds
c^k/k! S(v) to S(w) for w = v X^k.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from nearharmonic.core.reals import jit
from nearharmonic.numerics.compiled import Damping, iteration, levenberg_step
from nearharmonic.numerics.portable import Bools
from nearharmonic_studies.sixth_order.criterion import (
    ANHARMONICITY,
    FARTHEST,
    HARMONIC_DEGREES,
    NYSTROM_ORDER,
    SCAN,
    TAU_PER_STAGE,
    Criterion,
    Doubles,
    Integers,
    System,
)

#: Norms of the residuals are in units of kappa, whose rounding error is about 1e-13.
DAMPING = Damping(
    iterations=150, enough=1e-12, solved=1e-10, first=1e-2, fall=(0.15, 1.0), rise=4.0, most=1e10, by_residual=True,
    bounded=True,
)  # fmt: skip
#: Number of steps of Newton's method to the solution near a point.
PROJECTION = Damping(iterations=7, enough=1e-12, solved=1e-12, lost=1.0, monotone=False)


class Walk(NamedTuple):
    """Settings of a walk.

    The length of the random steps is ``first`` at the start, and again once it is below ``least``; it grows by the
    factor ``longer`` after a success and falls by ``shorter`` after a failure.
    """

    first: float = 0.05
    longer: float = 1.6
    shorter: float = 0.85
    least: float = 1e-7


@jit
def solve(system: System, starts: Doubles, bound: float) -> tuple[Doubles, Bools]:
    """Iterate from ``starts`` (start, unknown); return the ends, and the mask of solutions in [-bound, bound]."""
    ends, solved = starts.copy(), np.zeros(len(starts), np.bool_)
    for start in range(len(starts)):
        solved[start] = iterate(system, ends[start], bound, DAMPING)
    return ends, solved


@jit
def descend(
    system: System, criterion: Criterion, bound: float, settings: Walk, noise: Doubles, starts: Doubles
) -> Doubles:
    """Return solutions of lower J, found by random walks with ``noise`` (start, step, unknown) from ``starts``.

    A random step, projected back to the solutions, is accepted if J decreases; its length is adapted to the success.
    """
    ends, trial = starts.copy(), np.empty(starts.shape[1])
    for walk in range(len(ends)):
        x, length = ends[walk], settings.first
        least = merit(system, criterion, x)[4]
        for step in range(noise.shape[1]):
            for u in range(len(x)):
                trial[u] = x[u] + length * noise[walk, step, u]
            better = False
            if iterate(system, trial, bound, PROJECTION):
                value = merit(system, criterion, trial)[4]
                better = value < least
            if better:
                for u in range(len(x)):
                    x[u] = trial[u]
                least = value
                length *= settings.longer
            else:
                length *= settings.shorter
            # A walk with vanishing steps restarts with long steps, because gaps of stability make J discontinuous.
            if length < settings.least:
                length = settings.first
    return ends


@jit
def assess(system: System, criterion: Criterion, solutions: Doubles) -> Doubles:
    """(e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    merits = np.empty((len(solutions), 5))
    for i in range(len(solutions)):
        merits[i, 0], merits[i, 1], merits[i, 2], merits[i, 3], merits[i, 4] = merit(system, criterion, solutions[i])
    return merits


@jit
def residuals(system: System, x: Doubles) -> tuple[Doubles, float, Doubles]:
    """Residuals (equation,) at ``x``, their norm, and the coefficients of the step."""
    weights, wanted, c = system.weights, system.wanted, coefficients(system, x)
    sums = word_sums(system.parent, system.letter, system.letters, c)
    F, square = -wanted, 0.0
    for e in range(len(F)):
        for w in range(len(sums)):
            if weights[e, w] != 0.0:
                F[e] += weights[e, w] * sums[w]
        square += F[e] * F[e]
    return F, np.sqrt(square), c


@jit
def jacobian(system: System, x: Doubles, c: Doubles) -> Doubles:
    """Derivatives of the residuals (equation, unknown) at ``x``, for the coefficients of the step there."""
    weights = system.weights
    slopes = word_slopes(system, c)
    J = np.zeros((len(weights), len(x)))
    for e in range(len(weights)):
        for w in range(len(slopes)):
            if weights[e, w] != 0.0:
                for u in range(len(x)):
                    J[e, u] += weights[e, w] * slopes[w, u]
    return J


@jit
def merit(system: System, criterion: Criterion, x: Doubles) -> tuple[float, float, float, float, float]:
    """(e_N, e_H, A, tau*, J) of the solution ``x`` (unknown)."""
    wanted, weights, places = criterion.wanted, criterion.weights, criterion.places
    c = coefficients(system, x)
    sums = word_sums(criterion.parent, criterion.letter, system.letters, c)
    square = 0.0
    for e in range(len(wanted)):
        error = -wanted[e]
        for w in range(len(sums)):
            error += weights[e, w] * sums[w]
        square += error * error
    stages = len(c) // 2
    tau = stages * TAU_PER_STAGE
    nystrom, harmonic = np.sqrt(square) * tau**NYSTROM_ORDER, 0.0
    for degree in HARMONIC_DEGREES:
        exact = 1.0
        for n in range(2, degree + 1):
            exact /= n
        K12, K21 = sums[places[0, degree - 1]] - exact, sums[places[1, degree - 1]] - exact
        harmonic += np.hypot(K12, K21) * tau ** (degree - 1)
    size = 0.0
    for i in range(len(c)):
        size += abs(c[i])
    limit = first_gap(sums, places)
    value = np.log10((harmonic + ANHARMONICITY * nystrom) * (size / 2) * (2 * stages / limit))
    return nystrom, harmonic, size, limit, value


@jit
def first_gap(sums: Doubles, places: Integers) -> float:
    """Return tau*: the first zero of K12 or K21; (tr K / 2)^2 - 1 = K12 K21 is positive for larger step sizes.

    Both are sums over the alternating words, (-1)^j S(w) tau^(2j + 1) for the word of 2j + 1 letters.
    """
    above = np.ones(2)
    tau, limit = 0.0, FARTHEST
    while tau < limit:
        tau += SCAN
        for k in range(2):
            value = 0.0
            for j in range((places.shape[1] - 1) // 2, -1, -1):
                value = sums[places[k, 2 * j]] - tau * tau * value
            if not value > 0.0:
                # Linear between the two samples: to about SCAN^2.
                limit = min(limit, tau - SCAN * value / (value - above[k]))
            above[k] = value
    return limit


@jit
def coefficients(system: System, x: Doubles) -> Doubles:
    """Return the coefficients of a step from its unknowns."""
    c = system.offset.copy()
    for i in range(len(c)):
        for u in range(len(x)):
            c[i] += system.directions[i, u] * x[u]
    return c


@jit
def word_sums(parent: Integers, letter: Integers, letters: Integers, c: Doubles) -> Doubles:
    """Return S(w) of all words of a ``conditions.WordTable``, given by its arrays."""
    sums = np.zeros(len(parent))
    sums[0] = 1.0
    for i in range(len(letters)):
        # Longer words first: they need the old sums of shorter words.
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                sums[w] += factor * sums[v]
                while letter[v] == letters[i]:
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
                    sums[w] += factor * sums[v]
    return sums


@jit
def word_slopes(system: System, c: Doubles) -> Doubles:
    """Return derivatives (word, unknown) of S(w) for all words of the equations."""
    parent, letter, letters, directions = system.parent, system.letter, system.letters, system.directions
    unknowns = directions.shape[1]
    sums, slopes = np.zeros(len(parent)), np.zeros((len(parent), unknowns))
    sums[0] = 1.0
    for i in range(len(letters)):
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                while True:
                    sums[w] += factor * sums[v]
                    for u in range(unknowns):
                        slopes[w, u] += factor * slopes[v, u]
                    if letter[v] != letters[i]:
                        break
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
        # d exp(c X) = exp(c X) X dc: the sums already include the operator.
        for w in range(1, len(parent)):
            if letter[w] == letters[i]:
                for u in range(unknowns):
                    slopes[w, u] += directions[i, u] * sums[parent[w]]
    return slopes


iterate = iteration(residuals, jacobian, levenberg_step)
