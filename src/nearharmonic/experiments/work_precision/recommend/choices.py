"""Choice of a method for an error bound: for each method the largest step that meets the bound, run and timed here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import inf, isnan, nan
from pathlib import Path
from typing import Literal

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.grid import check_fit, evaluations_of
from nearharmonic.engine.problem import checked_scale
from nearharmonic.engine.reference import Reference, position_t_end, reference
from nearharmonic.engine.settings import checked_tau, one_of
from nearharmonic.engine.trajectory import sweep
from nearharmonic.errors import SettingError
from nearharmonic.experiments.work_precision.clock import Patience, interleaved, machine, pinned
from nearharmonic.experiments.work_precision.curve import MEASURES, Curve
from nearharmonic.experiments.work_precision.own import POSITION_ROUNDING, ROUNDING, kernel_calls, warm_up
from nearharmonic.experiments.work_precision.recommend.step_search import fewest_steps, ladder, measured_errors
from nearharmonic.experiments.work_precision.tables import NAMES
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import System, systems

CUBE = Path("cubes/work_precision.h5")
RESULTS = "results/paper"

#: Evaluations of the force in a run that may be recommended.
EVALUATIONS = 200_000
#: Evaluations of the longest run made: steps near the budget, too, have finer ones beside them.
MOST_EVALUATIONS = EVALUATIONS * 5 // 4
TIMED = "trajectory"
#: The ranking rests on least times, most of which are below 1 ms: more repeats than for whole curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)


@dataclass(frozen=True, kw_only=True)
class Choice:
    """One method at the setting that is recommended, or at its best where none can be.

    Attributes
    ----------
    method, label
        Name in the registry and in legends.
    kind
        "splitting": a method of this package; "peer": another library's.
    status
        "met": the run meets the error bound, as do all finer ones made. "missed": no run within the budget does; the
        setting is that of the least error. "not run": ``reason`` says why.
    tau, tolerance
        Step size in the system's unit of time, NaN for adaptive methods; tolerance, NaN for fixed-step methods.
    steps, evaluations
        Steps of the run, and evaluations of the force; NaN if unknown.
    error
        Error of this run, in the measure asked for.
    time
        Least wall time of this run in s; NaN unless the status is "met".
    reason
        Why the method was not run, or its runs ended early; empty otherwise.
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: Literal["met", "missed", "not run"]
    tau: float = nan
    tolerance: float = nan
    steps: float = nan
    evaluations: float = nan
    error: float = nan
    time: float = nan
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Recommendation:
    """Methods for an error bound, ranked by the wall time of the run that is recommended.

    Attributes
    ----------
    system
        The system, integrated over [0, ``t_end``].
    t_end
        Decimal string, in the system's unit of time.
    measure
        Key of :data:`nearharmonic.experiments.work_precision.curve.MEASURES`.
    quantity
        The error in words, what it is relative to or its unit included.
    error
        Error bound.
    budget
        Evaluations of the force allowed in one run.
    choices
        Methods that meet the bound, the fastest first; then the others.
    basis
        Origin of runs and times, as text.
    """

    system: System
    t_end: str
    measure: str
    quantity: str
    error: float
    budget: int
    choices: tuple[Choice, ...]
    basis: str

    @property
    def ranked(self) -> tuple[Choice, ...]:
        """The methods that meet the bound, the fastest first."""
        return tuple(choice for choice in self.choices if choice.status == "met")


def recommend(
    system: str,
    error: object,
    *,
    measure: object = "max",
    results: str | Path = RESULTS,
    t_end: str | None = None,
) -> Recommendation:
    """Rank every method by the wall time of its cheapest run that meets an error bound.

    Each recommended step was run over the whole interval and meets the bound, as do all finer steps that were run.
    Times are taken here and now. Other libraries are taken from a finished target ``work_precision``, at settings that
    were run there.

    Parameters
    ----------
    system
        Name of a system, or path of a Python file that defines SYSTEM.
    error
        Error bound: a number above 0, or the decimal string of one.
    measure
        Key of :data:`nearharmonic.experiments.work_precision.curve.MEASURES`.
    results
        Folder of results that may hold timings of other libraries.
    t_end
        End of the interval as a decimal string; the system's own if not given.

    Returns
    -------
    Recommendation

    Raises
    ------
    NearharmonicError
        Unknown system or measure, an error that is no number above 0, a file that defines no system, or an unusable
        file of timings.
    """
    bound = checked_tau(error, "error")
    kind = one_of("measure", measure, tuple(MEASURES))
    subject = systems[system]
    end = subject.t_end if t_end is None else t_end
    t_end = position_t_end(subject, end) if kind == "position" else end
    peers, origin = _peers_of(Path(results) / CUBE if system in systems else None, subject, t_end, kind)
    exact = reference(subject, t_end) if kind == "position" else None
    with pinned() as core:
        warm_up(subject, modes=(TIMED,))
        facts = machine(core)
        choices = _timed(subject, t_end, [_choice(subject, t, t_end, kind, bound, exact) for t in integrators.values()])
    choices += [_peer_choice(curve, kind, bound) for curve in peers]
    basis = (
        f"measured on the spot, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step "
        f"listed was run over the whole interval and meets the error, as do all finer steps that were run, up to "
        f"{MOST_EVALUATIONS} evaluations; other libraries: {origin}"
    )
    order = sorted(choices, key=lambda choice: inf if isnan(choice.time) else choice.time)
    return Recommendation(
        system=subject, t_end=t_end, measure=kind, quantity=_quantity(subject, t_end, kind), error=bound,
        budget=EVALUATIONS, choices=tuple(order), basis=basis,
    )  # fmt: skip


