"""Choice of a method for an error bound: the largest step of each method that meets the bound, run and timed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf, isnan, nan
from pathlib import Path

import numpy as np

from nearharmonic.engine.batch.batch import integrate_batch
from nearharmonic.engine.batch.results import Trajectories, least_samples
from nearharmonic.engine.grid import misfit
from nearharmonic.engine.reference import Reference, reference
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, machine, pinned
from nearharmonic.recommendation.curve import MEASURES
from nearharmonic.recommendation.own import LOSSLESS, POSITION_ROUNDING, ROUNDING, prepared_calls
from nearharmonic.recommendation.question import Question
from nearharmonic.recommendation.recommendation import Choice, Recommendation
from nearharmonic.recommendation.step_search import fewest_steps, ladder, measured_errors
from nearharmonic.recommendation.timings import TIMED, library_choices

#: The ranking compares least times, most of them below 1 ms: more repeats than for curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)
#: Relative margin of the mean below the bound: its last digits depend on the number of samples of a run.
MEAN_ROUNDING = 1e-9


def recommendation(
    asked: Question, results: str | Path | None = None, watched: Callable[[Iterable[str]], Iterable[str]] = iter
) -> Recommendation:
    """Rank methods by the wall time of the cheapest run of each method that meets an error bound.

    Each recommended step was run over the whole interval and meets the bound, as do all finer steps that were run.
    Times are measured during the call. Choices of other libraries are read from a finished target ``work_precision``.

    Parameters
    ----------
    asked
        System, error bound and methods.
    results
        Folder of results that may hold timings of other libraries; None to leave these out.
    watched
        Function of the names of the methods that returns them again, one by one as they are tried, to show progress.

    Raises
    ------
    NearharmonicError
        An unusable file of timings, or positions that cannot be compared with any reference.
    """
    libraries, origin = ([], "") if results is None else library_choices(asked, Path(results))
    exact = reference(asked.system, asked.t_end) if asked.measure == "position" else None
    with pinned() as core:
        facts = machine(core)
        choices = _timed(asked, [_choice(asked, name, exact) for name in watched(asked.methods)]) + libraries
    basis = (
        f"measured on the spot, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step "
        f"listed was run over the whole interval and meets the error, as do all finer steps that were run (these with "
        f"compensated sums), up to {asked.longest} evaluations{origin and f'; other libraries: {origin}'}"
    )
    order = sorted(choices, key=lambda choice: inf if isnan(choice.time) else choice.time)
    return Recommendation(question=asked, choices=tuple(order), basis=basis)


def _choice(asked: Question, name: str, exact: Reference | None) -> Choice:
    """Return the largest step of a method that meets the bound, not timed yet."""
    tableau = asked.methods[name]
    choice = Choice(method=name, label=tableau.label, kind="splitting", status="not run")
    reason, _ = misfit(asked.system, tableau)
    if reason:
        return replace(choice, reason=f"does not fit: {reason}")
    one_step = tableau.evaluations(1)
    if one_step > asked.budget:
        return replace(choice, reason=f"a single step takes {one_step} evaluations")

    def run(steps: Sequence[int]) -> Sequence[float]:
        return _errors(asked, _runs(asked, tableau, steps), exact)

    floor = POSITION_ROUNDING if asked.measure == "position" else ROUNDING
    bound = asked.error * (1 - MEAN_ROUNDING) if asked.measure == "mean" else asked.error
    errors = measured_errors(run, ladder(asked.longest // tableau.stages), bound, floor)
    steps = fewest_steps(errors, bound)
    met = steps is not None and tableau.evaluations(steps) <= asked.budget
    if steps is None or not met:
        steps = min((n for n in errors if tableau.evaluations(n) <= asked.budget), key=errors.__getitem__)
    choice = replace(
        choice,
        status="met" if met else "missed",
        tau=float(Fraction(asked.t_end) / steps),
        steps=steps,
        evaluations=tableau.evaluations(steps),
    )
    careful, plain = (_measured(asked, choice, exact, summation) for summation in ("compensated", "plain"))
    if careful.evaluations > asked.budget:  # of an implicit method, whose iterations are known afterwards
        return replace(careful, status="missed")
    return plain if met and plain.error <= bound and _loses_nothing(plain, careful) else careful


def _measured(asked: Question, choice: Choice, exact: Reference | None, summation: str) -> Choice:
    """Return ``choice`` with the errors of its run."""
    run = _runs(asked, asked.methods[choice.method], [int(choice.steps)], summation)
    return replace(
        choice,
        summation=summation,
        evaluations=int(run.evaluations[0]),
        error=_errors(asked, run, exact)[0],
        max_energy_error=float(run.max_energy_error[0]),
        mean_energy_error=float(run.mean_energy_error[0]),
    )


def _loses_nothing(plain: Choice, careful: Choice) -> bool:
    errors = ("error", "max_energy_error", "mean_energy_error")
    return all(getattr(plain, name) <= LOSSLESS * getattr(careful, name) for name in errors)


def _runs(asked: Question, tableau: Tableau, steps: Sequence[int], summation: str = "compensated") -> Trajectories:
    return integrate_batch(
        asked.system, tableau, t_end=Fraction(asked.t_end), steps=steps, samples=least_samples(tableau),
        scale=asked.scale, numerics=Numerics(summation=summation),
    )  # fmt: skip


def _errors(asked: Question, paths: Trajectories, exact: Reference | None) -> list[float]:
    """Return the errors of runs in the requested measure, infinite where a run failed."""
    if exact is None:
        found = getattr(paths, MEASURES[asked.measure])
    else:
        found = np.where(paths.left_at > 0, inf, exact.error(*paths.ends))
    return [inf if isnan(error) else float(error) for error in found]


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
