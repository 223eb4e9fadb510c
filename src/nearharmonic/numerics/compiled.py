"""Compiled numerics: searches for zeros, exponential and logarithm, and random numbers."""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Callable
from dataclasses import dataclass
from math import factorial, frexp, inf
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

from nearharmonic.core.numba_code import jit, jit_compiled, types
from nearharmonic.errors import bad_setting
from nearharmonic.math import cos, log
from nearharmonic.numerics.portable import Floats

#: Decorator of loops that are compiled with their callers.
compiled = jit_compiled

# --- Levenberg-Marquardt iteration, for at most as many equations as unknowns.
#
# An iteration from x subtracts the shortest step that solves the damped equations. With residuals F and their
# Jacobian J the step is J^T (J J^T + damping D)^-1 F, where D is the identity (Levenberg) or the diagonal of J J^T
# (Marquardt). A step that lowers the residuals is accepted, and the damping falls; otherwise the damping rises.
# Without damping, and with every step taken, the iteration is a projection on the solutions by Newton's method.
#
# A problem is two compiled functions: ``residuals(problem, x)`` returns F, its size, and intermediate results, which
# ``slopes(problem, x, intermediate)`` reuses for J.
#
# K. Levenberg, Quart. Appl. Math. 2, 164 (1944); D. W. Marquardt, J. Soc. Indust. Appl. Math. 11, 431 (1963).


class Damping(NamedTuple):
    """Settings of an iteration. By default it takes steps of Newton's method while they lower the residuals."""

    iterations: int  # maximum number of steps
    #: The iteration ends at residuals of at most size ``enough``, or of ``lost`` or more.
    enough: float = -1.0
    lost: float = inf
    #: The end is a solution if the size of the residuals is below ``solved``, or after a step with a damping below
    #: ``undamped`` that moved no unknown by more than ``rest`` times the larger of 1 and the largest unknown. Such a
    #: step ends the iteration.
    solved: float = 0.0
    rest: float = 0.0
    undamped: float = 0.0
    first: float = 0.0  # damping at the start
    most: float = inf  # a damping above it ends the iteration
    fall: tuple[float, float] = (1.0, 1.0)  # factor of the damping after an accepted step, as a fraction
    rise: float = 1.0  # factor after a rejected step
    lowest: tuple[float, float] = (0.0, 0.0)  # smallest damping after an accepted step, and after a rejected one
    by_residual: bool = False  # the damping is multiplied by the size of the residuals, if this is below 1
    bounded: bool = False  # the iteration ends outside the bound
    monotone: bool = True  # only steps that lower the residuals are accepted


def iteration(residuals: Any, slopes: Any, step_of: Any) -> Callable[[Any, Floats, float, Damping], bool]:
    """Return the iteration by steps of ``step_of``, one of the two below, for the compiled functions of a problem.

    It takes a problem, a point (unknown,), a bound and a damping. It moves the point in place, and returns True if the
    end is a solution in [-bound, bound].
    """

    @compiled
    def iterate(problem: Any, x: Floats, bound: float, damping: Damping) -> bool:
        F, size, found = residuals(problem, x)
        J, matrix = np.empty((len(F), len(x))), np.empty((len(F) + 1, len(F) + 1))
        step, moved = np.empty(len(x)), np.empty(len(x))
        amount, moves, at_rest = damping.first, True, False
        for _ in range(damping.iterations):
            if at_rest or not damping.enough < size < damping.lost or amount > damping.most:
                break
            if damping.bounded and not _within(x, bound):
                break
            if moves:
                J = slopes(problem, x, found)
            # Damping that falls with the residuals does not spoil the quadratic end.
            if not step_of(F, J, amount * (min(size, 1.0) if damping.by_residual else 1.0), matrix, step):
                break
            farthest, length = 0.0, 0.0
            for u in range(len(x)):
                farthest = max(farthest, abs(x[u]))
                length = max(length, abs(step[u]))
                moved[u] = x[u] - step[u]
            trial_F, trial_size, trial_found = residuals(problem, moved)
            at_rest = length <= damping.rest * max(1.0, farthest) and amount < damping.undamped
            moves = trial_size < size or at_rest or not damping.monotone
            if moves:
                x[:] = moved
                F, size, found = trial_F, trial_size, trial_found
                amount = max(amount * damping.fall[0] / damping.fall[1], damping.lowest[0])
            else:
                amount = max(amount * damping.rise, damping.lowest[1])
        return (at_rest or size < damping.solved) and _within(x, bound)

    made: Callable[[Any, Floats, float, Damping], bool] = iterate
    return made


