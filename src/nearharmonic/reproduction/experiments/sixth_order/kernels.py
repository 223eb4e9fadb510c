"""The compiled part of the search: word sums of a step, solutions from many points, and a descent along them.

A step comes as ``letters`` and coefficients ``c`` of its operators. exp(c X) behind a product adds c^k/k! S(v) to S(w)
for w = v X^k.
"""

from __future__ import annotations

import numpy as np

from nearharmonic.core.layout import Flags
from nearharmonic.core.machine.jit import jit
from nearharmonic.numerics.levenberg_marquardt import FIRST_DAMPING, levenberg_step
from nearharmonic.reproduction.experiments.sixth_order.conditions import NYSTROM_ORDER, Doubles, Integers
from nearharmonic.reproduction.experiments.sixth_order.criterion import (
    ANHARMONICITY,
    FARTHEST,
    HARMONIC_DEGREES,
    SCAN,
    TAU_PER_STAGE,
    Criterion,
    System,
)

#: Norms of the residuals at which an iteration ends, and below which it has solved its equations. They are in units of
#: kappa, of which rounding leaves about 1e-13.
ENOUGH, SOLVED = 1e-12, 1e-10
#: Factors of the damping after a step that is taken and after one that is not; damping and steps to give up at.
LESS, MORE = 0.15, 4.0
MOST_DAMPING, ITERATIONS = 1e10, 150

#: Descent: length of the first random step, the factors after success and failure, and Newton steps per projection.
FIRST_LENGTH, LONGER, SHORTER = 0.05, 1.6, 0.85
MOST_PROJECTIONS = 8


@jit
def solve(system: System, starts: Doubles, bound: float) -> tuple[Doubles, Flags]:
    """Iterate by damped steps from ``starts`` (start, unknown); return the ends, and which of them are solutions.

    An iteration that leaves [-bound, bound] is given up.
    """
    solutions, solved = starts.copy(), np.zeros(len(starts), np.bool_)
    equations, unknowns = len(system.wanted), starts.shape[1]
    matrix, step, moved = np.empty((equations, equations + 1)), np.empty(unknowns), np.empty(unknowns)
    for start in range(len(starts)):
        x, damping = solutions[start], FIRST_DAMPING
        F, size = residuals(system, x)
        J = jacobian(system, x)
        for _ in range(ITERATIONS):
            if not size > ENOUGH or damping > MOST_DAMPING or not within(x, bound):
                break
            # Damping that falls with the residuals does not spoil the quadratic end.
            levenberg_step(F, J, damping * min(size, 1.0), matrix, step)
            for u in range(unknowns):
                moved[u] = x[u] - step[u]
            trial_F, trial_size = residuals(system, moved)
            if trial_size < size:
                for u in range(unknowns):
                    x[u] = moved[u]
                F, J, size = trial_F, jacobian(system, x), trial_size
                damping *= LESS
            else:
                damping *= MORE
        solved[start] = size < SOLVED and within(x, bound)
    return solutions, solved


@jit
def descend(system: System, criterion: Criterion, bound: float, noise: Doubles, starts: Doubles) -> Doubles:
    """Solutions of lower J, to which ``noise`` (start, step, unknown) leads from the solutions ``starts``.

    A random step, projected back on the solutions, is kept if J gets less; its length adapts to success.
    """
    ends, trial = starts.copy(), np.empty(starts.shape[1])
    for walk in range(len(ends)):
        x, length = ends[walk], FIRST_LENGTH
        least = merit(system, criterion, x)[4]
        for step in range(noise.shape[1]):
            for u in range(len(x)):
                trial[u] = x[u] + length * noise[walk, step, u]
            better = False
            if project(system, trial) and within(trial, bound):
                value = merit(system, criterion, trial)[4]
                better = value < least
            if better:
                for u in range(len(x)):
                    x[u] = trial[u]
                least = value
                length *= LONGER
            else:
                length *= SHORTER
            # A walk that has come to rest begins again at a coarse scale: gaps of stability make cliffs.
            if length < 1e-7:
                length = FIRST_LENGTH
    return ends


@jit
def assess(system: System, criterion: Criterion, solutions: Doubles) -> Doubles:
    """(e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    merits = np.empty((len(solutions), 5))
    for i in range(len(solutions)):
        merits[i, 0], merits[i, 1], merits[i, 2], merits[i, 3], merits[i, 4] = merit(system, criterion, solutions[i])
    return merits


@jit
def project(system: System, x: Doubles) -> bool:
    """Move ``x`` to the solution next to it, by Newton's method with the shortest steps; return success."""
    equations = len(system.wanted)
    matrix, step = np.empty((equations, equations + 1)), np.empty(len(x))
    for _ in range(MOST_PROJECTIONS):
        F, size = residuals(system, x)
        if size < ENOUGH:
            return True
        if not size < 1.0:
            break
        levenberg_step(F, jacobian(system, x), 0.0, matrix, step)
        for u in range(len(x)):
            x[u] -= step[u]
    return False


@jit
def within(x: Doubles, bound: float) -> bool:
    """Tell whether ``x`` is in [-bound, bound]."""
    inside = True
    for u in range(len(x)):
        inside = inside and abs(x[u]) <= bound
    return inside


@jit
def residuals(system: System, x: Doubles) -> tuple[Doubles, float]:
    """Residuals (equation,) at ``x``, and their norm."""
    weights, wanted = system.weights, system.wanted
    sums = word_sums(system.parent, system.letter, system.letters, coefficients(system, x))
    F, square = -wanted, 0.0
    for e in range(len(F)):
        for w in range(len(sums)):
            if weights[e, w] != 0.0:
                F[e] += weights[e, w] * sums[w]
        square += F[e] * F[e]
    return F, np.sqrt(square)


@jit
def jacobian(system: System, x: Doubles) -> Doubles:
    """Derivatives of the residuals (equation, unknown) at ``x``."""
    weights = system.weights
    slopes = word_slopes(system, coefficients(system, x))
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
    """tau*: the first step size at which K12 or K21 vanishes, behind which (tr K / 2)^2 - 1 = K12 K21 is positive.

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
    """The coefficients of a step from its unknowns."""
    c = system.offset.copy()
    for i in range(len(c)):
        for u in range(len(x)):
            c[i] += system.directions[i, u] * x[u]
    return c


@jit
def word_sums(parent: Integers, letter: Integers, letters: Integers, c: Doubles) -> Doubles:
    """S(w) of all words of a ``conditions.WordTable``, which comes as its arrays."""
    sums = np.zeros(len(parent))
    sums[0] = 1.0
    for i in range(len(letters)):
        # Longer words first: what they draw on is still that of the product so far.
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
    """Derivatives (word, unknown) of S(w) for all words of the equations."""
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
        # d exp(c X) = exp(c X) X dc: the sums are those behind the operator by now.
        for w in range(1, len(parent)):
            if letter[w] == letters[i]:
                for u in range(unknowns):
                    slopes[w, u] += directions[i, u] * sums[parent[w]]
    return slopes
