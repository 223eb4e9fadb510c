"""The compiled part of the search: a damped Gauss-Newton iteration from many points, and the conditions in doubles.

A case comes as its numbers of ``stages`` s and of the ``highest`` harmonic order, and whether its outer row drifts. The
states of a step are series in tau, by powers from 0 to ``highest``.
"""

from __future__ import annotations

import numpy as np

from nearharmonic.core.layout import Flags, Floats
from nearharmonic.core.machine.jit import jit
from nearharmonic.numerics.levenberg_marquardt import FIRST_DAMPING, marquardt_step

#: Steps after which a start is given up; those that converge do so in 10 to 60.
ITERATIONS = 200
#: A start has converged when a full step moves no unknown by more than this times its size, or 1.
STEP = 1e-10
#: Damping below which a step is full, and beyond which a start is given up.
UNDAMPED, MOST_DAMPING = 1e-10, 1e12


@jit
def solve(stages: int, highest: int, drift_first: bool, points: Floats) -> Flags:
    """Move ``points`` (start, unknown), in place, to solutions; return at which of them the iteration came to rest."""
    converged = np.zeros(len(points), np.bool_)
    equations, unknowns = highest - 2, points.shape[1]
    matrix, step, moved = np.empty((equations, equations + 1)), np.empty(unknowns), np.empty(unknowns)
    for start in range(len(points)):
        x, damping, at_rest = points[start], FIRST_DAMPING, False
        rows = expand(stages, x)
        q, p = states(stages, highest, drift_first, rows)
        F, size = residuals(highest, q)
        J = slopes(stages, highest, drift_first, rows, q, p)
        for _ in range(ITERATIONS):
            if at_rest or np.isnan(size) or damping > MOST_DAMPING:
                break
            if not marquardt_step(F, J, damping, matrix, step):
                break
            farthest, length = 0.0, 0.0
            for k in range(unknowns):
                farthest = max(farthest, abs(x[k]))
                length = max(length, abs(step[k]))
                moved[k] = x[k] - step[k]
            rows = expand(stages, moved)
            q, p = states(stages, highest, drift_first, rows)
            trial_F, trial_size = residuals(highest, q)
            at_rest = length <= STEP * max(1.0, farthest) and damping < UNDAMPED
            if trial_size < size or at_rest:
                for k in range(unknowns):
                    x[k] = moved[k]
                F, size = trial_F, trial_size
                J = slopes(stages, highest, drift_first, rows, q, p)
                damping = max(damping / 10.0, 1e-16)
            else:
                damping = max(damping * 8.0, 1e-12)
        converged[start] = at_rest
    return converged


@jit
def residuals(highest: int, q: Floats) -> tuple[Floats, float]:
    """The signed kappa_3 ... kappa_highest, and the sum of their squares."""
    F = np.empty(highest - 2)
    scale, size = 2.0, 0.0
    for n in range(3, highest + 1):
        scale *= n
        F[n - 3] = (1.0 if n % 4 in (0, 3) else -1.0) - scale * q[-1, n]
        size += F[n - 3] * F[n - 3]
    return F, size


@jit
def expand(stages: int, x: Floats) -> Floats:
    """The 2s + 1 coefficients in the order of a step."""
    rows = np.empty(2 * stages + 1)
    cut = stages // 2
    for parity in range(2):
        length = stages + 1 - parity
        count, offset = (length - 1) // 2, parity * cut
        rest = 1.0
        for i in range(count):
            c = x[offset + i]
            rows[2 * i + parity] = c
            rows[2 * (length - 1 - i) + parity] = c
            rest -= 2.0 * c
        if length % 2 == 1:
            rows[2 * count + parity] = rest
        else:
            rows[2 * count + parity] = rest / 2
            rows[2 * count + 2 + parity] = rest / 2
    return rows


@jit
def states(stages: int, highest: int, drift_first: bool, rows: Floats) -> tuple[Floats, Floats]:
    """Positions and momenta (2s + 2, power of tau) between the operators of a step from q = -p = 1."""
    q, p = np.zeros((2 * stages + 2, highest + 1)), np.zeros((2 * stages + 2, highest + 1))
    q[0, 0], p[0, 0] = 1.0, -1.0
    for k in range(2 * stages + 1):
        for n in range(highest + 1):
            q[k + 1, n], p[k + 1, n] = q[k, n], p[k, n]
        if (k % 2 == 0) == drift_first:
            for n in range(highest):
                q[k + 1, n + 1] += rows[k] * p[k, n]
        else:
            for n in range(highest):
                p[k + 1, n + 1] -= rows[k] * q[k, n]
    return q, p


@jit
def slopes(stages: int, highest: int, drift_first: bool, rows: Floats, q: Floats, p: Floats) -> Floats:
    """The derivatives of kappa_3 ... kappa_highest (equation, unknown)."""
    jacobian = np.zeros((highest - 2, stages - 1))
    # The new position is alpha q + beta p of the state before an operator, followed backwards.
    alpha, beta = np.zeros(highest + 1), np.zeros(highest + 1)
    alpha[0] = 1.0
    cut = stages // 2
    for k in range(2 * stages, -1, -1):
        drifts = (k % 2 == 0) == drift_first
        parity, place = k % 2, k // 2
        length = stages + 1 - parity
        half = (length - 1) // 2
        place = min(place, length - 1 - place)
        offset, unknowns = (0, cut) if parity == 0 else (cut, stages - 1 - cut)
        scale = 2.0
        for n in range(3, highest + 1):
            scale *= n
            gradient = 0.0
            for i in range(n):
                gradient += -alpha[i] * p[k, n - 1 - i] if drifts else beta[i] * q[k, n - 1 - i]
            gradient *= scale
            if place < half:
                jacobian[n - 3, offset + place] += gradient
            else:
                share = 2.0 * gradient if length % 2 == 1 else gradient
                for j in range(unknowns):
                    jacobian[n - 3, offset + j] -= share
        for n in range(highest, 0, -1):
            if drifts:
                beta[n] += rows[k] * alpha[n - 1]
            else:
                alpha[n] -= rows[k] * beta[n - 1]
    return jacobian
