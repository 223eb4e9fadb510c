"""Steps of the Levenberg-Marquardt iteration, for a number of equations not above that of the unknowns.

An iteration from x subtracts the shortest step that solves the damped equations. With residuals F and their Jacobian J
the step is J^T (J J^T + damping D)^-1 F, where D is the identity (Levenberg) or the diagonal of J J^T (Marquardt). If
the step lowers the residuals it is taken, and the damping is lowered; otherwise the damping is raised. The loops are in
the searches, which have different rules for the damping.

K. Levenberg, Quart. Appl. Math. 2, 164 (1944); D. W. Marquardt, J. Soc. Indust. Appl. Math. 11, 431 (1963).
"""

from __future__ import annotations

import numpy as np

from nearharmonic.core.layout import Floats
from nearharmonic.core.machine.jit import jit

FIRST_DAMPING = 1e-2


@jit
def levenberg_step(residuals: Floats, jacobian: Floats, damping: float, matrix: Floats, step: Floats) -> None:
    """J^T (J J^T + damping)^-1 F by Cholesky factorization, into ``step``; NaN if the inverse does not exist.

    ``matrix`` (equation, equation + 1) is overwritten.
    """
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


@jit
def marquardt_step(residuals: Floats, jacobian: Floats, damping: float, matrix: Floats, step: Floats) -> bool:
    """J^T (J J^T + damping diag(J J^T))^-1 F by pivoting, into ``step``; False if singular.

    ``matrix`` (equation, equation + 1) is overwritten.
    """
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


@jit
def _normal_equations(residuals: Floats, jacobian: Floats, matrix: Floats) -> None:
    """J J^T, followed by the right-hand side F as the last column."""
    m, n = jacobian.shape
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * jacobian[j, k]
            matrix[i, j] = matrix[j, i] = total
        matrix[i, m] = residuals[i]


@jit
def _combined_rows(jacobian: Floats, matrix: Floats, step: Floats) -> None:
    """J^T y, with y the last column of ``matrix``."""
    m, n = jacobian.shape
    for k in range(n):
        step[k] = 0.0
        for i in range(m):
            step[k] += jacobian[i, k] * matrix[i, m]
