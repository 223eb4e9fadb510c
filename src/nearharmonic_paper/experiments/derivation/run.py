"""The whole derivation, from a seed to proved coefficients, and the comparison with the printed sets."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from functools import partial
from time import perf_counter
from typing import Any

from mpmath import mp, mpf

from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic.output.table import Table, progress
from nearharmonic_paper.experiments.derivation import tables
from nearharmonic_paper.experiments.derivation.conditions import Equations
from nearharmonic_paper.experiments.derivation.families import (
    CASES,
    PRINTED,
    UNIQUE,
    IsolatedSolutions,
    agreement,
    derived_tableaus,
    printed_point,
    rank_printed,
    reach,
    solve,
)
from nearharmonic_paper.experiments.derivation.settings import DerivationSettings
from nearharmonic_paper.experiments.derivation.simplex import Simplex, SimplexRun, simplex_runs

#: Step sizes per stage at which the five-stage solutions are compared.
TAU_PER_STAGE = (0.02, 0.05, 0.1)


def derive(settings: DerivationSettings, digits: int = 128) -> dict[str, Table | dict[str, Any]]:
    """Derive the sets of Nielsen (2015), Table 4, which is read only to compare, to ``digits`` decimals.

    The result has ``document``, for a TOML file, with all results except times, and a :class:`Table` for each other
    key.
    """
    seed, seconds = settings.seed, dict[str, float]()
    part = partial(_timed, seconds)
    isolated: list[IsolatedSolutions] = []
    for stages, order in CASES:
        with part(f"isolated_{stages}"):
            starts = RandomStarts(settings.starts, seed, box=2.5, bound=20.0)
            isolated.append(solve(Equations(stages, order), starts, digits=digits))
    cases = {case.equations.stages: case for case in isolated}
    simplex: list[SimplexRun] = []
    each = Simplex(digits=digits, evaluations=settings.simplex_evaluations)
    for stages in filter(settings.simplex_stages.__contains__, cases):
        with part(f"simplex_{stages}"):
            simplex += simplex_runs(cases[stages], starts=settings.simplex_starts, seed=seed, settings=each)
    with part("printed"):
        printed = [printed_point(name, digits=digits) for name in PRINTED]
    with part("families"):
        rankings = rank_printed(PRINTED, RandomStarts(settings.family_starts, seed, bound=5.0))
    with part("growth"):
        starts = RandomStarts(settings.growth_starts, seed, bound=20.0)
        reaches = reach(settings.growth_stages, starts, cases, digits=digits)
    agreements = [agreement(name, isolated) for name in UNIQUE]
    found = {"isolated": isolated, "agreements": agreements, "simplex": simplex, "printed": printed}
    found |= {"rankings": rankings, "reaches": reaches}
    return {
        "document": {"seed": seed, "digits": digits} | _plain(found),
        "table4_derived": tables.printed_and_derived(derived_tableaus(isolated, agreements, printed, digits)),
        "derived_solutions": tables.solutions(isolated),
        "derived_counts": tables.counts(isolated),
        "derived_families": tables.families(printed, rankings),
        "derived_orders": tables.reach_of_stages(reaches),
        "derived_routes": tables.routes(isolated, simplex, seconds),
        "derived_errors": tables.solution_errors(isolated[0], TAU_PER_STAGE),
    }


@contextmanager
def _timed(seconds: dict[str, float], part: str) -> Iterator[None]:
    clock = perf_counter()
    yield
    seconds[part] = perf_counter() - clock
    progress(f"{part}: {seconds[part]:.1f} s")


def _plain(value: Any) -> Any:
    """Return ``value`` in types of TOML: dataclasses as dicts, mpf to five digits; without None and ``seconds``."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items() if item is not None and key != "seconds"}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return mp.nstr(value, 5) if isinstance(value, mpf) else value
