"""``nearharmonic.recommend``: methods for an error bound, by the search and by timings of other libraries."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, isfinite, isnan, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.kernels import NEAR_FLOOR, floor_in_words
from nearharmonic.engine.settings import checked_t_end, steps_of
from nearharmonic.errors import warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, machine, pinned
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.recommendation.measure import MEASURES, fewest_for_good, of_kind, prepared_call, read_parts
from nearharmonic.recommendation.search import REACH, Choice, Search
from nearharmonic.systems import System, systems

if TYPE_CHECKING:
    import xarray as xr

#: The ranking compares least times, most of them below 1 ms: more repeats than for curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)
#: Timings of other libraries in a folder of results, and the mode that is compared: one trajectory.
CUBE, TIMED = Path("cubes/work_precision.h5"), "trajectory"
#: Values of a setting of another library that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4


def recommend(
    system: str | System,
    error: float | str,
    *,
    measure: str = "max",
    t_end: float | str | None = None,
    q0: object = None,
    p0: object = None,
    methods: Iterable[str | os.PathLike[str] | Tableau] | None = None,
    budget: int | None = None,
) -> xr.Dataset:
    """Rank methods by the time that each takes to integrate a system within an error bound.

    The step of each method is searched for, run over the whole interval, and timed during the call. It meets the bound,
    as do all finer steps that were run. It is below the limit of linear stability at the largest frequency along the
    orbit, and it is run again from perturbed starts and over four times the interval. On a terminal, a line for each
    method tells how far the search is.

    Parameters
    ----------
    system : str or System
        Problem, its name, or the path of a Python file that defines SYSTEM.
    error : float or str
        Error bound, above 0.
    measure : {"max", "mean", "position"}
        Bounded quantity: the maximum or the mean of the energy error over every step, or the distance at the end from
        the exact position, relative to the distance from the origin.
    t_end : float or str, optional
        End of the interval [0, t_end], above 0; a decimal string is exact. By default the system's own. Positions are
        compared at ``position_t_end`` of the system if that is earlier.
    q0, p0 : sequence of d numbers or strings, optional
        Initial values in place of the system's own, as for :func:`nearharmonic.integrate`. Either may be given alone.
        Rows (M, d) are an ensemble: errors are then the 0.99 quantile over its members, of at most 1024.
    methods : list, optional
        Methods to choose from: names, paths of files (one for all methods of its file), or Tableaus. By default all;
        methods that need many more evaluations than ten others are left out of the search.
    budget : int, optional
        Most evaluations of the force in a run that may be recommended, by default 200 000; the work of the search
        grows with it.

    Returns
    -------
    xarray.Dataset
        Over ``rank``, 1 for the fastest: ``integrator``, a name or a path as :func:`nearharmonic.integrate` takes it;
        ``label``; ``tau``, ``summation``, ``steps`` and ``evaluations`` of its run; ``max_energy_error`` and
        ``mean_energy_error``, which ``integrate`` finds for this ``tau`` and ``summation``, and ``position_error`` if
        that is the measure; ``time``, the shortest wall time of one trajectory in s, on one core. Uncompensated
        sums are used where they do not increase the error. ``further_error`` is the largest error of the runs that
        confirm the step; methods for which it exceeds twice the bound come last, and the attribute ``unconfirmed``
        names them. Methods that miss the bound are left out: the attributes ``missed`` and ``not_run`` name them with
        the reason, ``basis`` tells what was checked and measured where, ``call`` is the Python code of the first run,
        in which a system that is not registered, and the starts of an ensemble, have their own names.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> ranking = nh.recommend("sho", 1e-6, methods=["ruth", "babps8o7h"], t_end=50)
    >>> bool((ranking.max_energy_error <= 1e-6).all())
    True
    >>> sorted(ranking.integrator.values.tolist())
    ['babps8o7h', 'ruth']
    """
    search = Search(system, error, measure=measure, t_end=t_end, q0=q0, p0=p0, methods=methods, budget=budget)
    advice = recommendation(search)
    if not advice.ranked:
        warn_caller(
            f"no method has an error of at most {search.error} within {search.budget} evaluations: attributes missed "
            "and not_run say how near each came; a larger budget= tries smaller step sizes"
        )
    return as_dataset(advice)


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods for an error bound, ranked by the wall time of the run that is recommended.

    ``choices``: those that meet the bound, the fastest first, behind them those whose step is not confirmed, then the
    others. ``basis`` is the origin of runs and times, as text.
    """

    search: Search
    choices: tuple[Choice, ...]
    basis: str

    @property
    def floor_in_words(self) -> str:
        """Sentence about choices whose error is marked as rounding, "" if there is none."""
        marked = any(is_rounding(choice, self.search) for choice in self.choices)
        return f"*: {floor_in_words(self.search.floor)}" if marked else ""

    @property
    def ranked(self) -> tuple[Choice, ...]:
        """The methods that meet the bound, the fastest first."""
        return tuple(choice for choice in self.choices if choice.status == "met")

    @property
    def call(self) -> str:
        """Python code of the run of the best method of this package; "" without one, and for a system of a config."""
        search = self.search
        best = next((choice for choice in self.ranked if choice.kind == "splitting"), None)
        if best is None or not search.arguments:
            return ""
        system, *start = search.arguments
        more = [] if search.t_end == checked_t_end(search.system.t_end) else [f"t_end={search.t_end!r}"]
        more += ["summation='plain'"] if best.summation == "plain" else []
        function = "ensemble" if len(search.starts) > 1 else "integrate"
        return f"nh.{function}({', '.join([system, repr(best.method), repr(best.tau), *start, *more])})"

    @property
    def unconfirmed(self) -> str:
        """The methods that meet the bound and are not confirmed, each with its error there."""
        return "; ".join(f"{c.shown} ({c.further_error:.1e})" for c in self.ranked if not c.confirmed)

    def missed(self, kind: str) -> str:
        """Return the methods of one kind that miss the bound, each with its smallest error."""
        missed = [choice for choice in self.choices if (choice.status, choice.kind) == ("missed", kind)]
        return "; ".join(_at_best(choice, self.search) for choice in missed)

    def not_run(self) -> str:
        """Return the methods that were not run, grouped by reason."""
        absent: dict[str, list[str]] = {}
        for choice in self.choices:
            if choice.status == "not run":
                absent.setdefault(choice.reason, []).append(choice.shown)
        return "; ".join(f"{', '.join(names)} ({reason})" for reason, names in absent.items())


