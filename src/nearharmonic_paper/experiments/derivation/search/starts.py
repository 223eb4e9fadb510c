"""Random starts in double precision, and the distinct solutions that are found from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.search import RandomStarts, distinct
from nearharmonic.output.table import progress
from nearharmonic_paper.experiments.derivation.conditions import Equations
from nearharmonic_paper.experiments.derivation.search.kernels import Case, solve

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
