"""The whole derivation, from a seed to proved coefficients, and the comparison with the printed sets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from time import perf_counter
from typing import Any

from mpmath import mp, mpf

from nearharmonic.numerics.search.random_starts import RandomStarts
from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.derivation import tables
from nearharmonic.reproduction.experiments.derivation.conditions import Equations
from nearharmonic.reproduction.experiments.derivation.families import (
    PRINTED,
    UNIQUE,
    Agreement,
    PrintedPoint,
    Ranking,
    agreement,
    derived_tableaus,
    printed_point,
    rank_printed,
)
from nearharmonic.reproduction.experiments.derivation.isolated import (
    CASES,
    IsolatedSolutions,
    Reach,
    Solving,
    reach,
    solve,
)
from nearharmonic.reproduction.experiments.derivation.search.simplex import Simplex, SimplexRun, simplex_runs
from nearharmonic.reproduction.experiments.derivation.settings import DerivationSettings

Report = Callable[[str], None]

#: Step sizes per stage at which the five-stage solutions are compared.
TAU_PER_STAGE = (0.02, 0.05, 0.1)


@dataclass(frozen=True)
class Derivation:
    """All results; ``seconds`` are wall times by part, which differ between equal runs."""

    seed: int
    digits: int
    isolated: tuple[IsolatedSolutions, ...]
    agreements: tuple[Agreement, ...]
    simplex: tuple[SimplexRun, ...]
    printed: tuple[PrintedPoint, ...]
    rankings: tuple[Ranking, ...]
    reaches: tuple[Reach, ...]
    seconds: Mapping[str, float]


def derive(settings: DerivationSettings, report: Report) -> dict[str, Table | dict[str, Any]]:
    """Derive the sets of Nielsen (2015), Table 4; ``report`` is called with lines on the progress.

    Returns
    -------
    dict
        ``document``, for a TOML file, and a :class:`Table` for each other key.
    """
    found = derivation(settings, report=report)
    derived = derived_tableaus(found.isolated, found.agreements, found.printed, found.digits)
    return {
        "document": document(found),
        "table4_derived": tables.printed_and_derived(derived),
        "derived_solutions": tables.solutions(found.isolated),
        "derived_counts": tables.counts(found.isolated),
        "derived_families": tables.families(found.printed, found.rankings),
        "derived_orders": tables.reach_of_stages(found.reaches),
        "derived_routes": tables.routes(found.isolated, found.simplex, found.seconds),
        "derived_errors": tables.solution_errors(found.isolated[0], TAU_PER_STAGE),
    }


def derivation(settings: DerivationSettings, *, digits: int = 128, report: Report = lambda _: None) -> Derivation:
    """Derive the sets of Nielsen (2015), Table 4, to ``digits`` decimals; the table itself is read only to compare."""
    seed, seconds, solving = settings.seed, dict[str, float](), Solving(digits=digits)
    part = partial(_timed, seconds, report)
    isolated: list[IsolatedSolutions] = []
    for stages, order in CASES:
        with part(f"isolated_{stages}"):
            equations = Equations(stages, order)
            starts = RandomStarts(settings.starts, seed, box=2.5, bound=20.0)
            isolated.append(solve(equations, starts, settings=solving, report=report))
    simplex: list[SimplexRun] = []
    each = Simplex(digits=digits, evaluations=settings.simplex_evaluations)
    for case in isolated:
        if case.equations.stages in settings.simplex_stages:
            with part(f"simplex_{case.equations.stages}"):
                simplex += simplex_runs(case, starts=settings.simplex_starts, seed=seed, settings=each, report=report)
    with part("printed"):
        printed = [printed_point(name, digits=digits) for name in PRINTED]
    with part("families"):
        rankings = rank_printed(PRINTED, RandomStarts(settings.family_starts, seed, bound=5.0), report)
    known = {case.equations.stages: case for case in isolated}
    with part("growth"):
        starts = RandomStarts(settings.growth_starts, seed, bound=20.0)
        reaches = reach(settings.growth_stages, starts, known, settings=solving, report=report)
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


@contextmanager
def _timed(seconds: dict[str, float], report: Report, part: str) -> Iterator[None]:
    clock = perf_counter()
    yield
    seconds[part] = perf_counter() - clock
    report(f"{part}: {seconds[part]:.1f} s")


def document(found: Derivation) -> dict[str, Any]:
    """Return all results except times, in types of TOML."""
    told: dict[str, Any] = _plain(asdict(found))
    for timed in (told, *(run["outcome"] for run in told["simplex"])):
        timed.pop("seconds")
    return told


def _plain(value: Any) -> Any:
    """Return ``value`` with lists in place of tuples, strings of five digits in place of mpf, and without None."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return mp.nstr(value, 5) if isinstance(value, mpf) else value