def to_terminal(line: str) -> None:
    """Write a line to standard error if that is a terminal."""
    if sys.stderr.isatty():
        print(line, file=sys.stderr, flush=True)


def recommendation(
    search: Search, results: str | Path | None = None, report: Callable[[str], None] = to_terminal
) -> Recommendation:
    """Rank methods by the wall time of the cheapest run of each method that meets an error bound.

    Each recommended step was run over the whole interval and meets the bound, as do all finer steps that were run. It
    is linearly stable at the largest frequency along the orbit. Times are measured during the call. Choices of other
    libraries are read from the folder ``results`` of a finished target ``work_precision``, and left out if it is None.
    ``report`` is given a line of text for each method that was tried.

    Raises NearharmonicError: an unusable file of timings, or positions that cannot be compared with any reference.
    """
    libraries, origin = ([], "") if results is None else library_choices(search, Path(results))
    with pinned() as core:
        facts = machine(core)
        choices = search.choices(report)
        met = [choice for choice in choices if choice.status == "met"]
        calls = [
            prepared_call(search.system, search.methods[c.method], search.t_end, int(c.steps), c.summation, TIMED)
            for c in met
        ]
        times = zip(met, interleaved(calls, REPEATS), strict=True)
    least = {choice.method: min(repeats) for choice, repeats in times}
    choices = [replace(choice, time=least.get(choice.method, nan)) for choice in choices] + libraries
    basis = (
        f"measured now, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step listed "
        f"meets the error over the whole interval, and so do all finer steps that were run (with compensated sums, up "
        f"to {REACH} times as many and {search.longest} evaluations); {search.checks}"
        f"{origin and f'; other libraries: {origin}'}"
    )
    order = sorted(choices, key=lambda choice: (not choice.confirmed, inf if isnan(choice.time) else choice.time))
    return Recommendation(search=search, choices=tuple(order), basis=basis)