@jit
def _within(x: Floats, bound: float) -> bool:
    inside = True
    for u in range(len(x)):
        inside = inside and abs(x[u]) <= bound
    return inside


@jit
def levenberg_step(F: Floats, J: Floats, damping: float, matrix: Floats, step: Floats) -> bool:
    """J^T (J J^T + damping)^-1 F by Cholesky factorization, into ``step``; NaN if the inverse does not exist.

    ``matrix`` (equation + 1, equation + 1) is overwritten. Always True: a step of NaN lowers no residuals.
    """
    m = len(F)
    _normal_equations(F, J, matrix)
    for i in range(m):
        matrix[i, i] += damping
    for j in range(m):
        for i in range(j, m + 1):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            if i > j:
                matrix[i, j] /= matrix[j, j]
            else:
                matrix[j, j] = np.sqrt(matrix[j, j]) if matrix[j, j] > 0.0 else np.nan
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            matrix[m, i] -= matrix[k, i] * matrix[m, k]
        matrix[m, i] /= matrix[i, i]
    _combined_rows(J, matrix[m], step)
    return True


@jit
def marquardt_step(F: Floats, J: Floats, damping: float, matrix: Floats, step: Floats) -> bool:
    """J^T (J J^T + damping diag(J J^T))^-1 F by pivoting, into ``step``; False if singular. ``matrix``: as above."""
    m = len(F)
    _normal_equations(F, J, matrix)
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
    _combined_rows(J, matrix[:, m], step)
    return True


@jit
def _normal_equations(F: Floats, J: Floats, matrix: Floats) -> None:
    """J J^T, with F as the last row and as the last column."""
    for i in range(len(F)):
        for j in range(i + 1):
            total = 0.0
            for k in range(J.shape[1]):
                total += J[i, k] * J[j, k]
            matrix[i, j] = matrix[j, i] = total
        matrix[i, -1] = matrix[-1, i] = F[i]


@jit
def _combined_rows(J: Floats, y: Floats, step: Floats) -> None:
    """J^T y."""
    for u in range(len(step)):
        step[u] = 0.0
        for i in range(len(J)):
            step[u] += J[i, u] * y[i]


# --- Distinct points among many that lie close together.
def distinct(points: Floats, closest: float, *, relative: bool = False, most: float = inf) -> tuple[Floats, list[int]]:
    """Return ``points`` (R, n) that are far from all before, at most ``most``, and the number near each.

    Points are near if no unknown differs by more than ``closest``, which is ``relative`` to the largest unknown of a
    point if that is above 1.
    """
    kept: list[Floats] = []
    hits: list[int] = []
    order: list[tuple[float, int]] = []  # of those that are kept, by the first unknown
    for x in points:
        reach = closest * max(1.0, float(np.abs(x).max())) if relative else closest
        window = order[bisect_left(order, (x[0] - reach, 0)) : bisect_right(order, (x[0] + reach, len(points)))]
        near = [i for _, i in window if np.abs(x - kept[i]).max() <= reach]
        if near:
            hits[min(near)] += 1
        elif len(kept) < most:
            insort(order, (x[0], len(kept)))
            kept.append(x)
            hits.append(1)
    return np.array(kept).reshape(len(kept), points.shape[1]), hits


