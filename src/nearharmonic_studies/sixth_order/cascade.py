"""Search for sixth-order near-harmonic methods: a cascade of random starts, a ranking, and registration."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from math import inf

import numpy as np
from mpmath import mp, mpf

from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.numerics.compiled import RandomStarts, distinct
from nearharmonic.output.table import progress
from nearharmonic.training.objective import tableau_of
from nearharmonic_studies.sixth_order.criterion import (
    NYSTROM_ORDER,
    Doubles,
    Merit,
    NystromEquations,
    criterion_of,
    system_of,
)
from nearharmonic_studies.sixth_order.kernels import Walk, assess, descend, solve
from nearharmonic_studies.sixth_order.settings import SixthOrderSettings

# --- Search for sixth-order near-harmonic methods: a cascade of random starts, walks along families, and a ranking.
#
# For each number of stages and each first operator, the search from random points finds solutions of order six.
# Starts near these find solutions of the next harmonic order, and so on until there are no free parameters. Without
# the cascade one of fifty random starts would find an isolated solution of eight stages, and one of thousands a
# solution of ten.

#: Bound of the unknowns of the solutions that are kept: methods with longer substeps are not useful.
BOUND = 2.0
#: Standard deviation and maximum number of the starts near a solution, for the search at the next harmonic order.
NEAR, MOST_NEAR = 0.1, 20
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
    stages: tuple[int, ...] = (7, 8, 9, 10, 11),
    firsts: tuple[First, ...] = ("kick", "drift"),
    threads: int = 1,
) -> Findings:
    """Find and rank solutions of Nystrom order six for all stages, first operators and harmonic orders.

    With fewer than 7 stages there is no solution; more than 11 have not been searched. The result does not depend on
    ``threads``.
    """
    # The longest tasks first, so that all threads finish together.
    tasks = [(s, first) for s in sorted(stages, reverse=True) for first in firsts]
    with ThreadPoolExecutor(threads) as pool:
        found = list(pool.map(lambda task: list(_cascade(task[0], task[1], settings)), tasks))
    levels = [level for levels in found for level in levels]
    counts = sorted((count for count, _ in levels), key=lambda c: (c.stages, c.first, c.harmonic_order))
    candidates = sorted((c for _, best in levels for c in best), key=lambda c: (c.merit.value, c.unknowns))
    return Findings(tuple(counts), tuple(candidates))


def winners(findings: Findings) -> tuple[Candidate, ...]:
    """Return the four best candidates of a harmonic order above their order, one per number of stages and composition.

    Candidates of one family, and of successive harmonic orders, are similar: one represents all.
    """
    chosen: dict[tuple[int, First], Candidate] = {}
    for candidate in findings.candidates:
        if candidate.harmonic_order > NYSTROM_ORDER:
            chosen.setdefault((candidate.stages, candidate.first), candidate)
    return tuple(chosen.values())[:4]


def _cascade(stages: int, first: First, settings: SixthOrderSettings) -> Iterator[tuple[Count, list[Candidate]]]:
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
        progress(_sentence(count, best))
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
    equations: NystromEquations,
    samples: Doubles,
    settings: SixthOrderSettings,
    random: np.random.Generator,
) -> Doubles:
    """Return the distinct ends of walks from the best ``samples`` (solution, unknown) of a family."""
    values = assessed(equations, samples)[:, 4]
    ends, _ = distinct(samples[np.argsort(values, kind="stable")], APART, most=settings.walks)
    noise = random.normal(0, 1, (len(ends), settings.walk_steps, equations.unknowns))
    ends = descend(system_of(equations), criterion_of(equations.stages), BOUND, Walk(), noise, ends)
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


# --- Conversion of a candidate in doubles to a registered tableau: name, rounded free parameters, and all digits.
#
# Newton's method in multiprecision gives any number of digits; free parameters are fixed as short decimals.

#: Decimals of rounded free parameters: the criterion changes by less than 1e-3.
DECIMALS = 4


def registered(candidate: Candidate, *, source: str, digits: int = 76) -> Tableau:
    """Return the tableau of a candidate, with a name like in the paper and the order before the harmonic order.

    Raises NotConvergedError: the equations have no solution near the rounded candidate.
    """
    equations = NystromEquations(candidate.stages, candidate.first, candidate.harmonic_order)
    fixed = short_decimals(equations, candidate.unknowns, DECIMALS)
    stem, order = f"{candidate.composition}s{candidate.stages}o{NYSTROM_ORDER}", candidate.harmonic_order
    values = " and ".join(fixed[u] for u in sorted(fixed))
    note = f"{len(fixed)} free, fixed at {values}" if fixed else "nothing is free"
    return tableau_of(
        equations, candidate.unknowns, digits=digits, fixed=fixed, nearest=inf, name=f"{stem.lower()}_{order}h",
        label=f"{stem},{order}H", source=source, note=note, harmonic_order=order,
    )  # fmt: skip


def short_decimals(equations: NystromEquations, x: Sequence[float], decimals: int) -> dict[int, str]:
    """Choose the free parameters of a family: the unknowns that vary most along it at the solution ``x``.

    The other unknowns are then well-conditioned functions of them. The result has the value of each chosen unknown,
    rounded to ``decimals``, by its index.
    """
    with mp.workdps(40):
        J = np.array(equations.slopes(list(map(mpf, x))), dtype=float)
    directions = np.linalg.svd(J)[2][equations.harmonic_order :].T
    chosen: dict[int, str] = {}
    for _ in range(equations.free):
        u = int(np.argmax(np.sum(directions**2, axis=1)))
        chosen[u] = f"{x[u]:.{decimals}f}"
        row = directions[u] / np.linalg.norm(directions[u])
        directions = directions - np.outer(directions @ row, row)
    return chosen
