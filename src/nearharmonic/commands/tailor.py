"""``nearharmonic tailor``: makes a method for one system, and tests its gain over the registered methods."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Answer

if TYPE_CHECKING:
    from nearharmonic.training.tailor import Comparison, Tailored

HELP = "make a method for one system, and test it on starts that were not used"
HEADER = ("tau_per_stage", "registered", "its_error", "error", "gain", "low", "high")


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("system", help="name of a system, or a Python file that defines SYSTEM")
    parser.add_argument(
        "--stages", default="8", metavar="S", help="4 to 20, or 6:10 for the best of several (default 8)"
    )
    parser.add_argument(
        "--window", metavar="LOW:HIGH", help="step sizes per stage, in the system's unit of time, a factor 1.2 at least"
    )
    parser.add_argument(
        "--error", help="or the energy error that registered methods have in the window's middle (default 1e-6)"
    )
    parser.add_argument("--seconds", help="time of the search (default 30); Ctrl-C gives the best so far")
    parser.add_argument("--trials", metavar="N", help="methods that it tries, in place of a time or beside it")
    parser.add_argument("--starts", metavar="FILE.csv", help="starts in place of drawn ones: positions, then momenta")
    parser.add_argument(
        "--energy", metavar="E", help="energy of all drawn starts, or same (default a box around the orbit)"
    )
    parser.add_argument("--seed", default="0", help="of all random numbers (default 0)")
    parser.add_argument("--output", metavar="FILE.py", help="file to write the method to, if it gains anything")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return the test of the new method; the exit status is 1 if it has no gain over the registered methods."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.training.question import question
    from nearharmonic.training.tailor import tailored

    place = None if chosen.output is None else _target(chosen.output)
    asked = question(
        chosen.system,
        stages=chosen.stages,
        window=chosen.window,
        error=chosen.error,
        seconds=chosen.seconds,
        trials=None if chosen.trials is None else whole_number(chosen.trials, "trials"),
        starts=chosen.starts,
        energy=chosen.energy,
        seed=whole_number(chosen.seed, "seed"),
    )
    with _progress() as show:
        found = tailored(asked, show)
    written = _written(found, place)
    return Answer(
        header=HEADER,
        rows=list(_rows(found.test)),
        document=_document(found, written),
        status=0 if found.has_gain else 1,
        caption=_title(found),
        notes=[*_notes(found), *_outcome(found, place, written)],
        digits=3,
    )


def _target(output: str) -> Path:
    """Return the file to write: a new Python file, whose name is one for a method and is not registered."""
    from nearharmonic.errors import bad_setting
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


def _written(found: Tailored, place: Path | None) -> str | None:
    """Write the file and return its path; return None if there is no gain."""
    if place is None or not found.has_gain:
        return None
    from nearharmonic.output.atomic import write_text
    from nearharmonic.training.tailor import file_text

    write_text(place, file_text(found.tableau, place.stem))
    return place.as_posix()


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


def _notes(found: Tailored) -> Iterator[str]:
    from nearharmonic.theory.oscillator import stability_limit

    asked, search, tableau, unit = found.question, found.search, found.tableau, found.question.system.units["t"]
    yield (
        f"gain: decades of max |dH| at equal cost, mean and 95 % interval over {found.held_out.size} starts that were "
        f"not used, runs of t = {found.held_out.t_end:.4g}{'' if unit == '1' else f' {unit}'}"
    )
    yield (
        f"on the {found.ensemble.size} starts of the search, t = {found.ensemble.t_end:.4g}: {found.training.gain}; "
        f"registered method of the least mean error in the window: {found.test.overall.name}"
    )
    if found.losing and found.has_gain:
        places = ", ".join(f"{tau:.3g}: {gain}" for tau, gain in found.losing)
        yield f"no gain at tau/s = {places}; a narrower window may have one throughout"
    others = ", ".join(dict.fromkeys(found.published.best))
    yield f"over methods of other authors alone ({others}): {found.published.gain}"
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


def _outcome(found: Tailored, place: Path | None, written: str | None) -> Iterator[str]:
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
