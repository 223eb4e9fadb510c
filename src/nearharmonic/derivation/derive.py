"""The whole derivation, from a seed to proved coefficients, and the comparison with what is printed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass
from functools import partial
from time import perf_counter
from typing import Any

from mpmath import mp, mpf

from nearharmonic.derivation.equations import Equations
from nearharmonic.derivation.families import (
    PRINTED,
    PrintedPoint,
    Ranking,
    agreeing_decimals,
    equations_of,
    printed_point,
    rank_printed,
)
from nearharmonic.derivation.growth import Reach, reach
from nearharmonic.derivation.isolated import CASES, Isolated, Root, solve
from nearharmonic.derivation.simplex import Minimised, minimise, promising_starts
from nearharmonic.integrators import integrators

#: The sets of Nielsen (2015), Table 4, that its conditions fix.
UNIQUE = ("abas5o6h", "abas5o6h_b", "abas5o6h_c", "babs6o7h")

Report = Callable[[str], None]


@dataclass(frozen=True)
class Agreement:
    """A printed set that is a derived root: number ``root`` of its case, equal to ``decimals`` decimals."""

    name: str
    root: int | None
    decimals: int


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
    outcome: Minimised
    reached: int | None
    distance: Any


@dataclass(frozen=True)
class Derivation:
    """Everything that is derived. ``seconds`` are wall times by part; they alone differ between two equal runs, besides
    the time that each simplex run took."""

    seed: int
    digits: int
    isolated: tuple[Isolated, ...]
    agreements: tuple[Agreement, ...]
    simplex: tuple[SimplexRun, ...]
    printed: tuple[PrintedPoint, ...]
    rankings: tuple[Ranking, ...]
    reaches: tuple[Reach, ...]
    seconds: Mapping[str, float]


def derive(
    *,
    seed: int,
    starts: int,
    family_starts: int,
    growth_starts: int,
    growth_stages: Sequence[int] = tuple(range(3, 11)),
    simplex_stages: Sequence[int] = (5,),
    simplex_starts: int = 1500,
    simplex_evaluations: int = 25_000,
    digits: int = 128,
    report: Report = lambda _: None,
) -> Derivation:
    """Derive the sets of Nielsen (2015), Table 4; the table itself is read only to compare.

    ``simplex_stages`` are the isolated cases to solve by the paper's route too: from those of ``simplex_starts`` random
    points that a short run finds promising, with at most ``simplex_evaluations`` of the objective each.

    Raises:
        SettingError: a number of starts below 1, or of stages below 3.
    """
    seconds: dict[str, float] = {}

    def timed(part: str, work: Callable[[], Any]) -> Any:
        clock = perf_counter()
        outcome = work()
        seconds[part] = perf_counter() - clock
        report(f"{part}: {seconds[part]:.1f} s")
        return outcome

    isolated: list[Isolated] = []
    for stages, order in CASES:
        equations = Equations(stages, order)
        work = partial(solve, equations, starts=starts, seed=seed, digits=digits, report=report)
        isolated.append(timed(f"isolated_{stages}", work))
    simplex: list[SimplexRun] = []
    for case in isolated:
        if case.equations.stages in simplex_stages:
            budgets = simplex_starts, simplex_evaluations
            part = f"simplex_{case.equations.stages}"
            simplex += timed(part, partial(_simplex_runs, case, seed, budgets, digits, report))
    printed = timed("printed", lambda: [printed_point(name, digits=digits) for name in PRINTED])
    rankings = timed("families", lambda: rank_printed(PRINTED, starts=family_starts, seed=seed, report=report))
    known = {case.equations.stages: case for case in isolated}
    reaches = timed("growth", lambda: reach(growth_stages, starts=growth_starts, seed=seed, known=known, report=report))
    return Derivation(
        seed=seed,
        digits=digits,
        isolated=tuple(isolated),
        agreements=tuple(agreement(name, isolated) for name in UNIQUE),
        simplex=tuple(simplex),
        printed=tuple(printed),
        rankings=tuple(rankings),
        reaches=tuple(reaches),
        seconds=seconds,
    )


def agreement(name: str, isolated: Sequence[Isolated]) -> Agreement:
    """Which root the printed set ``name`` is, and to how many decimals.

    Raises:
        UnknownNameError: no integrator has this name.
    """
    tableau = integrators[name]
    equations = equations_of(tableau)
    roots: Sequence[Root] = ()
    for case in isolated:
        if (case.equations.stages, case.equations.harmonic_order) == (equations.stages, equations.harmonic_order):
            roots = case.roots
    decimals = [agreeing_decimals(tableau, root.outer, root.inner) for root in roots]
    best = max(range(len(roots)), key=decimals.__getitem__, default=None)
    if best is None or decimals[best] == 0:
        return Agreement(name, None, 0)
    return Agreement(name, best, decimals[best])


def plain(value: Any) -> Any:
    """``value`` as numbers, strings, lists and dicts: dataclasses by field, mpf as strings of five digits."""
    if is_dataclass(value) and not isinstance(value, type):
        return {key: plain(item) for key, item in asdict(value).items()}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return mp.nstr(value, 5) if isinstance(value, mpf) else value


def _simplex_runs(case: Isolated, seed: int, budgets: tuple[int, int], digits: int, report: Report) -> list[SimplexRun]:
    starts, evaluations = budgets
    promising = promising_starts(case.equations, starts=starts, seed=seed, report=report)
    runs = []
    for start in promising:
        outcome = minimise(case.equations, start, seed=seed, digits=digits, evaluations=evaluations, report=report)
        reached, distance = _nearest_root(case, outcome, digits)
        stages = case.equations.stages
        runs.append(SimplexRun(stages, starts, len(promising), tuple(start), outcome, reached, distance))
    return runs


def _nearest_root(case: Isolated, outcome: Minimised, digits: int) -> tuple[int | None, Any]:
    """Number of the root that a simplex converged to, and how far from it the simplex ended."""
    with mp.workdps(digits + 30):
        for number, other in enumerate(case.roots) if outcome.converged else ():
            centre = [mpf(c) for c in case.equations.unknowns_of(other.outer, other.inner)]
            apart = max(abs(a - b) for a, b in zip(outcome.unknowns, centre, strict=True))
            if apart < mpf("1e-6"):
                return number, apart
    return None, None
