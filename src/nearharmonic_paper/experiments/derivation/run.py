"""The whole derivation, from a seed to proved coefficients, and the comparison with the printed sets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, is_dataclass
from functools import partial
from time import perf_counter
from typing import Any

from mpmath import mp, mpf, nstr

from nearharmonic.engine.trajectory import sweep
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import First
from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic.output.table import Table, progress
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic.theory.oscillator import harmonic_energy_error
from nearharmonic.theory.table_4 import table_4
from nearharmonic_paper.experiments.derivation import families as sets
from nearharmonic_paper.experiments.derivation.experiment import DerivationSettings
from nearharmonic_paper.experiments.derivation.search import Equations, Simplex, SimplexRun, simplex_runs

ROLES: tuple[First, ...] = ("drift", "kick")
#: Decimals of the coefficients in measurements of errors.
DIGITS_OF_ERRORS = 40


def solutions(cases: Sequence[sets.IsolatedSolutions]) -> Table:
    """Tabulate every real solution of each isolated case."""
    header = (
        "stages", "harmonic order", "solution", "half of the outer row", "half of the inner row",
        "sum of absolute values", "hits", "proved to exist", "within", "residual", "found by elimination",
    )  # fmt: skip
    rows = []
    for case in cases:
        for number, root in enumerate(case.roots):
            halves = [
                " ".join(f"{float(c):.8f}" for c in row[: (len(row) + 1) // 2]) for row in (root.outer, root.inner)
            ]
            rows.append((
                case.equations.stages, case.equations.harmonic_order, number + 1, *halves, root.sum_of_absolute_values,
                root.hits, _yes(root.proved), nstr(root.distance, 2), nstr(root.residual, 2), _yes(root.eliminated),
            ))  # fmt: skip
    return Table(header=header, rows=rows, caption="All real solutions of the isolated cases.")


def counts(cases: Sequence[sets.IsolatedSolutions]) -> Table:
    """Tabulate the number of solutions of each isolated case, and the proof of completeness."""
    header = (
        "stages", "harmonic order", "complex solutions", "real solutions by Sturm", "proved to exist", "complete",
        "starts", "converged",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = []
    for case in cases:
        counted = [case.complex_solutions, case.real_solutions]
        rows.append((
            case.equations.stages, case.equations.harmonic_order, *("not counted" if n is None else n for n in counted),
            sum(root.proved for root in case.roots), _yes(case.complete), case.starts, case.converged,
        ))  # fmt: skip
    return Table(header=header, rows=rows, caption="Number of solutions, and the reason why none is missing.")


def reach_of_stages(reaches: Sequence[sets.Reach]) -> Table:
    """Tabulate the paper's remark on stages: lambda_max and the largest harmonic order with a real solution."""
    header = ("stages", "lambda_max", "harmonic order reached", "solutions at order s + 1", "starts", "proved largest")
    rows = [(r.stages, r.lambda_max, r.harmonic_order, r.solutions, r.starts, _yes(r.proved_largest)) for r in reaches]
    return Table(header=header, rows=rows, caption="Largest harmonic order by number of stages.")


def families(printed: Sequence[sets.PrintedPoint], rankings: Sequence[sets.Ranking]) -> Table:
    """Tabulate each printed set with free parameters, with its ranking; ``rankings`` are in any order."""
    header = (
        "set", "stages", "harmonic order", "free parameters", "printed residual", "decimals after continuation",
        "residual after continuation", "proved", "members found", "sum of absolute values",
        "members with a smaller sum",
        "members with a smaller next kappa", "members better in all", "smallest sum met", "distance of the nearest",
    )  # fmt: skip
    ranked = {ranking.name: ranking for ranking in rankings}
    rows = []
    for point in printed:
        rank = ranked[point.name]
        rows.append((
            integrators[point.name].label, point.equations.stages, point.equations.harmonic_order,
            point.free_parameters, nstr(point.printed_residual, 2), point.decimals, nstr(point.continued.residual, 2),
            _yes(point.proof.proved), rank.members, rank.sum_of_absolute_values, rank.smaller_sum,
            rank.smaller_higher[0], rank.better_in_all, rank.smallest_sum, rank.nearest,
        ))  # fmt: skip
    return Table(header=header, rows=rows, caption="Printed members of families, and their ranks.")


