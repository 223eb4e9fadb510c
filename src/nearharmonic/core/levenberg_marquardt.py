"""Levenberg-Marquardt iteration for fewer equations than unknowns, or as many: compiled text.

From x the iteration goes by the shortest step that solves the damped equations, F residuals and J their Jacobian:
J^T (J J^T + damping D)^-1 F, where D is the identity (Levenberg) or the diagonal of J J^T (Marquardt). A step that
lowers the residuals is taken and the damping lowered; otherwise the damping is raised.

K. Levenberg, Quart. Appl. Math. 2, 164 (1944); D. W. Marquardt, J. Soc. Indust. Appl. Math. 11, 431 (1963).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from nearharmonic.core.compile import strict

FIRST_DAMPING = 1e-2


@dataclass(frozen=True, kw_only=True)
class DampingRule:
    """How an iteration changes its damping and when it ends.

    Parameters
    ----------
    step : callable
        :func:`levenberg_step` or :func:`marquardt_step`.
    less, more : callable
        The damping after a step that is taken, and after one that is not, from the damping before.
    most : float
        Damping beyond which the iteration is given up.
    iterations : int
        Steps, taken or not, after which it is given up.
    enough : float
        Size of the residuals at which it ends.
    with_residuals : bool
        Whether the damping is multiplied by the size of the residuals where that is below 1.
    rest, undamped : float
        It comes to rest at a step that moves no unknown by more than ``rest`` times the largest, or 1, with a damping
        below ``undamped``.
    """

    step: Callable[..., bool]
    less: Callable[[float], float]
    more: Callable[[float], float]
    most: float
    iterations: int
    enough: float = -1.0
    with_residuals: bool = False
    rest: float = 0.0
    undamped: float = 0.0


def levenberg_marquardt(evaluate: Callable[..., float], rule: DampingRule) -> Callable[..., None]:
    """Jitted iteration from many points; its arguments: :func:`nearharmonic.core.layout.least_squares_signature`.

    Parameters
    ----------
    evaluate : callable
        Jitted ``evaluate(problem, x, residuals, jacobian, scratch)``: fills ``residuals`` (equation,) and ``jacobian``
        (equation, unknown), and returns the size of the residuals, by which points are compared.
    rule : DampingRule
        What differs between iterations.
    """
    shortest_step, less, more = rule.step, strict(rule.less), strict(rule.more)
    most, iterations, enough, with_residuals = rule.most, rule.iterations, rule.enough, rule.with_residuals
    rest, undamped = rule.rest, rule.undamped

    @strict
    def iterate(problem, points, bound, sizes, rested, work, scratch):  # type: ignore[no-untyped-def]
        residuals, trial_residuals, jacobian, trial_jacobian, matrix, step, moved = work
        for start in range(len(points)):
            x, damping, at_rest = points[start], FIRST_DAMPING, False
            size = evaluate(problem, x, residuals, jacobian, scratch)
            for _ in range(iterations):
                farthest, length = 0.0, 0.0
                for k in range(x.size):
                    farthest = max(farthest, abs(x[k]))
                if at_rest or not size > enough or damping > most or farthest > bound:
                    break
                # Damping that falls with the residuals does not spoil the quadratic end.
                weight = damping * min(size, 1.0) if with_residuals else damping
                if not shortest_step(residuals, jacobian, weight, matrix, step):
                    break
                for k in range(x.size):
                    moved[k] = x[k] - step[k]
                    length = max(length, abs(step[k]))
                trial_size = evaluate(problem, moved, trial_residuals, trial_jacobian, scratch)
                at_rest = length <= rest * max(1.0, farthest) and damping < undamped
                if trial_size < size or at_rest:
                    for k in range(x.size):
                        x[k] = moved[k]
                    size, damping = trial_size, less(damping)
                    residuals, trial_residuals = trial_residuals, residuals
                    jacobian, trial_jacobian = trial_jacobian, jacobian
                else:
                    damping = more(damping)
            sizes[start], rested[start] = size, at_rest

    return iterate


@strict
def levenberg_step(residuals, jacobian, damping, matrix, step):  # type: ignore[no-untyped-def]
    """J^T (J J^T + damping)^-1 F by Cholesky's factorization, into ``step``; nan if that inverse does not exist."""
    m = len(residuals)
    _normal_equations(residuals, jacobian, matrix)
    for i in range(m):
        matrix[i, i] += damping
    for j in range(m):
        for k in range(j):
            matrix[j, j] -= matrix[j, k] * matrix[j, k]
        matrix[j, j] = np.sqrt(matrix[j, j]) if matrix[j, j] > 0.0 else np.nan
        for i in range(j + 1, m):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] /= matrix[j, j]
    for i in range(m):
        for k in range(i):
            matrix[i, m] -= matrix[i, k] * matrix[k, m]
        matrix[i, m] /= matrix[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            matrix[i, m] -= matrix[k, i] * matrix[k, m]
        matrix[i, m] /= matrix[i, i]
    _combined_rows(jacobian, matrix, step)
    return True


@strict
def marquardt_step(residuals, jacobian, damping, matrix, step):  # type: ignore[no-untyped-def]
    """J^T (J J^T + damping diag(J J^T))^-1 F by elimination with pivots, into ``step``; False if that is singular."""
    m = len(residuals)
    _normal_equations(residuals, jacobian, matrix)
    for i in range(m):
        matrix[i, i] *= 1.0 + damping
    for i in range(m):
        pivot = i
        for j in range(i + 1, m):
            if abs(matrix[j, i]) > abs(matrix[pivot, i]):
                pivot = j
        if not abs(matrix[pivot, i]) > 0.0:
            return False
        for k in range(i, m + 1):
            matrix[i, k], matrix[pivot, k] = matrix[pivot, k], matrix[i, k]
        for j in range(i + 1, m):
            factor = matrix[j, i] / matrix[i, i]
            for k in range(i, m + 1):
                matrix[j, k] -= factor * matrix[i, k]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            matrix[i, m] -= matrix[i, k] * matrix[k, m]
        matrix[i, m] /= matrix[i, i]
    _combined_rows(jacobian, matrix, step)
    return True


@strict
def _normal_equations(residuals, jacobian, matrix):  # type: ignore[no-untyped-def]
    """J J^T, and behind it the right-hand side F."""
    m, n = jacobian.shape
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * jacobian[j, k]
            matrix[i, j] = matrix[j, i] = total
        matrix[i, m] = residuals[i]


@strict
def _combined_rows(jacobian, matrix, step):  # type: ignore[no-untyped-def]
    """J^T y, where y is the last column of ``matrix``."""
    m, n = jacobian.shape
    for k in range(n):
        step[k] = 0.0
        for i in range(m):
            step[k] += jacobian[i, k] * matrix[i, m]