# --- Settings of a search from random points.
@dataclass(frozen=True)
class RandomStarts:
    """Random points that a search begins from, and which of its ends count."""

    count: int  # number of points, at least 1
    seed: int | tuple[int, ...]  # the same seed gives the same points
    box: float = 1.0  # unknowns, which are pure numbers, start uniformly in [-box, box]
    bound: float = 10.0  # solutions with an unknown beyond it in absolute value are dropped
    #: Solutions whose unknowns differ by less are one. Newton's method leaves about 1e-12, and distinct isolated
    #: solutions lie 1e-2 apart.
    same: float = 1e-6

    def __post_init__(self) -> None:
        count: Any = self.count  # a user may pass anything
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise bad_setting("starts", count, "an integer >= 1")

    def generator(self) -> np.random.Generator:
        """Return the generator of all random numbers of a search."""
        return np.random.default_rng(self.seed)

    def points(self, generator: np.random.Generator, unknowns: int, most: int | None = None) -> Floats:
        """Return the next points (start, unknown), all or ``most`` of them."""
        return generator.uniform(-self.box, self.box, (most or self.count, unknowns))


# --- Random numbers, exponential and logarithm for loops of experiments: unlike in libm, their bits are equal on
# every processor. :mod:`nearharmonic.math` has the same functions for kernels, which numba cannot vectorise.

#: ln 2 in two parts; a multiple below 2^20 of the first is exact. With the second number a sum is rounded to a whole
#: number, whose bits are the last of the sum.
_LN2, _ROUND = (0.6931471803691238, 1.9082149292705877e-10), 1.5 * 2.0**52
_F = tuple(1 / factorial(k) for k in range(14))
_WORD = ir.IntType(64)


@intrinsic
def _power_of_two(typing, rounded):  # type: ignore[no-untyped-def]
    """Return 2^k for k + _ROUND, from its last bits."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        exponent = builder.add(builder.bitcast(values[0], _WORD), _WORD(1023))
        return builder.bitcast(builder.shl(exponent, _WORD(52)), ir.DoubleType())

    return types.float64(types.float64), codegen


@compiled
def exponential(x):  # type: ignore[no-untyped-def]
    """Return exp(x) to about 1 ulp, 0 or infinity beyond 700.

    There is no branch, so that a loop over an array has several values in a vector.
    """
    inside = x if x < 700.0 else 700.0
    inside = inside if inside > -700.0 else -700.0
    rounded = inside * 1.4426950408889634 + _ROUND
    whole = rounded - _ROUND
    r = (inside - whole * _LN2[0]) - whole * _LN2[1]
    square = r * r
    total = _F[12] + r * _F[13]  # pairs of terms, which a processor sums side by side
    total = _F[10] + r * _F[11] + square * total
    total = _F[8] + r * _F[9] + square * total
    total = _F[6] + r * _F[7] + square * total
    total = _F[4] + r * _F[5] + square * total
    total = _F[2] + r * _F[3] + square * total
    found = (1.0 + (r + square * total)) * _power_of_two(rounded)
    return 0.0 if x < -700.0 else (found if x <= 700.0 else np.inf)


@compiled
def logarithm(x):  # type: ignore[no-untyped-def]
    """Return log(x) of a positive number to about 1 ulp, by the series of artanh; infinite for any other."""
    if not 0.0 < x < np.inf:
        return np.inf
    m, e = frexp(x)
    if m < 0.7071067811865476:
        m, e = 2.0 * m, e - 1
    y = (m - 1.0) / (m + 1.0)
    square, total = y * y, 0.0
    for k in range(21, 0, -2):
        total = 1.0 / k + square * total
    return (e * _LN2[1] + 2.0 * y * total) + e * _LN2[0]


class Normal:
    """Normally distributed numbers with equal bits on every processor: the method of Box and Muller (1958)."""

    def __init__(self, seed: list[int]) -> None:
        self.uniform = np.random.default_rng(seed)

    def rows(self, count: int, n: int) -> Floats:
        """Return ``count`` rows of n numbers of variance 1."""
        u, v = (self.uniform.random((count, n)) for _ in range(2))
        return np.asarray(np.sqrt(-2.0 * log(1.0 - u)) * cos(2 * np.pi * v))
