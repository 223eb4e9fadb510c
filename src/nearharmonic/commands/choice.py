"""Commands that choose or make a method for a system: recommend and tailor."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.commands import Command
from nearharmonic.errors import bad_setting
from nearharmonic.output.table import Answer

if TYPE_CHECKING:
    from nearharmonic.recommendation.recommend import Recommendation
    from nearharmonic.recommendation.search import Choice
    from nearharmonic.training.tailor import Comparison, Tailored


# --- ``nearharmonic recommend``: ranks methods by their time to reach an error.

#: Folder of the results of the workflow.
RESULTS = Path("results")

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


def recommend_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("system", help="name of a system, or a Python file that defines SYSTEM")
    add("--config", help="a config that defines the system, and integrators beside the registered ones")
    add("--error", required=True, help="largest error that is allowed, such as 1e-9")
    add("--measure", default="max", help="one of max, mean, position (default max)")
    add("--t-end", metavar="T", help="end of the interval (default: from the config or the system)")
    add("--methods", metavar="A,B,...", help="names, or files that define TABLEAU (default all and other libraries)")
    add("--budget", metavar="N", help="largest number of force evaluations in a run (default 200000)")
    add("--limit", metavar="N", help=f"largest number of rows (default {LIMIT}; JSON holds every method)")
    add("--results", help="folder with timings (default: of the config, or results/paper)")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "\n".join(["columns:", *(f"  {name:<12} {says}" for name, says in COLUMNS.items())])


def recommend_answer(chosen: argparse.Namespace) -> Answer:
    """Return the ranking; the exit status is 1 if no method meets the error bound."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.recommendation.recommend import recommendation, to_terminal
    from nearharmonic.recommendation.search import Search

    ends: dict[str, str] = {}
    results: str | None = str(RESULTS / "paper")
    if chosen.config is not None:  # its definitions are in the registries after this
        from nearharmonic_paper.config import read

        config = read(Path(chosen.config))
        ends, results = {sweep.system: sweep.t_end for sweep in config.sweeps}, str(RESULTS / config.name)
    methods = None if chosen.methods is None else [name.strip() for name in chosen.methods.split(",")]
    t_end = ends.get(chosen.system) if chosen.t_end is None else chosen.t_end
    budget = None if chosen.budget is None else whole_number(chosen.budget, "budget")
    search = Search(chosen.system, chosen.error, measure=chosen.measure, t_end=t_end, methods=methods, budget=budget)
    limit = LIMIT if chosen.limit is None else whole_number(chosen.limit, "limit")
    if methods is not None:  # results would only add other libraries
        results = None
    folder = results if chosen.results is None else chosen.results
    return ranking(recommendation(search, folder, to_terminal if chosen.format == "table" else lambda _: None), limit)


def ranking(advice: Recommendation, limit: int = LIMIT) -> Answer:
    """Return ``advice`` as an answer: rows of the best methods that meet the bound, and notes on the others."""
    search, best = advice.search, advice.ranked
    unit = search.system.units["t"]
    interval = f"{search.system.label}, t = {search.t_end} {unit if unit != '1' else ''}".rstrip()
    return Answer(
        header=tuple(COLUMNS),
        rows=[_row(rank, choice, best[0], advice) for rank, choice in enumerate(best[:limit], start=1)],
        document=_document_of_ranking(advice),
        status=0 if best else 1,
        caption=f"{interval}: {search.quantity} <= {search.error:g}",
        notes=list(_notes_of_ranking(advice, limit)),
        digits=3,
    )


def _document_of_ranking(advice: Recommendation) -> dict[str, Any]:
    floor = {"energy_floor": advice.search.floor} if advice.search.floor else {}
    choices = [
        {"rank": rank if choice.status == "met" else None, **asdict(choice)}
        for rank, choice in enumerate(advice.choices, start=1)
    ]
    return {**advice.search.settings, **floor, "basis": advice.basis, "call": advice.call, "choices": choices}


def _notes_of_ranking(advice: Recommendation, limit: int) -> Iterator[str]:
    budget = advice.search.budget
    if (count := len(advice.ranked)) > limit:
        yield f"{count - limit} more meet the error: --limit {count}"
    if not advice.ranked:
        yield f"no method reaches this error within {budget} evaluations"
    for kind, where in (("splitting", f"within {budget} evaluations"), ("peer", "at any setting timed")):
        if words := advice.missed(kind):
            yield f"not {where}: {words}"
    if words := advice.not_run():
        yield f"not run: {words}"
    if words := advice.unconfirmed:
        yield f"ranked last, as not confirmed from other starts and over a longer interval: {words}"
    if words := advice.floor_in_words:
        yield words
    yield f"Times are for one trajectory on one core, without start-up. Based on: {advice.basis}"
    if advice.call:
        yield f"the best in Python: {advice.call}"


