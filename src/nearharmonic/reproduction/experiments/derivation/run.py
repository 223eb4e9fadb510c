"""The whole derivation, from a seed to proved coefficients, and the comparison with what is printed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, is_dataclass
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
from nearharmonic.reproduction.experiments.derivation.isolated import CASES, IsolatedSolutions, Reach, reach, solve
from nearharmonic.reproduction.experiments.derivation.search.simplex import Simplex, SimplexRun, simplex_runs
from nearharmonic.reproduction.experiments.derivation.settings import DerivationSettings

Report = Callable[[str], None]

#: Step sizes per stage at which the five-stage solutions are compared.
TAU_PER_STAGE = (0.02, 0.05, 0.1)


@dataclass(frozen=True)
class Derivation:
    """Everything that is derived. ``seconds`` are wall times by part; they alone differ between two equal runs, besides
    the time that each simplex run took."""

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
    """Derive the sets of Nielsen (2015), Table 4, and tabulate what is found.

    Parameters
    ----------
    settings : DerivationSettings
        How hard to search.
    report : callable
        Is told of the progress.

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
        "derived_errors": tables.solution_errors(tables.compare(found.isolated[0], TAU_PER_STAGE)),
    }


def derivation(settings: DerivationSettings, *, digits: int = 128, report: Report = lambda _: None) -> Derivation:
    """Derive the sets of Nielsen (2015), Table 4, to ``digits`` decimals; the table itself is read only to compare.

    The other parameters are those of :func:`derive`.

    Raises
    ------
    SettingError
        A number of starts below 1, or of stages below 3.
    """
    seed, seconds = settings.seed, dict[str, float]()
    part = partial(_timed, seconds, report)
    isolated: list[IsolatedSolutions] = []
    for stages, order in CASES:
        with part(f"isolated_{stages}"):
            equations = Equations(stages, order)
            starts = RandomStarts(settings.starts, seed, box=2.5, bound=20.0)
            isolated.append(solve(equations, starts, digits=digits, report=report))
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
        reaches = reach(settings.growth_stages, starts, known=known, report=report)
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
    """Return all but the times, in the types that TOML has; what is None is left out."""
    told = plain(found)
    told.pop("seconds")
    for run in told["simplex"]:
        run["outcome"].pop("seconds")
        run["outcome"]["unknowns"] = [str(x) for x in run["outcome"]["unknowns"]]
    return _without_none(told)  # type: ignore[no-any-return]


def plain(value: Any) -> Any:
    """Return ``value`` as numbers, strings, lists and dicts: dataclasses by field, mpf as strings of five digits."""
    if is_dataclass(value) and not isinstance(value, type):
        return {key: plain(item) for key, item in asdict(value).items()}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return mp.nstr(value, 5) if isinstance(value, mpf) else value


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value
