"""``nearharmonic.recommend``: methods for an error bound, by the search and by timings of other libraries."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, localcontext
from fractions import Fraction
from math import inf, isfinite, isnan, nan
from numbers import Rational
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import check_bound
from nearharmonic.engine.kernels import NEAR_FLOOR, floor_in_words
from nearharmonic.engine.numbers import standard_parameters, start_array
from nearharmonic.engine.reference import position_t_end
from nearharmonic.engine.settings import (
    MOST_STEPS,
    checked_count,
    checked_t_end,
    checked_tau,
    one_of,
    positive,
    steps_of,
)
from nearharmonic.engine.setup import ANY, Setup, as_python
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import bad_setting, warn_caller
from nearharmonic.integrators import integrators, load_tableaus
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, machine, pinned
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.written import exact_value
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.recommendation.measure import MEASURES, fewest_for_good, of_kind, prepared_calls, read_parts
from nearharmonic.recommendation.search import REACH, Choice, Question, Search
from nearharmonic.registry import is_path, split_path
from nearharmonic.systems import System, systems
from nearharmonic.systems.quantities import is_list

if TYPE_CHECKING:
    import xarray as xr

#: Evaluations of the force in a run that may be recommended, unless another budget is given.
EVALUATIONS = 200_000
#: The ranking compares least times, most of them below 1 ms: more repeats than for curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)
#: Timings of other libraries in a folder of results, and the mode that is compared: one trajectory.
CUBE, TIMED = Path("cubes/work_precision.h5"), "trajectory"
#: Values of a setting of another library that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Significant digits of a printed step, unless another number of steps would come of it.
DIGITS = 4
#: Digits in which a sum of two doubles is exact.
EXACT = 5000


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
        Methods to choose from: names, paths of files (one for all methods of its file), or Tableaus. By default all,
        of which those that need many more evaluations than ten others are not searched for.
    budget : int, optional
        Most evaluations of the force in a run that may be recommended, by default 200 000; the work of the search
        grows with it.

    Returns
    -------
    xarray.Dataset
        Over ``rank``, 1 for the fastest: ``integrator``, a name or a path as :func:`nearharmonic.integrate` takes it;
        ``label``; ``tau``, ``summation``, ``steps`` and ``evaluations`` of its run; ``max_energy_error`` and
        ``mean_energy_error``, which ``integrate`` finds for this ``tau`` and ``summation``, and ``position_error`` if
        that is the measure; ``time``, the least wall time of the run in s, of one trajectory on one core. Uncompensated
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
    >>> found = nh.recommend("sho", 1e-6, methods=["ruth", "babps8o7h"], t_end=50)
    >>> bool((found.max_energy_error <= 1e-6).all())
    True
    >>> sorted(found.integrator.values.tolist())
    ['babps8o7h', 'ruth']
    """
    asked = question(
        system, error, measure=measure, t_end=t_end, q0=q0, p0=p0, methods=methods, budget=budget
    )  # fmt: skip
    found = recommendation(asked)
    if not found.ranked:
        warn_caller(
            f"no method has an error of at most {asked.error} within {asked.budget} evaluations: attributes missed and "
            "not_run say how near each came; a larger budget= tries smaller step sizes"
        )
    return as_dataset(found)


def question(
    system: str | System,
    error: object,
    *,
    measure: object = "max",
    t_end: object = None,
    q0: object = None,
    p0: object = None,
    methods: object = None,
    budget: object = None,
) -> Question:
    """Validate a question; arguments and errors as for :func:`nearharmonic.recommend`."""
    bound = checked_tau(error, "error")
    kind = one_of("measure", measure, tuple(MEASURES))
    most = EVALUATIONS if budget is None else checked_count("budget", budget, MOST_STEPS)
    if t_end is not None:
        positive("t_end", t_end)
    problem = Setup(system, ANY, t_end=t_end)  # type: ignore[arg-type]
    positive("t_end", problem.t_end)  # the system's own may run backwards
    chosen = _methods(methods)
    starts = start_array(problem.system, q0, p0, plain=False)
    check_bound(problem.system, starts, standard_parameters(problem.system)[None, :])
    subject = problem.system if q0 is None and p0 is None else _started(problem.system, starts[0])
    if len(starts) > 1 and kind == "position":
        raise bad_setting("measure", kind, "max or mean for several starts: exact positions are known of one")
    # A run of one step refuses a start where the energy is no number, and says what errors are relative to.
    told = sweep(subject, ANY, [float(problem.end)], t_end=problem.t_end)
    for i in np.flatnonzero(~np.isfinite(problem.run([1] * len(starts), 2, start=starts).energy)):
        raise bad_setting(f"(q0, p0) of start {i}", starts[i, ::2].tolist(), "a start where the energy is finite")
    return Question(
        system=subject,
        arguments=_arguments(system, q0=q0, p0=p0),
        t_end=position_t_end(subject, problem.t_end) if kind == "position" else problem.t_end,
        measure=kind,
        error=bound,
        budget=most,
        methods=chosen,
        energy_attributes={name: told[name].attrs for name in (MEASURES["max"], MEASURES["mean"])},
        starts=starts,
        every=methods is None,
        floor=told.attrs.get("energy_floor", 0.0),
    )