def library_choices(search: Search, results: Path) -> tuple[list[Choice], str]:
    """Return the choices of other libraries from the timings in a folder of results, and their origin as text.

    Raises ResultFileError: the file of timings cannot be read.
    """
    path, system = results / CUBE, search.system
    if system.name not in systems or systems[system.name] is not system:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if search.measure in measures and Fraction(end) == Fraction(search.t_end):
            choices = [_library_choice(curve, search) for curve in of_kind(curves, "peer")]
            return choices, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _library_choice(curve: xr.Dataset, search: Search) -> Choice:
    """Return the fastest setting that meets the bound, if all finer settings meet it too."""
    method, label, status = (curve[name].item() for name in ("solver", "label", "status"))
    choice = Choice(method=method, label=label, kind="peer", reason="" if status == "ok" else status)
    if not curve.sizes["point"]:
        return choice
    errors = dict(enumerate(curve[MEASURES[search.measure]].values.tolist()))
    times = curve[f"time_{TIMED}"].values.tolist()
    first = fewest_for_good(errors, search.error)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = min(settings or errors, key=times.__getitem__ if settings else lambda i: (isnan(errors[i]), errors[i]))
    shared = {name: curve[name].values[best].item() for name in SHARED}
    if not settings:
        return replace(choice, status="missed", error=errors[best], **shared)
    return replace(choice, status="met", error=errors[best], time=times[best], **shared)


# --- The ranking in words, and as a Dataset ---------------------------------------------------------------------------


def is_rounding(choice: Choice, search: Search) -> bool:
    """Return True if the energy error of a choice is near the rounding of V."""
    return search.measure != "position" and choice.error <= NEAR_FLOOR * search.floor


def step_text(choice: Choice, t_end: str) -> str | None:
    """Return the step of a choice in the fewest digits, four at least, that give its number of steps again.

    It is None if the choice has a tolerance in place of a step.
    """
    texts = (f"{choice.tau:.{digits}g}" for digits in range(DIGITS, 18))
    steps = choice.steps
    fits = (text for text in texts if not isfinite(steps) or steps_of(t_end, float(text)) == steps)
    return next(fits) if isfinite(choice.tau) else None


def _at_best(choice: Choice, search: Search) -> str:
    words = "every run fails"
    if isfinite(choice.error):
        step = step_text(choice, search.t_end)
        at = f"tolerance {choice.tolerance:.1g}" if step is None else f"tau {step}"
        ending = ", but not at all finer ones" if choice.error <= search.error else " at best"
        words = f"{choice.error:.1e}{' *' if is_rounding(choice, search) else ''} at {at}{ending}"
    return f"{choice.shown} ({words}" + (f"; {choice.reason})" if choice.reason else ")")


def as_dataset(advice: Recommendation) -> xr.Dataset:
    """Return the methods that meet the bound over ``rank``."""
    search, best = advice.search, advice.ranked

    def over(name: str, kind: type, notes: dict[str, str]) -> tuple[tuple[str], Any, dict[str, str]]:
        return ("rank",), np.array([getattr(choice, name) for choice in best], dtype=kind), notes

    energies = search.energy_attributes
    further = "largest energy error from other starts and over a longer interval"
    variables: Variables = {
        "rank": (("rank",), np.arange(1, len(best) + 1), described("rank by wall time, 1 for the fastest")),
        "integrator": over("method", str, described("integrator, a name or the path of a file")),
        "label": over("label", str, described("name in legends")),
        "tau": over("tau", float, described("largest step size found that meets the bound", search.system.units["t"])),
        "summation": over("summation", str, described("summation of the run, as integrate takes it")),
        "steps": over("steps", int, described("steps that cover [0, t_end]")),
        "evaluations": over("evaluations", int, described("force evaluations made")),
        **{
            name: over(name, float, {**notes, "long_name": search.over_members + notes["long_name"]})
            for name, notes in energies.items()
        },
        "further_error": over("further_error", float, described(further, energies[MEASURES["max"]]["units"])),
        "time": over("time", float, described("least wall time of one run on one core, without start-up", "s")),
    }
    if search.measure == "position":
        variables[MEASURES["position"]] = over("error", float, described(search.quantity))
    q0, p0 = map(json.dumps, search.system.start(float))
    attributes: dict[str, Any] = {
        **search.settings,
        **({"q0": q0, "p0": p0} if len(search.starts) == 1 else {"starts": len(search.starts)}),
        "missed": advice.missed("splitting"),
        "not_run": advice.not_run(),
        **{name: getattr(advice, name) for name in ("unconfirmed", "basis", "call")},
        **({"energy_floor": search.floor} if search.floor else {}),
    }
    return assembled(variables, ["rank", "label"], attributes)
