"""What a derivation found, as tables (header, rows) for readers, and as a document that can be read back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import nstr

from nearharmonic.derivation.comparison import Errors
from nearharmonic.derivation.derive import Derivation, plain
from nearharmonic.derivation.isolated import Isolated
from nearharmonic.integrators import integrators
from nearharmonic.tableau import Tableau

Table = tuple[tuple[str, ...], list[tuple[Any, ...]]]


def document(derivation: Derivation) -> dict[str, Any]:
    """All but the times, in the types that TOML has; what is None is left out."""
    found = plain(derivation)
    found.pop("seconds")
    for run in found["simplex"]:
        run["outcome"].pop("seconds")
        run["outcome"]["unknowns"] = [str(x) for x in run["outcome"]["unknowns"]]
    return _without_none(found)  # type: ignore[no-any-return]


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    if isinstance(value, list):
        return [_without_none(item) for item in value]
    return value


def derived_tableaus(derivation: Derivation) -> dict[str, Tableau]:
    """The derived counterpart of each printed set: the root it is, or the member of its family nearest to it."""
    cases = {case.equations.stages: case for case in derivation.isolated}
    tableaus = {}
    for agreement in derivation.agreements:
        if agreement.root is not None:
            printed = integrators[agreement.name]
            case = cases[printed.stages]
            root = case.roots[agreement.root].tableau(case.equations, agreement.name, derivation.digits)
            tableaus[agreement.name] = root.role(printed.first)
    for point in derivation.printed:
        if point.continued.converged:
            outer, inner = point.continued.outer, point.continued.inner
            printed = integrators[point.name]
            tableaus[point.name] = Tableau(
                name=point.name,
                label=printed.label,
                order=4,
                first="kick",
                kick=outer,
                drift=inner,
                source="derived: the printed set, continued along the directions that its conditions fix",
                digits=derivation.digits - 3,
            ).role(printed.first)
    return tableaus


def roots(cases: Sequence[Isolated]) -> Table:
    """Every real solution of each isolated case."""
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
    return header, rows


def counts(derivation: Derivation) -> Table:
    """How many solutions each isolated case has, and why none is missing; how high an order the stages reach."""
    header = (
        "stages", "harmonic order", "complex solutions", "real solutions by Sturm", "proved to exist", "complete",
        "starts", "converged",
    )  # fmt: skip
    rows: list[tuple[Any, ...]] = [
        (
            case.equations.stages, case.equations.harmonic_order, _or_nothing(case.complex_solutions),
            _or_nothing(case.real_solutions), sum(root.proved for root in case.roots), _yes(case.complete), case.starts,
            case.converged,
        )
        for case in derivation.isolated
    ]  # fmt: skip
    return header, rows


def reach_of_stages(derivation: Derivation) -> Table:
    """The paper's remark on stages: lambda_max and the largest harmonic order with a real solution."""
    header = ("stages", "lambda_max", "harmonic order reached", "solutions at order s + 1", "starts", "proved largest")
    return header, [
        (r.stages, r.lambda_max, r.harmonic_order, r.solutions, r.starts, _yes(r.proved_largest))
        for r in derivation.reaches
    ]


def families(derivation: Derivation) -> Table:
    """Each printed set that its conditions leave free: parameters, residual, and its rank within its family."""
    header = (
        "set", "stages", "harmonic order", "free parameters", "printed residual", "decimals after continuation",
        "residual after continuation", "proved", "members found", "sum of absolute values",
        "members with a smaller sum",
        "members with a smaller next kappa", "members better in all", "smallest sum met", "distance of the nearest",
    )  # fmt: skip
    ranked = {ranking.name: ranking for ranking in derivation.rankings}
    rows = []
    for point in derivation.printed:
        rank = ranked[point.name]
        rows.append((
            integrators[point.name].label, point.equations.stages, point.equations.harmonic_order,
            point.free_parameters, nstr(point.printed_residual, 2), point.decimals, nstr(point.continued.residual, 2),
            _yes(point.proof.proved), rank.members, rank.sum_of_absolute_values, rank.smaller_sum,
            rank.smaller_higher[0], rank.better_in_all, rank.smallest_sum, rank.nearest,
        ))  # fmt: skip
    return header, rows


def routes(derivation: Derivation) -> Table:
    """The two routes in digits and work; seconds are those of this machine and this run."""
    header = ("route", "stages", "start", "reached", "largest kappa", "agrees to", "evaluations", "restarts", "seconds")
    rows: list[tuple[Any, ...]] = []
    for case in derivation.isolated:
        stages = case.equations.stages
        worst = max((root.residual for root in case.roots), default=float("nan"))
        rows.append((
            "many starts, Newton, elimination, proof", stages, f"{case.starts} random", f"all {len(case.roots)}",
            nstr(worst, 2), "", "", "", derivation.seconds[f"isolated_{stages}"],
        ))  # fmt: skip
    for run in derivation.simplex:
        start = f"random, one of {run.promising} in {run.starts}"
        reached = "not converged" if run.reached is None else f"solution {run.reached + 1}"
        agrees = "" if run.distance is None else nstr(run.distance, 2)
        rows.append((
            "adaptive simplex, 2048 bits", run.stages, start, reached, nstr(run.outcome.kappa_max, 2), agrees,
            run.outcome.evaluations, run.outcome.restarts, run.outcome.seconds,
        ))  # fmt: skip
    return header, rows


def solution_errors(rows: Sequence[Errors]) -> Table:
    """Energy errors of every solution of a case, in both roles."""
    header = ("solution", "first", "tau/s", "max error, harmonic oscillator", "max error, Henon-Heiles")
    table: list[tuple[Any, ...]] = [
        (row.solution + 1, row.first, tau, oscillator, measured)
        for row in rows
        for tau, oscillator, measured in zip(row.tau_per_stage, row.harmonic_oscillator, row.henon_heiles, strict=True)
    ]
    return header, table


def _yes(fact: bool) -> str:
    return "yes" if fact else "no"


def _or_nothing(number: int | None) -> int | str:
    return "not counted" if number is None else number