def _quantity(system: System, t_end: str, measure: str) -> str:
    """What is bounded, as a Dataset has it: relative to |H0|, or to an energy that the system chooses, or in a unit."""
    if measure == "position":
        return NAMES[measure]
    notes = sweep(system, "ruth", [float(t_end)], t_end=t_end)[MEASURES[measure]].attrs
    words, unit = notes["long_name"].partition(" over every step")[0], notes["units"]
    return words if unit == "1" else f"{words} in {unit}"


def _choice(
    system: System, tableau: Tableau, t_end: str, measure: str, bound: float, exact: Reference | None
) -> Choice:
    """The largest step of ``tableau`` that meets ``bound``, not timed yet."""
    choice = Choice(method=tableau.name, label=tableau.label, kind="splitting", status="not run")
    try:
        check_fit(system, tableau)
    except SettingError:
        return replace(choice, reason=f"does not fit: it requires a {tableau.requires}")

    scale = checked_scale(system.energy_scale)

    def run(steps: Sequence[int]) -> Sequence[float]:
        paths = integrate_batch(system, tableau, t_end=Fraction(t_end), steps=steps, samples=2, scale=scale)
        if exact is None:
            found = getattr(paths, MEASURES[measure])
        else:
            found = np.where(paths.left_at > 0, inf, exact.error(paths.q[:, -1], paths.q_low[:, -1]))
        return [inf if isnan(error) else float(error) for error in found]

    floor = POSITION_ROUNDING if measure == "position" else ROUNDING
    errors = measured_errors(run, ladder(MOST_EVALUATIONS // tableau.stages), bound, floor)
    steps = fewest_steps(errors, bound)
    met = steps is not None and evaluations_of(tableau, steps) <= EVALUATIONS
    if steps is None or not met:
        steps = min((n for n in errors if evaluations_of(tableau, n) <= EVALUATIONS), key=errors.__getitem__)
    return replace(
        choice,
        status="met" if met else "missed",
        tau=float(Fraction(t_end) / steps),
        steps=steps,
        evaluations=evaluations_of(tableau, steps),
        error=errors[steps],
    )


def _timed(system: System, t_end: str, choices: Sequence[Choice]) -> list[Choice]:
    """``choices`` with the least time of each run that meets the bound, all in turns."""
    calls = {
        choice.method: kernel_calls(system, integrators[choice.method], Fraction(t_end), int(choice.steps), (TIMED,))
        for choice in choices
        if choice.status == "met"
    }
    for call in calls.values():
        call[TIMED]()
    repeats = interleaved([call[TIMED] for call in calls.values()], REPEATS)
    least = {method: min(times) for method, times in zip(calls, repeats, strict=True)}
    return [replace(choice, time=least.get(choice.method, nan)) for choice in choices]


def _peers_of(path: Path | None, system: System, t_end: str, measure: str) -> tuple[list[Curve], str]:
    """Curves of other libraries on ``system`` over [0, ``t_end``] from the file of timings, and their origin."""
    if path is None:
        return [], "not timed for a system of your own"
    if not path.is_file():
        return [], f"not timed ({path} does not exist; snakemake work_precision makes it)"
    from nearharmonic.experiments.work_precision.run import read_parts

    parts, facts = read_parts(path, system.name)
    for end, measures, curves in parts:
        if measure in measures and Fraction(end) == Fraction(t_end):
            peers = [curve for curve in curves if curve.kind == "peer"]
            return peers, f"{path}, measured {facts['measured']} on {facts['cpu']}"
    return [], f"not timed ({path} has no timings of this measure over this interval)"


def _peer_choice(curve: Curve, measure: str, bound: float) -> Choice:
    """The fastest setting among those that meet ``bound`` as do all finer ones, from the coarsest of them on."""
    reason = "" if curve.status == "ok" else curve.status
    choice = Choice(method=curve.method, label=curve.label, kind="peer", status="not run", reason=reason)
    if not curve.points:
        return choice
    errors = {i: float(getattr(point, MEASURES[measure])) for i, point in enumerate(curve.points)}
    times = [min(point.times.get(TIMED, ()), default=nan) for point in curve.points]
    first = fewest_steps(errors, bound)
    settings = [] if first is None else [i for i in errors if i >= first and not isnan(times[i])]
    # A looser tolerance may cost more: the coarsest setting is not always the fastest.
    best = (
        min(settings, key=times.__getitem__) if settings else min(errors, key=lambda i: (isnan(errors[i]), errors[i]))
    )
    point = curve.points[best]
    return replace(
        choice,
        status="met" if settings else "missed",
        tau=point.tau,
        tolerance=point.tolerance,
        steps=point.steps,
        evaluations=point.evaluations,
        error=errors[best],
        time=times[best] if settings else nan,
    )