def _row(rank: int, choice: Choice, best: Choice, advice: Recommendation) -> tuple[Any, ...]:
    from nearharmonic.recommendation.recommend import is_rounding, step_text

    return (
        rank,
        choice.shown,
        choice.kind,
        step_text(choice, advice.search.t_end),
        f"{choice.tolerance:.1g}" if isfinite(choice.tolerance) else None,
        choice.summation or None,
        round(choice.evaluations) if isfinite(choice.evaluations) else None,
        1e3 * choice.time,
        choice.time / best.time,
        f"{choice.error:.2e} *" if is_rounding(choice, advice.search) else choice.error,
    )


# --- ``nearharmonic tailor``: makes a method for one system, and tests its gain over the registered methods.

HEADER = ("tau_per_stage", "registered", "its_error", "error", "gain", "low", "high")


def tailor_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("system", help="name of a system, or a Python file that defines SYSTEM")
    add("--stages", default="8", metavar="S", help="4 to 20, or 6:10 for the best of several (default 8)")
    add("--window", metavar="LOW:HIGH", help="step sizes per stage in the system's unit of time, HIGH at least 1.2 LOW")
    add("--error", help="in place of --window: energy error of registered methods in its middle (default 1e-6)")
    add("--seconds", help="time of the search (default 30); Ctrl-C gives the best so far")
    add("--trials", metavar="N", help="number of methods to try, with --seconds or in place of it")
    add("--starts", metavar="FILE.csv", help="starts in place of drawn ones: positions, then momenta")
    add("--energy", metavar="E", help="energy of all drawn starts, or same (default a box around the orbit)")
    add("--seed", default="0", help="seed of all random numbers (default 0)")
    add("--output", metavar="FILE.py", help="file for the method, written if there is a gain")


