"""The text that is compiled: sums over the words of a step, solutions from many points, and a descent along them.

``table`` is a ``conditions.WordTable`` as its arrays (parent, letter); a step comes as ``letters`` and coefficients
``c`` of its operators. exp(c X) behind a product adds c^k/k! S(v) to S(w) for w = v X^k. The tuples ``system``,
``criterion`` and ``scratch`` are described in the module ``kernels`` of this folder.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from nearharmonic.core.compile import strict
from nearharmonic.core.levenberg_marquardt import DampingRule, levenberg_marquardt, levenberg_step
from nearharmonic.experiments.sixth_order.conditions import NYSTROM_ORDER
from nearharmonic.experiments.sixth_order.criterion import (
    ANHARMONICITY,
    FARTHEST,
    HARMONIC_DEGREES,
    SCAN,
    TAU_PER_STAGE,
)

#: Norm of the residuals at which an iteration ends. They are in units of kappa, of which rounding leaves about 1e-13.
ENOUGH = 1e-12

RULE = DampingRule(
    step=levenberg_step,
    less=lambda damping: damping * 0.15,
    more=lambda damping: damping * 4.0,
    most=1e10,
    iterations=150,
    enough=ENOUGH,
    with_residuals=True,
)

#: Descent: length of the first random step, the factors after success and failure, and Newton steps per projection.
FIRST_LENGTH, LONGER, SHORTER = 0.05, 1.6, 0.85
MOST_PROJECTIONS = 8


@strict
def word_sums(table: Any, letters: Any, c: Any, sums: Any) -> None:
    """S(w) of all words, into ``sums``."""
    parent, letter = table
    for w in range(len(parent)):
        sums[w] = 0.0
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


@strict
def word_sums_and_slopes(table: Any, letters: Any, c: Any, directions: Any, sums: Any, slopes: Any) -> None:
    """S(w), and its derivatives (word, unknown), ``directions`` being those of ``c``."""
    parent, letter = table
    for w in range(len(parent)):
        sums[w] = 0.0
        for u in range(directions.shape[1]):
            slopes[w, u] = 0.0
    sums[0] = 1.0
    for i in range(len(letters)):
        for w in range(len(parent) - 1, 0, -1):
            if letter[w] == letters[i]:
                v, factor, k = parent[w], c[i], 1
                while True:
                    sums[w] += factor * sums[v]
                    for u in range(directions.shape[1]):
                        slopes[w, u] += factor * slopes[v, u]
                    if letter[v] != letters[i]:
                        break
                    k += 1
                    v, factor = parent[v], factor * c[i] / k
        # d exp(c X) = exp(c X) X dc: the sums are those behind the operator by now.
        for w in range(1, len(parent)):
            if letter[w] == letters[i]:
                for u in range(directions.shape[1]):
                    slopes[w, u] += directions[i, u] * sums[parent[w]]


@strict
def coefficients(directions: Any, offset: Any, x: Any, c: Any) -> None:
    """The coefficients of a step from its unknowns, into ``c``."""
    for i in range(len(c)):
        c[i] = offset[i]
        for u in range(len(x)):
            c[i] += directions[i, u] * x[u]


@strict
def residuals(system: Any, x: Any, F: Any, J: Any, scratch: Any) -> Any:
    """Residuals at ``x`` (unknown) and their derivatives (equation, unknown), into F and J; returns the norm of F."""
    table, letters, directions, offset, weights, wanted = system
    c, sums, slopes, _, _ = scratch
    coefficients(directions, offset, x, c)
    word_sums_and_slopes(table, letters, c, directions, sums, slopes)
    square = 0.0
    for e in range(len(wanted)):
        F[e] = -wanted[e]
        for u in range(len(x)):
            J[e, u] = 0.0
        for w in range(len(sums)):
            if weights[e, w] != 0.0:
                F[e] += weights[e, w] * sums[w]
                for u in range(len(x)):
                    J[e, u] += weights[e, w] * slopes[w, u]
        square += F[e] * F[e]
    return np.sqrt(square)


@strict
def merit(system: Any, criterion: Any, x: Any, scratch: Any) -> Any:
    """(e_N, e_H, A, tau*, J) of the solution ``x`` (unknown)."""
    _, letters, directions, offset, _, _ = system
    table, weights, wanted, places = criterion
    c, _, _, sums, above = scratch
    coefficients(directions, offset, x, c)
    word_sums(table, letters, c, sums)
    square = 0.0
    for e in range(len(wanted)):
        error = -wanted[e]
        for w in range(len(sums)):
            error += weights[e, w] * sums[w]
        square += error * error
    stages = len(letters) // 2
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
    limit = first_gap(sums, places, above)
    value = np.log10((harmonic + ANHARMONICITY * nystrom) * (size / 2) * (2 * stages / limit))
    return nystrom, harmonic, size, limit, value


@strict
def first_gap(sums: Any, places: Any, above: Any) -> Any:
    """tau*: the first step size at which K12 or K21 vanishes, behind which (tr K / 2)^2 - 1 = K12 K21 is positive.

    Both are sums over the alternating words, (-1)^j S(w) tau^(2j + 1) for the word of 2j + 1 letters.
    """
    above[0] = above[1] = 1.0
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


solve = levenberg_marquardt(residuals, RULE)


@strict
def within(x: Any, bound: Any) -> Any:
    """Whether ``x`` is within [-bound, bound]."""
    inside = True
    for u in range(len(x)):
        inside = inside and abs(x[u]) <= bound
    return inside


@strict
def project(system: Any, x: Any, work: Any, scratch: Any) -> Any:
    """Move ``x`` to the solution next to it, by Newton's method with the shortest steps; whether that was reached."""
    F, _, J, _, matrix, step, _ = work
    for _ in range(MOST_PROJECTIONS):
        size = residuals(system, x, F, J, scratch)
        if size < ENOUGH:
            return True
        if not size < 1.0:
            break
        levenberg_step(F, J, 0.0, matrix, step)
        for u in range(len(x)):
            x[u] -= step[u]
    return False


@strict
def descend(system: Any, criterion: Any, bound: Any, noise: Any, x: Any, work: Any, scratch: Any) -> None:
    """Lower J for each of ``x``, solutions, by ``noise``, in place.

    A random step, projected back on the solutions, is kept if J gets less; its length adapts to success.
    """
    trial = work[-1]
    for walk in range(x.shape[0]):
        length, least = FIRST_LENGTH, merit(system, criterion, x[walk], scratch)[4]
        for step in range(noise.shape[1]):
            for u in range(len(trial)):
                trial[u] = x[walk, u] + length * noise[walk, step, u]
            better = False
            if project(system, trial, work, scratch) and within(trial, bound):
                value = merit(system, criterion, trial, scratch)[4]
                better = value < least
            if better:
                for u in range(len(trial)):
                    x[walk, u] = trial[u]
                least = value
                length *= LONGER
            else:
                length *= SHORTER
            # A walk that has come to rest begins again at a coarse scale: gaps of stability make cliffs.
            if length < 1e-7:
                length = FIRST_LENGTH


@strict
def assess(system: Any, criterion: Any, x: Any, merits: Any, scratch: Any) -> None:
    """What :func:`merit` says of each of ``x``, into ``merits``."""
    for i in range(x.shape[0]):
        merits[i, 0], merits[i, 1], merits[i, 2], merits[i, 3], merits[i, 4] = merit(system, criterion, x[i], scratch)
