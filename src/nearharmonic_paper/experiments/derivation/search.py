"""Search for solutions in double precision from random starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from nearharmonic.core.reals import jit
from nearharmonic.numerics.compiled import Damping, RandomStarts, distinct, iteration, marquardt_step
from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.output.table import progress
from nearharmonic_paper.experiments.derivation.conditions import Equations

# --- Compiled part of the search: conditions and derivatives in doubles, and the iteration from many points.
#
# A case has its number s of stages, its highest harmonic order, and a flag for drift as the outer row. The states of a
# step are series in tau, with powers from 0 to the highest order.

#: Maximum number of steps: convergent starts need 10 to 60 steps until no unknown changes.
DAMPING = Damping(
    iterations=200, rest=1e-10, undamped=1e-10, first=1e-2, fall=(1.0, 10.0), rise=8.0, lowest=(1e-16, 1e-12), most=1e12
)


class Case(NamedTuple):
    """Parameters of a case for the kernels."""

    stages: int
    highest: int
    drift_first: bool


@jit
def solve(case: Case, starts: Floats, bound: float) -> tuple[Floats, Bools]:
    """Iterate from ``starts`` (start, unknown); return the ends, and the mask of solutions in [-bound, bound]."""
    ends, solved = starts.copy(), np.zeros(len(starts), np.bool_)
    for start in range(len(starts)):
        solved[start] = iterate(case, ends[start], bound, DAMPING)
    return ends, solved


@jit
def residuals(case: Case, x: Floats) -> tuple[Floats, float, tuple[Floats, Floats, Floats]]:
    """Return signed kappa_3 ... kappa_highest, their sum of squares, and the coefficients and states of the step."""
    rows = expand(case.stages, x)
    q, p = states(case, rows)
    F = np.empty(case.highest - 2)
    scale, size = 2.0, 0.0
    for n in range(3, case.highest + 1):
        scale *= n
        F[n - 3] = (1.0 if n % 4 in (0, 3) else -1.0) - scale * q[-1, n]
        size += F[n - 3] * F[n - 3]
    return F, size, (rows, q, p)


@jit
def expand(stages: int, x: Floats) -> Floats:
    """Return the 2s + 1 coefficients in the order of a step."""
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
def states(case: Case, rows: Floats) -> tuple[Floats, Floats]:
    """Return positions and momenta (2s + 2, power of tau) between the operators of a step from q = -p = 1."""
    stages, highest, drift_first = case
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
def slopes(case: Case, x: Floats, step: tuple[Floats, Floats, Floats]) -> Floats:
    """Return the derivatives of kappa_3 ... kappa_highest (equation, unknown) at ``step`` (coefficients and states)."""
    stages, highest, drift_first = case
    rows, q, p = step
    jacobian = np.zeros((highest - 2, stages - 1))
    # The new position is alpha q + beta p of the state before an operator; alpha and beta are computed backwards.
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


iterate = iteration(residuals, slopes, marquardt_step)


# --- Random starts in double precision, and the distinct solutions that are found from them.

#: Number of starts per call of the kernel, between two reports.
BATCH = 4096


@dataclass(frozen=True)
class SearchResult:
    """Solutions in double, most frequent first: ``points`` (solution, unknown), ``hits`` (numbers of starts)."""

    points: Floats
    hits: tuple[int, ...]
    starts: int
    converged: int


def search(equations: Equations, starts: RandomStarts) -> SearchResult:
    """Return the distinct isolated solutions that are found from random points, without free parameters.

    Solutions are the same if they agree relative to their largest unknown.
    """
    points = sample(equations, starts)
    merged, hits = distinct(points, starts.same, relative=True)
    order = sorted(range(len(hits)), key=lambda i: (-hits[i], tuple(merged[i])))
    return SearchResult(merged[order], tuple(hits[i] for i in order), starts.count, len(points))


def sample(equations: Equations, starts: RandomStarts) -> Floats:
    """Return one solution (solution, unknown) per convergent start, in the order of the starts.

    With free parameters, a start converges to a point near it by steps of minimal length. The sample is not uniform.
    """
    case = Case(equations.stages, equations.harmonic_order, equations.first == "drift")
    generator, kept = starts.generator(), list[Floats]()
    for done in range(0, starts.count, BATCH):
        points = starts.points(generator, equations.unknowns, min(BATCH, starts.count - done))
        ends, solved = solve(case, points, starts.bound)
        kept.append(ends[solved])
        name = f"{equations.stages} stages, harmonic order {equations.harmonic_order}"
        progress(f"{name}: {done + len(points)} of {starts.count} starts, {sum(map(len, kept))} converged")
    return np.concatenate(kept)