def _arguments(system: str | os.PathLike[str] | System, **start: Any) -> tuple[str, ...]:
    """Return Python code of a system, which is its name if it is an object, and of initial values."""
    if not (isinstance(system, System) or system in systems.registered or is_path(os.fspath(system))):
        return ()
    many = {key: np.ndim(x) > 1 and len(x) > 1 for key, x in start.items()}
    texts = {key: key if many[key] else repr(_numbers(x)) for key, x in start.items() if x is not None}
    return (as_python(system), *(f"{key}={text}" for key, text in texts.items()))


def _numbers(given: Any) -> list[int | float | str]:
    """Return initial values as Python writes them: fractions and the like as text."""
    values = np.array(given, dtype=object).ravel().tolist()
    plain = (x.item() if isinstance(x, np.generic) else x for x in values)
    return [
        x if isinstance(x, int | float) else str(x if isinstance(x, str | Decimal | Rational) else exact_value(x))
        for x in plain
    ]


def _started(system: System, start: Floats) -> System:
    """Return the system with other initial values: the exact pairs of doubles of its runs, in all their digits."""
    with localcontext() as context:
        context.prec = EXACT
        pairs = np.vectorize(Decimal, otypes=[object])(start.reshape(4, -1)[:, : system.dimension])
        q, p = (tuple(map(str, high + low)) for high, low in pairs.reshape(2, 2, -1))
    return replace(system, q0=q, p0=p)


def _methods(asked: Any) -> dict[str, Tableau]:
    """Return the methods by name, methods of users' files by path; a path stands for all methods of its file."""
    if asked is None:
        return dict(integrators)
    key, allowed = "methods", "a list of at least one name, file path or Tableau"
    if isinstance(asked, Tableau) or not is_list(asked):
        raise bad_setting(key, asked, allowed)
    found: dict[str, Tableau] = {}
    for one in asked:
        name = os.fspath(one) if isinstance(one, os.PathLike) else one
        several = load_tableaus(name) if is_path(name) and not split_path(name)[1] else {}
        if isinstance(one, Tableau):
            entries = {one.name: one}
        elif len(several) > 1:
            entries = {f"{name}:{method}": tableau for method, tableau in several.items()}
        else:
            entries = {integrators.name_of(name): integrators[name]}
        for method, tableau in entries.items():
            if found.setdefault(method, tableau) is not tableau:
                raise bad_setting(key, method, "two methods have this name")
    if not found:
        raise bad_setting(key, asked, allowed)
    return found


