"""Many random starts in double precision, and the solutions that they lead to with duplicates merged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.numerics.search.distinct import distinct
from nearharmonic.reproduction.experiments.derivation.conditions import Equations
from nearharmonic.reproduction.experiments.derivation.search.kernels import Case, solve

#: Solutions closer than this times their size are one: Newton leaves about 1e-12, distinct solutions lie 1e-2 apart.
SAME = 1e-6
#: Starts per call of the kernel, between two reports.
BATCH = 4096


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
    merged, hits = distinct(points, SAME, relative=True)
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
    case = Case(equations.stages, equations.harmonic_order, equations.first == "drift")
    generator, kept = np.random.default_rng(seed), []
    for done in range(0, starts, BATCH):
        points = generator.uniform(-box, box, (min(BATCH, starts - done), equations.unknowns))
        ends, solved = solve(case, points, bound)
        kept.append(ends[solved])
        name = f"{equations.stages} stages, harmonic order {equations.harmonic_order}"
        report(f"{name}: {done + len(points)} of {starts} starts, {sum(map(len, kept))} converged")
    return np.concatenate(kept)
