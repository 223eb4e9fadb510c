"""Many random starts in double: a damped Gauss-Newton iteration, compiled, and what it found with duplicates merged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numba import types

from nearharmonic.core.cache import compiled, core_digest, named, strict
from nearharmonic.derivation.equations import Equations
from nearharmonic.errors import bad_setting

#: Iterations after which a start is given up; those that converge do so in 10 to 60.
ITERATIONS = 200
#: A start has converged when a full step moves no unknown by more than this times its size, or 1.
STEP = 1e-10
#: Solutions closer than this times their size are one: Newton leaves about 1e-12, distinct solutions lie 1e-2 apart.
SAME = 1e-6
#: Starts per call of the kernel, between two reports.
BATCH = 4096


@dataclass(frozen=True)
class Found:
    """Solutions in double, most often hit first: ``points`` (solution, unknown), ``hits`` how many starts led there."""

    points: Any
    hits: tuple[int, ...]
    starts: int
    converged: int


def search(
    equations: Equations,
    *,
    starts: int,
    seed: int,
    box: float = 2.5,
    bound: float = 10.0,
    report: Callable[[str], None] = lambda _: None,
) -> Found:
    """The isolated solutions that ``starts`` random points lead to, with duplicates merged.

    Unknowns start uniformly in [-box, box]; solutions with an unknown beyond ``bound`` are dropped. The same seed gives
    the same solutions in the same order.

    Raises:
        SettingError: less than one start, or no isolated solutions: a free parameter is left.
    """
    if equations.free_parameters != 0:
        key = "harmonic_order"
        raise bad_setting(key, equations.harmonic_order, f"{equations.stages + 1}, which leaves nothing free")
    points = sample(equations, starts=starts, seed=seed, box=box, bound=bound, report=report)
    merged, hits = _merged(points)
    order = sorted(range(len(hits)), key=lambda i: (-hits[i], tuple(merged[i])))
    return Found(merged[order], tuple(hits[i] for i in order), starts, len(points))


def sample(
    equations: Equations,
    *,
    starts: int,
    seed: int,
    box: float = 1.0,
    bound: float = 10.0,
    report: Callable[[str], None] = lambda _: None,
) -> Any:
    """Points (solution, unknown) where the conditions hold, one per start that converged within ``bound``.

    With free parameters left, a start goes to a point near it by steps of least length: dense where the solution set
    faces the box, and no uniform sample of it.

    Raises:
        SettingError: ``starts`` is no integer >= 1, or more conditions than unknowns.
    """
    if isinstance(starts, bool) or not isinstance(starts, int) or starts < 1:
        key = "starts"
        raise bad_setting(key, starts, "an integer >= 1")
    if equations.free_parameters < 0:
        key = "harmonic_order"
        raise bad_setting(
            key, equations.harmonic_order, f"at most {equations.stages + 1} with {equations.stages} stages"
        )
    solve, generator, kept = _solver(), np.random.default_rng(seed), []
    for done in range(0, starts, BATCH):
        points = generator.uniform(-box, box, (min(BATCH, starts - done), equations.unknowns))
        converged = np.zeros(len(points), np.bool_)
        solve(points, converged, equations.stages, equations.harmonic_order, equations.first == "drift")
        kept.append(points[converged & (np.abs(points).max(axis=1) <= bound)])
        name = f"{equations.stages} stages, harmonic order {equations.harmonic_order}"
        report(f"{name}: {done + len(points)} of {starts} starts, {sum(map(len, kept))} converged")
    return np.concatenate(kept)


def _merged(points: Any) -> tuple[Any, list[int]]:
    merged: list[Any] = []
    hits: list[int] = []
    for point in points:
        for i, known in enumerate(merged):
            if np.abs(point - known).max() <= SAME * max(1.0, np.abs(known).max()):
                hits[i] += 1
                break
        else:
            merged.append(point)
            hits.append(1)
    return np.array(merged).reshape(len(merged), points.shape[1]), hits


def _expand(x, stages, rows):  # type: ignore[no-untyped-def]
    """The 2s + 1 coefficients in the order of a step, into ``rows``."""
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


def _evaluator(expand: Any) -> Any:
    def evaluate(x, stages, highest, drift_first, residuals, jacobian, rows, q, p, alpha, beta):  # type: ignore[no-untyped-def] # noqa: PLR0912
        """The signed kappa_3 ... kappa_highest and their derivatives.

        ``q`` and ``p`` (2s + 2, highest + 1) take the states between operators, by powers of tau; ``alpha`` and
        ``beta`` (highest + 1) what the new position is made of, followed backwards. Loops, because numba takes seconds
        to compile assignments of slices.
        """
        count = 2 * stages + 1
        expand(x, stages, rows)
        for n in range(highest + 1):
            q[0, n], p[0, n] = 0.0, 0.0
            alpha[n], beta[n] = 0.0, 0.0
        q[0, 0], p[0, 0], alpha[0] = 1.0, -1.0, 1.0
        for k in range(count):
            for n in range(highest + 1):
                q[k + 1, n], p[k + 1, n] = q[k, n], p[k, n]
            if (k % 2 == 0) == drift_first:
                for n in range(highest):
                    q[k + 1, n + 1] += rows[k] * p[k, n]
            else:
                for n in range(highest):
                    p[k + 1, n + 1] -= rows[k] * q[k, n]
        scale = 2.0
        for n in range(3, highest + 1):
            scale *= n
            residuals[n - 3] = (1.0 if n % 4 in (0, 3) else -1.0) - scale * q[count, n]
            for j in range(stages - 1):
                jacobian[n - 3, j] = 0.0
        cut = stages // 2
        for k in range(count - 1, -1, -1):
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

    return evaluate


def _least_step(residuals, jacobian, damping, matrix, step):  # type: ignore[no-untyped-def] # noqa: PLR0912
    """step = -J^T (J J^T + damping)^-1 residuals by Gaussian elimination; False if that is singular."""
    m, n = jacobian.shape
    for i in range(m):
        for j in range(m):
            total = 0.0
            for k in range(n):
                total += jacobian[i, k] * jacobian[j, k]
            matrix[i, j] = total
        matrix[i, i] *= 1.0 + damping
        matrix[i, m] = -residuals[i]
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
    for k in range(n):
        step[k] = 0.0
        for i in range(m):
            step[k] += jacobian[i, k] * matrix[i, m]
    return True


def _solving(evaluate: Any, least_step: Any) -> Callable[..., Any]:
    def solve(points, converged, stages, highest, drift_first):  # type: ignore[no-untyped-def]
        """Levenberg-Marquardt from each of ``points`` (start, unknown), in place."""
        m, n = highest - 2, stages - 1
        rows, q, p = (
            np.empty(2 * stages + 1),
            np.empty((2 * stages + 2, highest + 1)),
            np.empty((2 * stages + 2, highest + 1)),
        )
        alpha, beta = np.empty(highest + 1), np.empty(highest + 1)
        residuals, trial = np.empty(m), np.empty(m)
        jacobian, other = np.empty((m, n)), np.empty((m, n))
        matrix, step, moved = np.empty((m, m + 1)), np.empty(n), np.empty(n)
        for start in range(len(points)):
            x = points[start]
            damping = 1e-2
            evaluate(x, stages, highest, drift_first, residuals, jacobian, rows, q, p, alpha, beta)
            for _ in range(ITERATIONS):
                if not least_step(residuals, jacobian, damping, matrix, step):
                    break
                size, length = 1.0, 0.0
                for k in range(n):
                    moved[k] = x[k] + step[k]
                    size, length = max(size, abs(x[k])), max(length, abs(step[k]))
                evaluate(moved, stages, highest, drift_first, trial, other, rows, q, p, alpha, beta)
                old, new = 0.0, 0.0
                for i in range(m):
                    old += residuals[i] * residuals[i]
                    new += trial[i] * trial[i]
                if new < old or (length <= STEP * size and damping < 1e-10):
                    for k in range(n):
                        x[k] = moved[k]
                    residuals, trial = trial, residuals
                    jacobian, other = other, jacobian
                    if length <= STEP * size and damping < 1e-10:
                        converged[start] = True
                        break
                    damping = max(damping / 10.0, 1e-16)
                else:
                    damping = max(damping * 8.0, 1e-12)
                    if damping > 1e12:
                        break

    return solve


@cache
def _solver() -> Callable[..., Any]:
    key = sha256(core_digest().encode() + Path(__file__).read_bytes()).hexdigest()
    evaluate = strict(named(_evaluator(strict(named(_expand, key))), key))
    solve = named(_solving(evaluate, strict(named(_least_step, key))), key)
    signature = types.void(types.float64[:, ::1], types.boolean[::1], types.int64, types.int64, types.boolean)
    return compiled(solve, signature, key)
