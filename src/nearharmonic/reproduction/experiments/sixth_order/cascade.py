"""Search for sixth-order near-harmonic methods: a cascade of random starts, walks along families, and a ranking.

For each number of stages and each first operator, the search from random points finds solutions of order six. Starts
near these find solutions of the next harmonic order, and so on until there are no free parameters. Without the cascade
one of fifty random starts would find an isolated solution of eight stages, and one of thousands a solution of ten.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np

from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import First
from nearharmonic.numerics.search.distinct import distinct
from nearharmonic.numerics.search.random_starts import RandomStarts
from nearharmonic.reproduction.experiments.sixth_order.conditions import (
    NYSTROM_ORDER,
    STAGES,
    Doubles,
    NystromEquations,
)
from nearharmonic.reproduction.experiments.sixth_order.criterion import Merit, criterion_of, system_of
from nearharmonic.reproduction.experiments.sixth_order.kernels import assess, descend, solve
from nearharmonic.reproduction.experiments.sixth_order.settings import SixthOrderSettings

#: Bound of the solutions that are kept: methods with longer substeps are not useful.
BOUND = 2.0
#: Standard deviation of the starts near a solution for the search at the next harmonic order.
NEAR = 0.1
#: Maximum number of starts near each solution.
MOST_NEAR = 20
#: Minimum distance (largest difference) between the starts of walks along a family.
APART = 0.05


@dataclass(frozen=True)
class Count:
    """Search results of one kind; ``solutions`` counts distinct solutions, or samples with free parameters."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    starts: int
    hits: int
    solutions: int


