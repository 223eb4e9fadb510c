"""Many random starts in double: a damped Gauss-Newton iteration, compiled, and what it found with duplicates merged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.core.layout import (
    Group,
    flags,
    floats,
    integers,
    least_squares_signature,
    least_squares_workspace,
)
from nearharmonic.core.native import code_key, native
from nearharmonic.errors import bad_setting
from nearharmonic.experiments.derivation.conditions import Equations

#: Steps after which a start is given up; those that converge do so in 10 to 60.
ITERATIONS = 200
#: A start has converged when a full step moves no unknown by more than this times its size, or 1.
STEP = 1e-10
#: Solutions closer than this times their size are one: Newton leaves about 1e-12, distinct solutions lie 1e-2 apart.
SAME = 1e-6
#: Starts per call of the kernel, between two reports.
BATCH = 4096

#: Arguments of the compiled iteration.
SOLVE = least_squares_signature(
    Group("problem", (integers("stages"), integers("highest"), flags("drift_first"))),
    Group(
        "scratch",
        (
            floats("rows", 1),  # (2s + 1,) coefficients in the order of a step
            floats("q", 2),  # (2s + 2, highest + 1) states between operators, by powers of tau
            floats("p", 2),
            floats("alpha", 1),  # (highest + 1,) what the new position is made of, followed backwards
            floats("beta", 1),
        ),
    ),
)


@dataclass(frozen=True)
class SearchResult:
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
) -> SearchResult:
    """Return the isolated solutions that ``starts`` random points lead to, with duplicates merged.

    Parameters
    ----------
    equations : Equations
        As many conditions as unknowns.
    starts : int
        Number of random points, at least 1.
    seed : int
        The same seed gives the same solutions in the same order.
    box : float
        Unknowns, which are pure numbers, start uniformly in [-box, box].
    bound : float
        Solutions with an unknown beyond it in absolute value are dropped.
    report : callable
        Takes a line on the progress, after each batch of starts.

    Returns
    -------
    SearchResult
        The solutions, most often hit first.

    Raises
    ------
    SettingError
        Less than one start, or no isolated solutions: a free parameter is left.
    """
    if equations.free_parameters != 0:
        key = "harmonic_order"
        raise bad_setting(key, equations.harmonic_order, f"{equations.stages + 1}, which leaves nothing free")
    points = sample(equations, starts=starts, seed=seed, box=box, bound=bound, report=report)
    merged, hits = _merged(points)
    order = sorted(range(len(hits)), key=lambda i: (-hits[i], tuple(merged[i])))
    return SearchResult(merged[order], tuple(hits[i] for i in order), starts, len(points))


def sample(
    equations: Equations,
    *,
    starts: int,
    seed: int,
    box: float = 1.0,
    bound: float = 10.0,
    report: Callable[[str], None] = lambda _: None,
) -> Any:
    """Return points where the conditions hold, one per start that converged within ``bound``.

    With free parameters left, a start goes to a point near it by steps of least length: dense where the solution set
    faces the box, and no uniform sample of it.

    Parameters
    ----------
    equations, starts, seed, box, bound, report
        As for :func:`search`, but free parameters may be left.

    Returns
    -------
    (solution, unknown) array of float
        The points, in the order of their starts.

    Raises
    ------
    SettingError
        ``starts`` is no integer >= 1, or more conditions than unknowns.
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
        sizes, converged = np.zeros(len(points)), np.zeros(len(points), np.bool_)
        problem = equations.stages, equations.harmonic_order, equations.first == "drift"
        workspace = _workspace(equations.stages, equations.harmonic_order)
        solve(problem, points, np.inf, sizes, converged, *workspace)
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


@cache
def _solver() -> Callable[..., Any]:
    return native(f"derivation-{code_key(sources=[Path(__file__)])}", SOLVE, _machine_code)


def _workspace(stages: int, highest: int) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    count, powers = 2 * stages + 1, highest + 1
    scratch = tuple(np.zeros(shape) for shape in (count, (count + 1, powers), (count + 1, powers), powers, powers))
    return least_squares_workspace(highest - 2, stages - 1), scratch


def _machine_code() -> tuple[str, bytes]:
    from nearharmonic.core.compile import machine_code, strict
    from nearharmonic.core.levenberg_marquardt import DampingRule, levenberg_marquardt, marquardt_step

    rule = DampingRule(
        step=marquardt_step,
        less=lambda damping: max(damping / 10.0, 1e-16),
        more=lambda damping: max(damping * 8.0, 1e-12),
        most=1e12,
        iterations=ITERATIONS,
        rest=STEP,
        undamped=1e-10,
    )
    evaluate = strict(_evaluator(strict(_expand), strict(_states), strict(_slopes)))
    return machine_code(levenberg_marquardt(evaluate, rule), SOLVE)


def _evaluator(expand: Any, states: Any, slopes: Any) -> Callable[..., Any]:
    def evaluate(problem, x, residuals, jacobian, scratch):  # type: ignore[no-untyped-def]
        """The signed kappa_3 ... kappa_highest, their derivatives, and the sum of their squares."""
        stages, highest, drift_first = problem
        rows, q, p, alpha, beta = scratch
        expand(x, stages, rows)
        states(stages, highest, drift_first, rows, q, p)
        scale, size = 2.0, 0.0
        for n in range(3, highest + 1):
            scale *= n
            residuals[n - 3] = (1.0 if n % 4 in (0, 3) else -1.0) - scale * q[2 * stages + 1, n]
            size += residuals[n - 3] * residuals[n - 3]
        slopes(stages, highest, drift_first, rows, q, p, alpha, beta, jacobian)
        return size

    return evaluate


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


def _states(stages, highest, drift_first, rows, q, p):  # type: ignore[no-untyped-def]
    """The states between operators. Loops, because numba takes seconds to compile assignments of slices."""
    for n in range(highest + 1):
        q[0, n], p[0, n] = 0.0, 0.0
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


def _slopes(stages, highest, drift_first, rows, q, p, alpha, beta, jacobian):  # type: ignore[no-untyped-def]
    """The derivatives of kappa_3 ... kappa_highest, into ``jacobian``."""
    for n in range(highest + 1):
        alpha[n], beta[n] = 0.0, 0.0
    alpha[0] = 1.0
    for n in range(highest - 2):
        for j in range(stages - 1):
            jacobian[n, j] = 0.0
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
