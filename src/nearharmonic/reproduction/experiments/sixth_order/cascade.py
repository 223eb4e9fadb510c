"""The search for sixth-order near-harmonic methods: a cascade of random starts, families walked along, all ranked.

For each number of stages and each operator that comes first, random points lead to solutions of order six; these,
and points near them, to solutions with one harmonic order more, and so on until nothing is left free. One in fifty
random starts would find an isolated solution of eight stages, one in thousands those of ten: the cascade finds both.
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

#: Bound of the solutions that are kept: longer substeps serve nobody.
BOUND = 2.0
#: Standard deviation of the points near a solution from which one of the next harmonic order is sought.
NEAR = 0.1
#: At most so many points near each.
MOST_NEAR = 20
#: Walks along a family start from its best solutions that are this far apart, in the largest difference.
APART = 0.05


@dataclass(frozen=True)
class Count:
    """Search results of one kind: ``solutions`` are distinct ones, sampled ones if parameters are free."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    starts: int
    hits: int
    solutions: int


@dataclass(frozen=True)
class Candidate:
    """A solution: its unknowns, how many starts led there (0 after a walk along its family), and its merit."""

    stages: int
    first: First
    harmonic_order: int
    free: int
    unknowns: tuple[float, ...]
    hits: int
    merit: Merit

    @property
    def composition(self) -> str:
        """BAB if the kick comes first, else ABA."""
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
    """Find solutions of Nystrom order six for all stages, operators that come first and harmonic orders, and rank them.

    The result depends on everything but ``threads``.

    Parameters
    ----------
    settings : SixthOrderSettings
        How hard to search: there are ``starts`` points for each number of stages, operator and harmonic order, and
        ``walks`` along each family with free parameters, from its best solutions.
    stages : tuple of int
        Numbers of stages, from 7 to 11.
    firsts : tuple of str
        "kick", "drift" or both.
    threads : int, optional
        One per processor by default.
    report : callable
        Is told of each count when it is known, from the thread that made it.

    Raises
    ------
    SettingError
        ``starts``, ``walks`` or ``walk_steps`` below 1, stages outside 7 to 11, or an unknown operator.
    """
    for key in ("starts", "walks", "walk_steps"):
        value = getattr(settings, key)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise bad_setting(key, value, "an integer >= 1")
    # The longest first, so that no thread is left alone at the end.
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
    """The best candidates whose harmonic order exceeds their order, at most one per number of stages and composition.

    Within a family, and from one harmonic order to the next, candidates are neighbours: one of them speaks for all.
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
        # What the walks have found lies where good methods of the next harmonic order are.
        points = _near(np.concatenate([hits, solutions]), settings.starts, random)


def _near(hits: Doubles, wanted: int, random: np.random.Generator) -> Doubles:
    """About ``wanted`` points: each of ``hits`` and as many near it as that takes."""
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
    """(e_N, e_H, A, tau*, J) of each of ``solutions`` (solution, unknown)."""
    return assess(system_of(equations), criterion_of(equations.stages), solutions)


def candidates_of(equations: NystromEquations, solutions: Doubles, multiplicity: Sequence[int]) -> list[Candidate]:
    """``solutions`` (solution, unknown) with their merits, the best first."""
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
