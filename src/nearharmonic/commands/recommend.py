"""``nearharmonic recommend``: methods ranked by the time that they take to reach an error."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.answers import Answer
from nearharmonic.record.folders import RESULTS

if TYPE_CHECKING:
    from nearharmonic.experiments.work_precision.recommend.choices import Choice, Recommendation

HELP = "rank methods by the time to reach an error"
HEADER = ("rank", "method", "kind", "tau", "tolerance", "evaluations", "ms", "ratio", "error")
#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("system", help="name of a system, or a Python file that defines SYSTEM")
    parser.add_argument("--config", help="a config that defines the system, and integrators beside the registered ones")
    parser.add_argument("--error", required=True, help="the error that is allowed, such as 1e-9")
    parser.add_argument("--measure", default="max", help="one of max, mean, position (default max)")
    parser.add_argument("--results", help="folder with timings (default that of the config, or results/paper)")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return the ranking; its status is 1 if no method meets the error bound."""
    from nearharmonic.experiments.work_precision.recommend.choices import RESULTS as PAPER
    from nearharmonic.experiments.work_precision.recommend.choices import recommend

    t_end, results = None, PAPER
    if chosen.config is not None:
        t_end, results = _configured(chosen.system, Path(chosen.config))
    results = results if chosen.results is None else chosen.results
    return ranking(recommend(chosen.system, chosen.error, measure=chosen.measure, results=results, t_end=t_end))


def _configured(system: str, place: Path) -> tuple[str | None, str]:
    """The end of the interval that a config gives a system, None for its own, and the folder of the results.

    From then on the registries hold what the config defines.
    """
    from nearharmonic.config import read

    config = read(place)
    ends = {sweep.system: sweep.t_end for sweep in config.sweeps}
    return ends.get(system), str(RESULTS / config.name)


def ranking(found: Recommendation) -> Answer:
    """Return ``found`` as an answer: a row for each method that meets the bound, and notes on the others."""
    best = found.ranked
    unit = found.system.units["t"]
    interval = f"{found.system.label}, t = {found.t_end} {unit if unit != '1' else ''}".rstrip()
    return Answer(
        header=HEADER,
        rows=[_row(rank, choice, best[0], found.t_end) for rank, choice in enumerate(best, start=1)],
        document=_document(found),
        status=0 if best else 1,
        title=f"{interval}: {found.quantity} <= {found.error:g}",
        notes=list(_notes(found)),
        digits=3,
    )


def _document(found: Recommendation) -> dict[str, Any]:
    told = {name: getattr(found, name) for name in ("t_end", "measure", "error", "budget", "basis")}
    return {"system": found.system.name, **told, "choices": [asdict(choice) for choice in found.choices]}


def _notes(found: Recommendation) -> Iterator[str]:
    if not found.ranked:
        yield f"no method reaches this error within {found.budget} evaluations"
    missed = [choice for choice in found.choices if choice.status == "missed"]
    for kind, limit in (("splitting", f"within {found.budget} evaluations"), ("peer", "at any setting timed")):
        words = [_missed(choice, found) for choice in missed if choice.kind == kind]
        if words:
            yield f"not {limit}: {'; '.join(words)}"
    absent = [f"{choice.label} ({choice.reason})" for choice in found.choices if choice.status == "not run"]
    if absent:
        yield f"not run: {'; '.join(absent)}"
    if any(choice.kind == "peer" for choice in found.ranked):
        yield "peer: another library, as its users use it"
    yield f"Time is that of one trajectory on one core, without start-up. Based on: {found.basis}"


def printed_step(t_end: str, tau: float, steps: int) -> str:
    """Return ``tau`` in the fewest digits, four at least, that give ``steps`` steps over [0, ``t_end``] again."""
    from nearharmonic.engine.grid import steps_of

    texts = (f"{tau:.{digits}g}" for digits in range(DIGITS, 18))
    return next(text for text in texts if steps_of(t_end, float(text)) == steps)


def _step(choice: Choice, t_end: str) -> str | None:
    if not isfinite(choice.tau):
        return None
    return printed_step(t_end, choice.tau, int(choice.steps)) if isfinite(choice.steps) else f"{choice.tau:.{DIGITS}g}"


def _row(rank: int, choice: Choice, best: Choice, t_end: str) -> tuple[Any, ...]:
    return (
        rank,
        choice.label,
        choice.kind,
        _step(choice, t_end),
        f"{choice.tolerance:.1g}" if isfinite(choice.tolerance) else None,
        round(choice.evaluations) if isfinite(choice.evaluations) else None,
        1e3 * choice.time,
        choice.time / best.time,
        choice.error,
    )


def _missed(choice: Choice, found: Recommendation) -> str:
    """The best that ``choice`` does, in words."""
    if not isfinite(choice.error):
        says = "every run fails"
    else:
        step = _step(choice, found.t_end)
        says = f"{choice.error:.1e} at {f'tolerance {choice.tolerance:.1g}' if step is None else f'tau {step}'}"
        says += ", but not at all finer ones" if choice.error <= found.error else " at best"
    return f"{choice.label} ({says}" + (f"; {choice.reason})" if choice.reason else ")")