# --- Ranking ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods for an error bound, ranked by the wall time of the run that is recommended.

    ``choices``: those that meet the bound, the fastest first, behind them those whose step is not confirmed, then the
    others. ``basis`` is the origin of runs and times, as text.
    """

    question: Question
    choices: tuple[Choice, ...]
    basis: str

    @property
    def floor_in_words(self) -> str:
        """Sentence about choices whose error is marked as rounding, "" if there is none."""
        marked = any(is_rounding(choice, self.question) for choice in self.choices)
        return f"*: {floor_in_words(self.question.floor)}" if marked else ""

    @property
    def ranked(self) -> tuple[Choice, ...]:
        """The methods that meet the bound, the fastest first."""
        return tuple(choice for choice in self.choices if choice.status == "met")

    @property
    def call(self) -> str:
        """Python code of the run of the best method of this package; "" without one, and for a system of a config."""
        asked = self.question
        best = next((choice for choice in self.ranked if choice.kind == "splitting"), None)
        if best is None or not asked.arguments:
            return ""
        system, *start = asked.arguments
        more = [] if asked.t_end == checked_t_end(asked.system.t_end) else [f"t_end={asked.t_end!r}"]
        more += ["summation='plain'"] if best.summation == "plain" else []
        function = "ensemble" if len(asked.starts) > 1 else "integrate"
        return f"nh.{function}({', '.join([system, repr(best.method), repr(best.tau), *start, *more])})"

    @property
    def unconfirmed(self) -> str:
        """The methods that meet the bound and are not confirmed, each with its error there."""
        return "; ".join(f"{one.shown} ({one.further_error:.1e})" for one in self.ranked if not one.confirmed)

    def missed(self, kind: str) -> str:
        """Return the methods of one kind that miss the bound, each with its smallest error."""
        missed = [choice for choice in self.choices if (choice.status, choice.kind) == ("missed", kind)]
        return "; ".join(_at_best(choice, self.question) for choice in missed)

    def not_run(self) -> str:
        """Return the methods that were not run, those of one reason together with it."""
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
    asked: Question, results: str | Path | None = None, report: Callable[[str], None] = to_terminal
) -> Recommendation:
    """Rank methods by the wall time of the cheapest run of each method that meets an error bound.

    Each recommended step was run over the whole interval and meets the bound, as do all finer steps that were run. It
    is linearly stable at the largest frequency along the orbit. Times are measured during the call. Choices of other
    libraries are read from the folder ``results`` of a finished target ``work_precision``, and left out if it is None.
    ``report`` is given a line of text for each method that was tried.

    Raises NearharmonicError: an unusable file of timings, or positions that cannot be compared with any reference.
    """
    libraries, origin = ([], "") if results is None else library_choices(asked, Path(results))
    search = Search(asked)
    with pinned() as core:
        facts = machine(core)
        choices = _timed(asked, list(search.choices(report))) + libraries
    basis = (
        f"measured on the spot, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step "
        f"listed was run over the whole interval and meets the error, as do all finer steps that were run (these with "
        f"compensated sums), up to {REACH} times as many and {asked.longest} evaluations; {search.checks}"
        f"{origin and f'; other libraries: {origin}'}"
    )
    order = sorted(choices, key=lambda choice: (not choice.confirmed, inf if isnan(choice.time) else choice.time))
    return Recommendation(question=asked, choices=tuple(order), basis=basis)


def _timed(asked: Question, choices: Sequence[Choice]) -> list[Choice]:
    """Return ``choices`` with the least time of each run that meets the bound, from interleaved repeats."""
    calls: dict[str, Callable[[], object]] = {}
    for choice in choices:
        if choice.status == "met":
            tableau, steps = asked.methods[choice.method], int(choice.steps)
            made = prepared_calls(asked.system, tableau, asked.t_end, steps, choice.summation, modes=(TIMED,))
            calls[choice.method] = made[TIMED]
    repeats = interleaved(list(calls.values()), REPEATS)
    least = {method: min(times) for method, times in zip(calls, repeats, strict=True)}
    return [replace(choice, time=least.get(choice.method, nan)) for choice in choices]


def library_choices(asked: Question, results: Path) -> tuple[list[Choice], str]:
    """Return the choices of other libraries from the timings in a folder of results, and their origin as text.

    Raises ResultFileError: the file of timings cannot be read.
    """
    path, system = results / CUBE, asked.system
    if system.name not in systems or systems[system.name] is not system:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if asked.measure in measures and Fraction(end) == Fraction(asked.t_end):
            choices = [_library_choice(curve, asked) for curve in of_kind(curves, "peer")]
            return choices, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _library_choice(curve: xr.Dataset, asked: Question) -> Choice:
    """Return the fastest setting that meets the bound, if all finer settings meet it too."""
    method, label, status = (curve[name].item() for name in ("solver", "label", "status"))
    reason = "" if status == "ok" else status
    choice = Choice(method=method, label=label, kind="peer", status="not run", reason=reason)
    if not curve.sizes["point"]:
        return choice
    errors = dict(enumerate(curve[MEASURES[asked.measure]].values.tolist()))
    times = curve[f"time_{TIMED}"].values.tolist()
    first = fewest_for_good(errors, asked.error)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = min(settings or errors, key=times.__getitem__ if settings else lambda i: (isnan(errors[i]), errors[i]))
    return replace(
        choice,
        status="met" if settings else "missed",
        error=errors[best],
        time=times[best] if settings else nan,
        **{name: curve[name].values[best].item() for name in SHARED},
    )


# --- The ranking in words, and as a Dataset ---------------------------------------------------------------------------


def is_rounding(choice: Choice, asked: Question) -> bool:
    """Return True if the energy error of a choice is near the rounding of V."""
    return asked.measure != "position" and choice.error <= NEAR_FLOOR * asked.floor


def printed_step(t_end: str, tau: float, steps: int) -> str:
    """Return ``tau`` in the fewest digits, four at least, that give ``steps`` steps over [0, ``t_end``] again."""
    texts = (f"{tau:.{digits}g}" for digits in range(DIGITS, 18))
    return next(text for text in texts if steps_of(t_end, float(text)) == steps)


def step_text(choice: Choice, t_end: str) -> str | None:
    """Return the step of a choice as :func:`printed_step` prints it, or None if it has a tolerance in its place."""
    if not isfinite(choice.tau):
        return None
    return printed_step(t_end, choice.tau, int(choice.steps)) if isfinite(choice.steps) else f"{choice.tau:.{DIGITS}g}"


def _at_best(choice: Choice, asked: Question) -> str:
    if not isfinite(choice.error):
        says = "every run fails"
    else:
        step = step_text(choice, asked.t_end)
        mark = " *" if is_rounding(choice, asked) else ""
        says = f"{choice.error:.1e}{mark} at {f'tolerance {choice.tolerance:.1g}' if step is None else f'tau {step}'}"
        says += ", but not at all finer ones" if choice.error <= asked.error else " at best"
    return f"{choice.shown} ({says}" + (f"; {choice.reason})" if choice.reason else ")")


def as_dataset(found: Recommendation) -> xr.Dataset:
    """Return the methods that meet the bound over ``rank``."""
    asked, best = found.question, found.ranked
    q0, p0 = asked.system.start(float)

    def over(name: str, meaning: str, unit: str = "1", kind: type = float) -> tuple[tuple[str], Any, dict[str, str]]:
        return ("rank",), np.array([getattr(choice, name) for choice in best], dtype=kind), described(meaning, unit)

    variables: Variables = {
        "rank": (("rank",), np.arange(1, len(best) + 1), described("rank by wall time, 1 for the fastest")),
        "integrator": over("method", "integrator, a name or the path of a file", kind=str),
        "label": over("label", "name in legends", kind=str),
        "tau": over("tau", "largest step size found that meets the bound", asked.system.units["t"]),
        "summation": over("summation", "summation of the run, as integrate takes it", kind=str),
        "steps": over("steps", "steps that cover [0, t_end]", kind=int),
        "evaluations": over("evaluations", "force evaluations made", kind=int),
        **{
            name: (*over(name, "")[:2], {**notes, "long_name": asked.over_members + notes["long_name"]})
            for name, notes in asked.energy_attributes.items()
        },
        "further_error": over(
            "further_error",
            "largest energy error from other starts and over a longer interval",
            asked.energy_attributes[MEASURES["max"]]["units"],
        ),
        "time": over("time", "least wall time of one run on one core, without start-up", "s"),
    }
    if asked.measure == "position":
        variables[MEASURES["position"]] = over("error", asked.quantity)
    attributes: dict[str, Any] = {
        "system": asked.system.name,
        **{name: getattr(asked, name) for name in ("t_end", "measure", "error", "budget")},
        **({"q0": json.dumps(q0), "p0": json.dumps(p0)} if len(asked.starts) == 1 else {"starts": len(asked.starts)}),
        "missed": found.missed("splitting"),
        "not_run": found.not_run(),
        **{name: getattr(found, name) for name in ("unconfirmed", "basis", "call")},
        **({"energy_floor": asked.floor} if asked.floor else {}),
    }
    return assembled(variables, ["rank", "label"], attributes)