def routes(
    cases: Sequence[sets.IsolatedSolutions], simplex: Sequence[SimplexRun], seconds: Mapping[str, float]
) -> Table:
    """Compare our method (``cases``) with the paper's (``simplex``) by digits and work.

    ``seconds`` are wall times on this machine, of our method by case among others.
    """
    header = ("route", "stages", "start", "reached", "largest kappa", "agrees to", "evaluations", "restarts", "seconds")
    rows: list[tuple[Any, ...]] = []
    for case in cases:
        stages = case.equations.stages
        worst = max((root.residual for root in case.roots), default=float("nan"))
        rows.append((
            "many starts, Newton, elimination, proof", stages, f"{case.starts} random", f"all {len(case.roots)}",
            nstr(worst, 2), "", "", "", seconds[f"isolated_{stages}"],
        ))  # fmt: skip
    for run in simplex:
        start = f"random, one of {run.promising} in {run.starts}"
        reached = "not converged" if run.reached is None else f"solution {run.reached + 1}"
        agrees = "" if run.distance is None else nstr(run.distance, 2)
        rows.append((
            "adaptive simplex, 2048 bits", run.stages, start, reached, nstr(run.outcome.kappa_max, 2), agrees,
            run.outcome.evaluations, run.outcome.restarts, run.outcome.seconds,
        ))  # fmt: skip
    caption = "Two routes to the coefficients, with the seconds of this run."
    return Table(header=header, rows=rows, caption=caption, volatile=["seconds"])


def solution_errors(isolated: sets.IsolatedSolutions, tau_per_stage: Sequence[float]) -> Table:
    """Measure every solution of a case on two systems, drift first and kick first.

    The error |H - H0|/|H0| is the exact supremum over arbitrarily many steps on the harmonic oscillator. On the
    Henon-Heiles system it is the maximum over all steps of the interval, infinite if a run left its energy surface.
    """
    header = ("solution", "first", "tau/s", "max error, harmonic oscillator", "max error, Henon-Heiles")
    equations, rows = isolated.equations, []
    taus = [tau * equations.stages for tau in tau_per_stage]
    for number, root in enumerate(isolated.roots):
        tableau = root.tableau(equations, f"solution_{number}", DIGITS_OF_ERRORS)
        for first in ROLES:
            measured = sweep(SYSTEM, tableau.role(first), taus).max_energy_error.values.tolist()
            for per_stage, tau, error in zip(tau_per_stage, taus, measured, strict=True):
                known = float(harmonic_energy_error(tableau, tau, first=first))
                rows.append((number + 1, first, per_stage, known, error))
    caption = "Energy errors of all five-stage solutions, drift first and kick first."
    return Table(header=header, rows=rows, caption=caption)


def _yes(fact: bool) -> str:
    return "yes" if fact else "no"


#: Step sizes per stage at which the five-stage solutions are compared.
TAU_PER_STAGE = (0.02, 0.05, 0.1)


def derive(settings: DerivationSettings, digits: int = 128) -> dict[str, Table | dict[str, Any]]:
    """Derive the sets of Nielsen (2015), Table 4, which is read only to compare, to ``digits`` decimals.

    The result has ``document``, for a TOML file, with all results except times, and a :class:`Table` for each other
    key.
    """
    seed, seconds = settings.seed, dict[str, float]()
    part = partial(_timed, seconds)
    isolated: list[sets.IsolatedSolutions] = []
    for stages, order in sets.CASES:
        with part(f"isolated_{stages}"):
            starts = RandomStarts(settings.starts, seed, box=2.5, bound=20.0)
            isolated.append(sets.solve(Equations(stages, order), starts, digits=digits))
    cases = {case.equations.stages: case for case in isolated}
    simplex: list[SimplexRun] = []
    each = Simplex(digits=digits, evaluations=settings.simplex_evaluations)
    for stages in filter(settings.simplex_stages.__contains__, cases):
        with part(f"simplex_{stages}"):
            case = cases[stages]
            known = [(root.outer, root.inner) for root in case.roots]
            simplex += simplex_runs(case.equations, known, starts=settings.simplex_starts, seed=seed, settings=each)
    with part("printed"):
        printed = [sets.printed_point(name, digits=digits) for name in sets.PRINTED]
    with part("families"):
        rankings = sets.rank_printed(sets.PRINTED, RandomStarts(settings.family_starts, seed, bound=5.0))
    with part("growth"):
        starts = RandomStarts(settings.growth_starts, seed, bound=20.0)
        reaches = sets.reach(settings.growth_stages, starts, cases, digits=digits)
    agreements = [sets.agreement(name, isolated) for name in sets.UNIQUE]
    found = {"isolated": isolated, "agreements": agreements, "simplex": simplex, "printed": printed}
    found |= {"rankings": rankings, "reaches": reaches}
    header, rows = table_4(sets.derived_tableaus(isolated, agreements, printed, digits))
    return {
        "document": {"seed": seed, "digits": digits} | _plain(found),
        "table4_derived": Table(header=header, rows=rows, caption="Table 4, printed and derived."),
        "derived_solutions": solutions(isolated),
        "derived_counts": counts(isolated),
        "derived_families": families(printed, rankings),
        "derived_orders": reach_of_stages(reaches),
        "derived_routes": routes(isolated, simplex, seconds),
        "derived_errors": solution_errors(isolated[0], TAU_PER_STAGE),
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
