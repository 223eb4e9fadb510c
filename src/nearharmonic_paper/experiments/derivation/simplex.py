"""The method of the paper: minimise max(kappa_1, ..., kappa_lambda) with an adaptive simplex in multiprecision.

Nelder & Mead's method with the coefficients of Gao & Han (2012), doi:10.1007/s10589-010-9329-3, which depend on the
dimension n: reflection 1, expansion 1 + 2/n, contraction 3/4 - 1/(2n), shrinkage 1 - 1/n. Numbers are integers in units
of 2^-bits; a product of 2048 bits with gmpy2 takes a tenth of the time of Python's integers, with the same result. The
objective is not smooth where two kappa are equal, and there the simplex collapses before the minimum. It then restarts
from its best point, with new random signs of the edges.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial
from operator import itemgetter
from time import perf_counter
from typing import Any, NamedTuple

from gmpy2 import mpz
from mpmath import mp, mpf

from nearharmonic.output.table import progress
from nearharmonic_paper.experiments.derivation.conditions import DERIVATIVES, Equations
from nearharmonic_paper.experiments.derivation.families import IsolatedSolutions

Vertex = tuple[int, list[int]]


#: A simplex has collapsed if its values agree to this number of bits.
COLLAPSED_BITS = 12
#: Inverse of the edges of a new simplex, and maximum ratio of edges to objective: with conditions as badly scaled as
#: those of the sets in Table 4, a solution is within this multiple of the objective.
LONGEST_EDGE, EDGE_FACTOR = 20, 10_000
#: Random starts are uniform in [-BOX, BOX].
BOX = 1.0
#: Distance from a root, as a decimal, below which the simplex has reached it.
NEAR = "1e-6"


class Simplex(NamedTuple):
    """Bits of the arithmetic, decimals to which kappa vanishes at a solution, and most evaluations from one point."""

    bits: int = 2048
    digits: int = 128
    evaluations: int = 40_000


#: The short run that selects random starts for long runs.
SHORT = Simplex(bits=192, digits=4, evaluations=800)


@dataclass(frozen=True)
class Minimum:
    """End of the simplex: ``unknowns`` (mpf) only if ``converged``, else the smallest value of the largest kappa."""

    converged: bool
    kappa_max: Any
    unknowns: tuple[Any, ...]
    evaluations: int
    restarts: int
    seconds: float


@dataclass(frozen=True)
class SimplexRun:
    """One run of the method of the paper, from ``start``: one of the ``promising`` among ``starts`` random points.

    ``reached`` is the index of the root to which it converged, and ``distance`` the largest difference of an unknown
    from this root; None if it did not converge, or not to a known root.
    """

    stages: int
    starts: int
    promising: int
    start: tuple[float, ...]
    outcome: Minimum
    reached: int | None
    distance: Any


def minimise(
    equations: Equations,
    start: Sequence[float],
    *,
    seed: int,
    settings: Simplex,
) -> Minimum:
    """Run the simplex from ``start`` until kappa_max < 10^-digits, or until the evaluations are spent."""
    bits, evaluations = settings.bits, settings.evaluations
    clock, generator, one = perf_counter(), random.Random(seed), mpz(1) << bits
    objective = _Objective(equations, bits)
    x = [mpz(round(c * 2**52)) << (bits - 52) for c in start]
    best: Vertex = objective(x), x
    tolerance, restarts = one // 10**settings.digits, -1
    while best[0] >= tolerance and objective.calls < evaluations:
        edge = min(one // LONGEST_EDGE, best[0] * EDGE_FACTOR)
        simplex = [best]
        for i in range(equations.unknowns):
            vertex = list(best[1])
            vertex[i] += edge if generator.random() < 0.5 else -edge
            simplex.append((objective(vertex), vertex))
        best = _collapse(simplex, objective, tolerance, settings)
        restarts += 1
        with mp.workprec(bits):
            progress(f"simplex: {objective.calls} evaluations, kappa_max {mp.nstr(mpf(max(best[0], 1)) / one, 3)}")
    converged = best[0] < tolerance
    with mp.workprec(bits):
        unknowns = tuple(mpf(c) / one for c in best[1]) if converged else ()
        kappa_max = mpf(best[0]) / one
    return Minimum(converged, kappa_max, unknowns, objective.calls, max(restarts, 0), perf_counter() - clock)


def promising_starts(
    equations: Equations,
    *,
    starts: int,
    seed: int,
) -> list[list[float]]:
    """Return the points among ``starts`` random ones from which a short run in low precision comes near a root.

    A start in a ridge of the maximum norm stalls at once in any precision; a short run detects this.
    """
    generator, found = random.Random(seed), []
    for number in range(starts):
        start = [generator.uniform(-BOX, BOX) for _ in range(equations.unknowns)]
        if minimise(equations, start, seed=number, settings=SHORT).converged:
            found.append(start)
            progress(f"simplex: {len(found)} of {number + 1} random starts lead near a root")
    return found


def simplex_runs(
    case: IsolatedSolutions,
    *,
    starts: int,
    seed: int,
    settings: Simplex,
) -> list[SimplexRun]:
    """Solve a case by the method of the paper, from every random point that a short run finds promising.

    ``starts`` is the number of random points, and ``seed`` the seed of these and of the simplex.
    """
    promising = promising_starts(case.equations, starts=starts, seed=seed)
    runs = []
    for start in promising:
        outcome = minimise(case.equations, start, seed=seed, settings=settings)
        reached, distance = _nearest_root(case, outcome, settings)
        runs.append(SimplexRun(case.equations.stages, starts, len(promising), tuple(start), outcome, reached, distance))
    return runs


def _nearest_root(case: IsolatedSolutions, outcome: Minimum, settings: Simplex) -> tuple[int | None, Any]:
    """Return the index of the root to which a simplex converged, and the distance of its end from the root."""
    with mp.workdps(settings.digits + 30):
        for number, other in enumerate(case.roots) if outcome.converged else ():
            centre = [mpf(c) for c in case.equations.halved(other.outer, other.inner)]
            apart = max(abs(a - b) for a, b in zip(outcome.unknowns, centre, strict=True))
            if apart < mpf(NEAR):
                return number, apart
    return None, None


def _collapse(
    simplex: list[Vertex], objective: Callable[[list[int]], int], tolerance: int, settings: Simplex
) -> Vertex:
    """Return the best vertex after collapse, convergence, or the last evaluation."""
    n, bits, by_value = len(simplex) - 1, settings.bits, itemgetter(0)
    one = mpz(1) << bits
    expansion, contraction = one + 2 * one // n, 3 * one // 4 - one // (2 * n)
    shrinkage = one - one // n
    simplex = sorted(simplex, key=by_value)
    while simplex[0][0] >= tolerance and objective.calls < settings.evaluations:  # type: ignore[attr-defined]
        (lowest, best), (highest, worst) = simplex[0], simplex[-1]
        if (highest - lowest) << COLLAPSED_BITS < lowest:
            break
        centroid = [sum(column) // n for column in zip(*(x for _, x in simplex[:-1]), strict=True)]
        reflected = _moved(objective, centroid, worst, one, bits)
        if reflected[0] < lowest:
            simplex[-1] = min(reflected, _moved(objective, centroid, worst, expansion, bits), key=by_value)
        elif reflected[0] < simplex[-2][0]:
            simplex[-1] = reflected
        else:
            outside = reflected[0] < highest
            contracted = _moved(objective, centroid, worst, contraction if outside else -contraction, bits)
            if contracted[0] < min(reflected[0], highest):
                simplex[-1] = contracted
            else:
                shrunk = [
                    [b + (shrinkage * (c - b) >> bits) for b, c in zip(best, x, strict=True)] for _, x in simplex[1:]
                ]
                simplex[1:] = [(objective(x), x) for x in shrunk]
        simplex.sort(key=by_value)
    return simplex[0]


def _moved(
    objective: Callable[[list[int]], int], centroid: list[int], worst: list[int], factor: int, bits: int
) -> Vertex:
    """Return the vertex at centroid + factor (centroid - worst)."""
    x = [c + (factor * (c - w) >> bits) for c, w in zip(centroid, worst, strict=True)]
    return objective(x), x


class _Objective:
    """max(kappa_1, ..., kappa_lambda) of a point, in units of 2^-bits, with the number of evaluations."""

    def __init__(self, equations: Equations, bits: int) -> None:
        self._equations, self._bits = equations, bits
        self._scale = [factorial(n) for n in range(equations.harmonic_order + 1)]
        self.calls = 0

    def __call__(self, x: list[int]) -> int:
        self.calls += 1
        bits, highest, s = self._bits, self._equations.harmonic_order, self._equations.stages
        one, cut = mpz(1) << bits, self._equations.halves[0]
        outer, inner = _closed(x[:cut], s + 1, one), _closed(x[cut:], s, one)
        q, p = [one] + [0] * highest, [-one] + [0] * highest  # by powers of tau
        kick, drift = (p, q, -1), (q, p, 1)
        of_outer, of_inner = (kick, drift) if self._equations.first == "kick" else (drift, kick)
        _shear(*of_outer, outer[0], bits)
        for c, d in zip(inner, outer[1:], strict=True):
            _shear(*of_inner, c, bits)
            _shear(*of_outer, d, bits)
        kappa = [abs(DERIVATIVES[n % 4] * one - self._scale[n] * q[n]) for n in range(1, highest + 1)]
        largest: int = max(kappa)
        return largest


def _shear(moved: list[int], by: list[int], sign: int, c: int, bits: int) -> None:
    """Add sign c tau ``by`` to ``moved``; tau shifts each coefficient by one power."""
    for n in range(len(moved) - 1, 0, -1):
        moved[n] += sign * (c * by[n - 1] >> bits)


def _closed(half: list[int], length: int, one: int) -> list[int]:
    rest = one - 2 * sum(half)
    return [*half, rest, *reversed(half)] if length % 2 else [*half, rest // 2, rest // 2, *reversed(half)]
