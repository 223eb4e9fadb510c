"""``nearharmonic recommend``: ranks methods by their time to reach an error."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.output.answers import Answer

if TYPE_CHECKING:
    from nearharmonic.recommendation.recommendation import Choice, Recommendation

#: Folder of the results of the workflow.
RESULTS = Path("results")

HELP = "rank methods by the time to reach an error"
#: Columns, and what they hold.
COLUMNS = {
    "rank": "1 for the shortest time",
    "method": "its name in commands and nh.integrate, or another library",
    "kind": "splitting: a method of this package; peer: another library, as its users use it",
    "tau": "the largest step size found that meets the error, in the unit of time of the system",
    "tolerance": "tolerance of an adaptive method, in place of a step size",
    "sums": "plain sums if they do not increase the error, else compensated ones",
    "evaluations": "evaluations of the force in the run",
    "ms": "time of the run in milliseconds",
    "ratio": "this time over the shortest",
    "error": "error of the run",
}
#: Rows of the table, unless another number is given.
LIMIT = 10


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("system", help="name of a system, or a Python file that defines SYSTEM")
    parser.add_argument("--config", help="a config that defines the system, and integrators beside the registered ones")
    parser.add_argument("--error", required=True, help="the error that is allowed, such as 1e-9")
    parser.add_argument("--measure", default="max", help="one of max, mean, position (default max)")
    parser.add_argument("--t-end", metavar="T", help="end of the interval (default that of the config or the system)")
    parser.add_argument(
        "--methods", metavar="A,B,...", help="names, or files that define TABLEAU (default all and other libraries)"
    )
    parser.add_argument("--budget", metavar="N", help="most evaluations of the force in a run (default 200000)")
    parser.add_argument("--limit", metavar="N", help=f"most rows (default {LIMIT}; JSON holds every method)")
    parser.add_argument("--results", help="folder with timings (default that of the config, or results/paper)")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "\n".join(["columns:", *(f"  {name:<12} {says}" for name, says in COLUMNS.items())])


def answer(chosen: argparse.Namespace) -> Answer:
    """Return the ranking; the exit status is 1 if no method meets the error bound."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.recommendation.choices import recommendation, to_terminal
    from nearharmonic.recommendation.question import question

    t_end: str | None = None
    results: str | None = str(RESULTS / "paper")
    if chosen.config is not None:
        t_end, results = _configured(chosen.system, Path(chosen.config))
    methods = None if chosen.methods is None else [name.strip() for name in chosen.methods.split(",")]
    asked = question(
        chosen.system,
        chosen.error,
        measure=chosen.measure,
        t_end=t_end if chosen.t_end is None else chosen.t_end,
        methods=methods,
        budget=None if chosen.budget is None else whole_number(chosen.budget, "budget"),
    )
    limit = LIMIT if chosen.limit is None else whole_number(chosen.limit, "limit")
    if methods is not None:  # which are those of this package
        results = None
    folder = results if chosen.results is None else chosen.results
    return ranking(recommendation(asked, folder, to_terminal if chosen.format == "table" else lambda _: None), limit)


def _configured(system: str, place: Path) -> tuple[str | None, str]:
    """Return the end of the interval that a config gives a system, None for its own, and the folder of the results.

    The definitions of the config are then in the registries.
    """
    from nearharmonic_paper.config import read

    config = read(place)
    ends = {sweep.system: sweep.t_end for sweep in config.sweeps}
    return ends.get(system), str(RESULTS / config.name)


def ranking(found: Recommendation, limit: int = LIMIT) -> Answer:
    """Return ``found`` as an answer: rows of the best methods that meet the bound, and notes on the others."""
    asked, best = found.question, found.ranked
    unit = asked.system.units["t"]
    interval = f"{asked.system.label}, t = {asked.t_end} {unit if unit != '1' else ''}".rstrip()
    return Answer(
        header=tuple(COLUMNS),
        rows=[_row(rank, choice, best[0], found) for rank, choice in enumerate(best[:limit], start=1)],
        document=_document(found),
        status=0 if best else 1,
        caption=f"{interval}: {asked.quantity} <= {asked.error:g}",
        notes=list(_notes(found, limit)),
        digits=3,
    )


def _document(found: Recommendation) -> dict[str, Any]:
    asked = found.question
    told = {name: getattr(asked, name) for name in ("t_end", "measure", "error", "budget")}
    if asked.floor:
        told["energy_floor"] = asked.floor
    choices = [
        {"rank": rank if choice.status == "met" else None, **asdict(choice)}
        for rank, choice in enumerate(found.choices, start=1)
    ]
    return {"system": asked.system.name, **told, "basis": found.basis, "call": found.call, "choices": choices}


def _notes(found: Recommendation, limit: int) -> Iterator[str]:
    budget = found.question.budget
    if (count := len(found.ranked)) > limit:
        yield f"{count - limit} more meet the error: --limit {count}"
    if not found.ranked:
        yield f"no method reaches this error within {budget} evaluations"
    for kind, where in (("splitting", f"within {budget} evaluations"), ("peer", "at any setting timed")):
        if words := found.missed(kind):
            yield f"not {where}: {words}"
    if words := found.not_run():
        yield f"not run: {words}"
    if words := found.unconfirmed:
        yield f"not confirmed from other starts and over a longer interval, and therefore last: {words}"
    if words := found.floor_in_words:
        yield words
    yield f"Time is that of one trajectory on one core, without start-up. Based on: {found.basis}"
    if found.call:
        yield f"the best in Python: {found.call}"


def _row(rank: int, choice: Choice, best: Choice, found: Recommendation) -> tuple[Any, ...]:
    from nearharmonic.recommendation.recommendation import is_rounding, step_text

    return (
        rank,
        choice.shown,
        choice.kind,
        step_text(choice, found.question.t_end),
        f"{choice.tolerance:.1g}" if isfinite(choice.tolerance) else None,
        choice.summation or None,
        round(choice.evaluations) if isfinite(choice.evaluations) else None,
        1e3 * choice.time,
        choice.time / best.time,
        f"{choice.error:.2e} *" if is_rounding(choice, found.question) else choice.error,
    )