@dataclass(frozen=True)
class Candidate:
    """A solution: unknowns, number of starts that led there (0 after a walk along its family), and merit."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    unknowns: tuple[float, ...]
    hits: int
    merit: Merit

    @property
    def composition(self) -> str:
        """BAB if the kick is first, else ABA."""
        return "BAB" if self.first == "kick" else "ABA"

    def row(self) -> dict[str, str | int | float]:
        """The line of a table."""
        plain: dict[str, str | int | float] = {
            "composition": self.composition,
            "stages": self.stages,
            "harmonic_order": self.harmonic_order,
            "free": self.free,
            "hits": self.hits,
        }
        unknowns = " ".join(f"{x:.15g}" for x in self.unknowns)
        return plain | asdict(self.merit) | {"unknowns": unknowns}


@dataclass(frozen=True)
class Findings:
    """``counts`` by stages, first and harmonic order; ``candidates`` by merit, the best first."""

    counts: tuple[Count, ...]
    candidates: tuple[Candidate, ...]


def find_solutions(
    settings: SixthOrderSettings,
    *,
    stages: tuple[int, ...] = tuple(STAGES),
    firsts: tuple[First, ...] = ("kick", "drift"),
    threads: int | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Findings:
    """Find and rank solutions of Nystrom order six for all stages, first operators and harmonic orders.

    The result does not depend on ``threads``.

    Parameters
    ----------
    settings : SixthOrderSettings
        Effort of the search: ``starts`` points for each number of stages, first operator and harmonic order, and
        ``walks`` along each family with free parameters, from its best solutions.
    stages : tuple of int
        Numbers of stages, from 7 to 11.
    firsts : tuple of str
        "kick", "drift" or both.
    threads : int, optional
        One per processor by default.
    report : callable
        Function that is called with each count, in the thread of its computation.

    Raises
    ------
    SettingError
        ``starts``, ``walks`` or ``walk_steps`` below 1, stages outside 7 to 11, or an unknown operator.
    """
    for key in ("starts", "walks", "walk_steps"):
        value = getattr(settings, key)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise bad_setting(key, value, "an integer >= 1")
    # The longest tasks first, so that all threads finish together.
    tasks = [(s, first) for s in sorted(stages, reverse=True) for first in firsts]
    for s, first in tasks:
        NystromEquations(s, first, NYSTROM_ORDER)
    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        found = list(pool.map(lambda task: list(_cascade(task[0], task[1], settings, report)), tasks))
    levels = [level for cascade in found for level in cascade]
    counts = sorted((count for count, _ in levels), key=lambda c: (c.stages, c.first, c.harmonic_order))
    candidates = sorted((c for _, best in levels for c in best), key=lambda c: (c.merit.value, c.unknowns))
    return Findings(tuple(counts), tuple(candidates))


def winners(findings: Findings, most: int = 4) -> tuple[Candidate, ...]:
    """Return the best candidates whose harmonic order exceeds their order, one per number of stages and composition.

    Candidates of one family, and of successive harmonic orders, are similar: one represents all.
    """
    chosen: dict[tuple[int, First], Candidate] = {}
    for candidate in findings.candidates:
        if candidate.harmonic_order > NYSTROM_ORDER:
            chosen.setdefault((candidate.stages, candidate.first), candidate)
    return tuple(chosen.values())[:most]


def _cascade(
    stages: int, first: First, settings: SixthOrderSettings, report: Callable[[str], None]
) -> Iterator[tuple[Count, list[Candidate]]]:
    starts = RandomStarts(settings.starts, (settings.seed, stages, first == "kick"), bound=BOUND)
    random = starts.generator()
    points = starts.points(random, stages - 1)
    for harmonic_order in range(NYSTROM_ORDER, stages):
        equations = NystromEquations(stages, first, harmonic_order)
        found, solved = solve(system_of(equations), points, starts.bound)
        hits = found[solved]
        solutions, multiplicity = distinct(hits[np.lexsort(hits.T[::-1])], starts.same)
        count = Count(stages, first, harmonic_order, equations.free, len(points), len(hits), len(solutions))
        if equations.free:
            solutions = _walked(equations, solutions, settings, random)
            best = candidates_of(equations, solutions, [0] * len(solutions))
        else:
            best = candidates_of(equations, solutions, multiplicity)
        report(_sentence(count, best))
        yield count, best
        # The ends of the walks are near good methods of the next harmonic order.
        points = _near(np.concatenate([hits, solutions]), settings.starts, random)


def _near(hits: Doubles, wanted: int, random: np.random.Generator) -> Doubles:
    """Return about ``wanted`` points: each of ``hits``, and points near it."""
    copies = min(MOST_NEAR, max(1, wanted // max(1, len(hits))))
    near = np.repeat(hits, copies, axis=0)[: max(wanted, len(hits))]
    noise = random.normal(0, NEAR, near.shape)
    noise[::copies] = 0
    return np.ascontiguousarray(near + noise)


def _walked(
    equations: NystromEquations, samples: Doubles, settings: SixthOrderSettings, random: np.random.Generator
) -> Doubles:
    """Return the distinct ends of walks from the best ``samples`` (solution, unknown) of a family."""
    values = assessed(equations, samples)[:, 4]
    ends, _ = distinct(samples[np.argsort(values, kind="stable")], APART, most=settings.walks)
    noise = random.normal(0, 1, (len(ends), settings.walk_steps, equations.unknowns))
    ends = descend(system_of(equations), criterion_of(equations.stages), BOUND, noise, ends)
    return distinct(ends[np.argsort(assessed(equations, ends)[:, 4], kind="stable")], APART)[0]


def assessed(equations: NystromEquations, solutions: Doubles) -> Doubles:
    """Return (e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    return assess(system_of(equations), criterion_of(equations.stages), solutions)


def candidates_of(equations: NystromEquations, solutions: Doubles, multiplicity: Sequence[int]) -> list[Candidate]:
    """Return ``solutions`` (solution, unknown) with their merits, the best first."""
    kind = (equations.stages, equations.first, equations.harmonic_order, equations.free)
    rows = [
        Candidate(*kind, tuple(map(float, x)), hits, Merit(*map(float, merit)))
        for x, hits, merit in zip(solutions, multiplicity, assessed(equations, solutions), strict=True)
    ]
    return sorted(rows, key=lambda row: row.merit.value)


def _sentence(count: Count, best: list[Candidate]) -> str:
    composition = "BAB" if count.first == "kick" else "ABA"
    kind = "isolated" if count.free == 0 else f"{count.free} free"
    merit = f", best J = {best[0].merit.value:.2f}" if best else ""
    return (
        f"{count.stages} stages, {composition}, harmonic order {count.harmonic_order} ({kind}): "
        f"{count.hits} of {count.starts} starts, {count.solutions} solutions{merit}"
    )
