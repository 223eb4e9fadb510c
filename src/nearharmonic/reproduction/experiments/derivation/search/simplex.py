"""The route of the paper: minimise max(kappa_1, ..., kappa_lambda) with an adaptive simplex in long arithmetic.

Nelder & Mead's method with the coefficients of Gao & Han (2012), doi:10.1007/s10589-010-9329-3, which depend on the
dimension n: reflection 1, expansion 1 + 2/n, contraction 3/4 - 1/(2n), shrinkage 1 - 1/n. Numbers are whole, in units
of 2^-bits; gmpy2's are the same as Python's, and a product of 2048 bits takes a tenth of the time. The objective has a
kink wherever two kappa are equal, and there the simplex collapses short of the minimum: it then starts afresh from its
best point, with edges whose signs are drawn anew.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial
from time import perf_counter
from typing import Any

from gmpy2 import mpz
from mpmath import mp, mpf

from nearharmonic.reproduction.experiments.derivation.conditions import DERIVATIVES, Equations
from nearharmonic.reproduction.experiments.derivation.isolated import IsolatedSolutions

Vertex = tuple[int, list[int]]


@dataclass(frozen=True, kw_only=True)
class Simplex:
    """Settings of the simplex.

    Attributes
    ----------
    bits : int
        Precision of the arithmetic.
    digits : int
        Decimals to which kappa vanishes at a solution.
    evaluations : int
        Most evaluations of the objective from one point.
    collapsed_bits : int
        A simplex has collapsed when its values agree to this many bits.
    longest_edge : int
        The inverse of the edges of a fresh simplex.
    edge_factor : int
        Edges are at most this many times the objective: a solution lies within that many times the objective where the
        conditions are as badly scaled as those of the sets in Table 4.
    """

    bits: int = 2048
    digits: int = 128
    evaluations: int = 40_000
    collapsed_bits: int = 12
    longest_edge: int = 20
    edge_factor: int = 10_000


#: The short run that tells whether a random start is worth a long one.
SHORT = Simplex(bits=192, digits=4, evaluations=800)


@dataclass(frozen=True)
class Minimum:
    """End of the simplex: ``unknowns`` (mpf) only if ``converged``, else the least value of the largest kappa."""

    converged: bool
    kappa_max: Any
    unknowns: tuple[Any, ...]
    evaluations: int
    restarts: int
    seconds: float


@dataclass(frozen=True)
class SimplexRun:
    """One run of the paper's route, from ``start``, one of the ``promising`` among ``starts`` random points.

    ``reached`` is the number of the root it converged to and ``distance`` the largest difference of an unknown from
    that root; None where it did not converge, or not to a root that is known.
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
    settings: Simplex = Simplex(),
    report: Callable[[str], None] = lambda _: None,
) -> Minimum:
    """The simplex from ``start`` until kappa_max < 10^-digits, or until the evaluations are used up."""
    bits, evaluations = settings.bits, settings.evaluations
    clock, generator, one = perf_counter(), random.Random(seed), mpz(1) << bits
    objective = _Objective(equations, bits)
    x = [mpz(round(c * 2**52)) << (bits - 52) for c in start]
    best: Vertex = objective(x), x
    tolerance, restarts = one // 10**settings.digits, -1
    while best[0] >= tolerance and objective.calls < evaluations:
        edge = min(one // settings.longest_edge, best[0] * settings.edge_factor)
        simplex = [best]
        for i in range(equations.unknowns):
            vertex = list(best[1])
            vertex[i] += edge if generator.random() < 0.5 else -edge
            simplex.append((objective(vertex), vertex))
        best = _collapse(simplex, objective, tolerance, settings)
        restarts += 1
        report(f"simplex: {objective.calls} evaluations, kappa_max {_decimal_exponent(best[0], bits)}")
    converged = best[0] < tolerance
    with mp.workprec(bits):
        unknowns = tuple(mpf(c) / one for c in best[1]) if converged else ()
        kappa_max = mpf(best[0]) / one
    return Minimum(converged, kappa_max, unknowns, objective.calls, max(restarts, 0), perf_counter() - clock)


def promising_starts(
    equations: Equations, *, starts: int, seed: int, box: float = 1.0, report: Callable[[str], None] = lambda _: None
) -> list[list[float]]:
    """Return those of ``starts`` points in [-box, box] from which a short run in short arithmetic gets near a root.

    A start in a ridge of the max norm stalls at once, however long the arithmetic; a short run tells.
    """
    generator, found = random.Random(seed), []
    for number in range(starts):
        start = [generator.uniform(-box, box) for _ in range(equations.unknowns)]
        if minimise(equations, start, seed=number, settings=SHORT).converged:
            found.append(start)
            report(f"simplex: {len(found)} of {number + 1} random starts lead near a root")
    return found


def simplex_runs(
    case: IsolatedSolutions,
    *,
    starts: int,
    seed: int,
    settings: Simplex,
    report: Callable[[str], None] = lambda _: None,
) -> list[SimplexRun]:
    """Solve a case by the route of the paper, from every random point that a short run finds promising.

    Parameters
    ----------
    case : IsolatedSolutions
        The case, with the roots to compare with.
    starts, seed : int
        Number of random points, and the seed of these and of the simplex.
    settings : Simplex
        Of each run.
    report : callable
        Is told of the progress.
    """
    promising = promising_starts(case.equations, starts=starts, seed=seed, report=report)
    runs = []
    for start in promising:
        outcome = minimise(case.equations, start, seed=seed, settings=settings, report=report)
        reached, distance = _nearest_root(case, outcome, settings.digits)
        stages = case.equations.stages
        runs.append(SimplexRun(stages, starts, len(promising), tuple(start), outcome, reached, distance))
    return runs


def _nearest_root(case: IsolatedSolutions, outcome: Minimum, digits: int) -> tuple[int | None, Any]:
    """Number of the root that a simplex converged to, and how far from it the simplex ended."""
    with mp.workdps(digits + 30):
        for number, other in enumerate(case.roots) if outcome.converged else ():
            centre = [mpf(c) for c in case.equations.halved(other.outer, other.inner)]
            apart = max(abs(a - b) for a, b in zip(outcome.unknowns, centre, strict=True))
            if apart < mpf("1e-6"):
                return number, apart
    return None, None


def _collapse(
    simplex: list[Vertex], objective: Callable[[list[int]], int], tolerance: int, settings: Simplex
) -> Vertex:
    """The best vertex when the simplex has collapsed, converged, or used up the evaluations."""
    n, bits = len(simplex) - 1, settings.bits
    one = mpz(1) << bits
    expansion, contraction = one + 2 * one // n, 3 * one // 4 - one // (2 * n)
    shrinkage = one - one // n
    simplex = sorted(simplex, key=_first)
    while simplex[0][0] >= tolerance and objective.calls < settings.evaluations:  # type: ignore[attr-defined]
        (lowest, best), (highest, worst) = simplex[0], simplex[-1]
        if (highest - lowest) << settings.collapsed_bits < lowest:
            break
        centroid = [sum(column) // n for column in zip(*(x for _, x in simplex[:-1]), strict=True)]
        reflected = _moved(objective, centroid, worst, one, bits)
        if reflected[0] < lowest:
            simplex[-1] = min(reflected, _moved(objective, centroid, worst, expansion, bits), key=_first)
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
        simplex.sort(key=_first)
    return simplex[0]


def _moved(
    objective: Callable[[list[int]], int], centroid: list[int], worst: list[int], factor: int, bits: int
) -> Vertex:
    """The vertex at centroid + factor (centroid - worst)."""
    x = [c + (factor * (c - w) >> bits) for c, w in zip(centroid, worst, strict=True)]
    return objective(x), x


class _Objective:
    """max(kappa_1, ..., kappa_lambda) of a point, in units of 2^-bits, and how often it was asked for."""

    def __init__(self, equations: Equations, bits: int) -> None:
        self._equations, self._bits = equations, bits
        self._scale = [factorial(n) for n in range(equations.harmonic_order + 1)]
        self.calls = 0

    def __call__(self, x: list[int]) -> int:
        self.calls += 1
        bits, highest, s = self._bits, self._equations.harmonic_order, self._equations.stages
        one, cut = mpz(1) << bits, self._equations.outer_unknowns
        outer, inner = _closed(x[:cut], s + 1, one), _closed(x[cut:], s, one)
        own, other = [one] + [0] * highest, [-one] + [0] * highest  # position and momentum, by powers of tau
        if self._equations.first == "kick":
            _shear(other, own, outer[0], -1, bits)
        else:
            _shear(own, other, outer[0], 1, bits)
        for c, d in zip(inner, outer[1:], strict=True):
            if self._equations.first == "kick":
                _shear(own, other, c, 1, bits)
                _shear(other, own, d, -1, bits)
            else:
                _shear(other, own, c, -1, bits)
                _shear(own, other, d, 1, bits)
        kappa = [abs(DERIVATIVES[n % 4] * one - self._scale[n] * own[n]) for n in range(1, highest + 1)]
        largest: int = max(kappa)
        return largest


def _shear(moved: list[int], by: list[int], c: int, sign: int, bits: int) -> None:
    """moved += sign c tau by, with one power of tau more each."""
    for n in range(len(moved) - 1, 0, -1):
        moved[n] += sign * (c * by[n - 1] >> bits)


def _closed(half: list[int], length: int, one: int) -> list[int]:
    rest = one - 2 * sum(half)
    return [*half, rest, *reversed(half)] if length % 2 else [*half, rest // 2, rest // 2, *reversed(half)]


def _first(vertex: Vertex) -> int:
    return vertex[0]


def _decimal_exponent(number: int, bits: int) -> str:
    with mp.workprec(bits):
        return str(mp.nstr(mpf(max(number, 1)) / (1 << bits), 3))