def tailor_answer(chosen: argparse.Namespace) -> Answer:
    """Return the test of the new method; the exit status is 1 if it has no gain over the registered methods."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.output.atomic import write_text
    from nearharmonic.training.question import question
    from nearharmonic.training.tailor import file_text, tailored

    place = None if chosen.output is None else _target(chosen.output)
    given = {name: getattr(chosen, name) for name in ("stages", "window", "error", "seconds", "starts", "energy")}
    given["trials"] = None if chosen.trials is None else whole_number(chosen.trials, "trials")
    asked = question(chosen.system, seed=whole_number(chosen.seed, "seed"), **given)
    with _progress() as show:
        found = tailored(asked, show)
    written = None
    if place is not None and found.has_gain:
        write_text(place, file_text(found.tableau, place.stem))
        written = place.as_posix()
    return Answer(
        header=HEADER,
        rows=list(_rows(found.test)),
        document=_document(found, written),
        status=0 if found.has_gain else 1,
        caption=_title(found),
        notes=list(_notes(found, place, written)),
        digits=3,
    )


def _target(output: str) -> Path:
    """Return the file to write: a new Python file, whose name is one for a method and is not registered."""
    from nearharmonic.integrators import integrators

    place = Path(output)
    if place.suffix != ".py" or not place.stem.isidentifier():
        raise bad_setting("output", output, "a file NAME.py, its name of letters, digits and _")
    if place.stem in integrators.registered:
        raise bad_setting("output", output, f"a registered integrator has the name {place.stem}: choose another")
    if place.exists() or place.is_symlink():
        raise bad_setting("output", output, f"{place} exists already, and is not overwritten")
    folder = next(one for one in place.absolute().parents if one.exists())
    if not folder.is_dir():
        raise bad_setting("output", output, f"{folder} is no folder")
    return place


@contextmanager
def _progress() -> Iterator[Callable[[float, float], None] | None]:
    """Yield a callable that shows the spent budget on a terminal; None elsewhere."""
    import sys

    if not sys.stderr.isatty():
        yield None
        return
    from tqdm import tqdm

    form = "{l_bar}{bar}| {elapsed}{postfix}, Ctrl-C for the best so far"
    with tqdm(total=1.0, leave=False, bar_format=form, desc="searching", miniters=0) as bar:

        def show(part: float, best: float) -> None:
            bar.set_postfix_str(f"objective {best:.2f}", refresh=False)
            bar.update(part - bar.n)

        yield show


def _title(found: Tailored) -> str:
    from nearharmonic.training.tailor import window_text

    test, label = found.test, found.question.system.label
    where = f"{label}, tau/s = {window_text(found)}"
    if found.has_gain:
        part = ", though not in all of the window" if found.losing else ""
        return f"{where}: a gain of {test.gain} decades over the best registered methods{part}"
    return f"{where}: no gain, {test.gain} decades; take {test.overall.name}"


def _rows(test: Comparison) -> Iterator[tuple[Any, ...]]:
    columns = (test.tau_per_stage.tolist(), test.best, test.best_error.tolist(), test.error.tolist(), test.gains)
    for tau, name, best, error, gain in zip(*columns, strict=True):
        yield tau, name, best, error, round(gain.mean, 3), round(gain.low, 3), round(gain.high, 3)


def _notes(found: Tailored, place: Path | None, written: str | None) -> Iterator[str]:
    from nearharmonic.theory.oscillator import stability_limit

    asked, search, tableau, unit = found.question, found.search, found.tableau, found.question.system.units["t"]
    yield (
        f"gain: decades of max |dH| at equal cost, mean and 95 % interval over {found.held_out.size} starts that were "
        f"not used, runs of t = {found.held_out.t_end:.4g}{'' if unit == '1' else f' {unit}'}"
    )
    yield (
        f"gain on the {found.ensemble.size} starts of the search, t = {found.ensemble.t_end:.4g}: {found.training.gain}"
        f"; registered method with the smallest mean error in the window: {found.test.overall.name}"
    )
    if found.losing and found.has_gain:
        places = ", ".join(f"{tau:.3g}: {gain}" for tau, gain in found.losing)
        yield f"no gain at tau/s = {places}; a narrower window may gain everywhere"
    others = ", ".join(dict.fromkeys(found.published.best))
    yield f"gain over methods of other authors alone ({others}): {found.published.gain}"
    kind = "quadratic T" if tableau.requires else "every separable H"
    yield (
        f"method: {tableau.stages} stages, {tableau.first} first, order {tableau.order} for {kind}, harmonic order "
        f"{tableau.harmonic_order}, stability limit of the oscillator {float(stability_limit(tableau)):.4g}"
    )
    ended = {"Ctrl-C": " until Ctrl-C", "spent": ""}[search.stopped]
    yield (
        f"search: {search.trials} methods in {search.seconds:.1f} s{ended}, {search.searches} searches, {search.again} "
        f"of them at the best; found after {search.best.trials} methods and {search.best.seconds:.1f} s, from "
        f"{search.best.origin}; seed {asked.seed}"
    )
    if written is not None:
        yield f"written: {written}; nearharmonic verify-tableau {written} proves its orders"
    elif place is not None:
        yield f"not written: {place}, as there is no gain"
    elif found.has_gain:
        yield "--output FILE.py writes the method"
    if not found.has_gain:
        yield f"{found.test.overall.name} in Python: {found.call}"
    if not found.has_gain and len(found.question.stages) == 1:
        yield "other numbers of stages, such as --stages 6:12, or more seconds may find one"


def _document(found: Tailored, written: str | None) -> dict[str, Any]:
    asked, tableau, search = found.question, found.tableau, found.search
    return {
        "system": asked.system.name,
        "unit": asked.system.units["t"],
        "window": found.window,
        "has_gain": found.has_gain,
        "gain": asdict(found.test.gain),
        "gain_in_search": asdict(found.training.gain),
        "gain_over_published": asdict(found.published.gain),
        "registered": found.test.overall.name,
        "call": found.call,
        "steps": [dict(zip(HEADER, row, strict=True)) for row in _rows(found.test)],
        "starts": {"search": found.ensemble.size, "test": found.held_out.size, "t_end": found.held_out.t_end},
        "search": {
            "trials": search.trials, "seconds": search.seconds, "stopped": search.stopped,
            "searches": search.searches, "again": search.again, "origin": search.best.origin, "seed": asked.seed,
        },
        "method": {name: getattr(tableau, name) for name in (
            "name", "label", "stages", "first", "order", "harmonic_order", "requires", "kick", "drift", "digits",
            "source", "note",
        )},
        "file": written,
    }  # fmt: skip


COMMANDS = {
    "recommend": Command("rank methods by the time to reach an error", recommend_arguments, recommend_answer),
    "tailor": Command(
        "make a method for one system, and test it on starts that were not used", tailor_arguments, tailor_answer
    ),
}
