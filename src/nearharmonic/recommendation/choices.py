"""Choice of a method for an error bound: the largest step of each method that meets the bound, run and timed."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import inf, isnan, nan, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories, joined, least_samples
from nearharmonic.engine.reference import Reference, reference
from nearharmonic.engine.settings import Numerics, misfit
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, machine, pinned
from nearharmonic.numerics.portable import Floats, quasi_random
from nearharmonic.recommendation.measure import (
    LOSSLESS,
    MEASURES,
    POSITION_ROUNDING,
    ROUNDING,
    of_kind,
    prepared_calls,
    read_parts,
)
from nearharmonic.recommendation.question import QUANTILE, Question
from nearharmonic.recommendation.recommendation import Choice, Recommendation
from nearharmonic.recommendation.stability import Orbits, orbits
from nearharmonic.recommendation.step_search import MARGIN, fewest_for_good, ladder, measured_errors
from nearharmonic.systems import systems
from nearharmonic.theory.linear_stability import stability_limit

if TYPE_CHECKING:
    import xarray as xr

#: The ranking compares least times, most of them below 1 ms: more repeats than for curves.
REPEATS = Patience(least=15, most=25, seconds=0.01)
#: Timings of other libraries in a folder of results, and the mode that is compared: one trajectory.
CUBE, TIMED = Path("cubes/work_precision.h5"), "trajectory"
#: Values of a setting of another library that a choice takes over.
SHARED = ("tau", "tolerance", "steps", "evaluations", "max_energy_error", "mean_energy_error")
#: Relative margin of the mean below the bound: its last digits depend on the number of samples of a run.
MEAN_ROUNDING = 1e-9
#: Where all registered methods are asked, the coarse runs end at so many times the evaluations of the best method, and
#: not before so many methods meet the bound: others would take longer.
DROPPED, RANKED = 2, 10
#: Finest steps of a search: so many times as many as those of the coarse run that meets the bound.
REACH = 8
#: Starts of an ensemble that the search runs, and starts at most whose errors are taken in the end.
SEARCHED, MOST_STARTS = 8, 1024
#: Numbers that one call keeps at most.
KEPT = 2**22
#: Perturbed starts, the length of the longer interval over that of the first, and the ratio of their errors to the
#: bound at which a step is confirmed.
PERTURBED, LONGER, CONFIRMED = 3, 4, 2
#: Ratio of numbers of steps that are tried one after the other until a step is confirmed.
FINER = 1.1


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
    exact = reference(asked.system, asked.t_end) if asked.measure == "position" else None
    with pinned() as core:
        facts = machine(core)
        search = Search(asked, exact)
        choices = _timed(asked, list(search.choices(report))) + libraries
    basis = (
        f"measured on the spot, {facts['measured']} on {facts['cpu']}, load average {facts['load_average']}; each step "
        f"listed was run over the whole interval and meets the error, as do all finer steps that were run (these with "
        f"compensated sums), up to {REACH} times as many and {asked.longest} evaluations; {search.checks}"
        f"{origin and f'; other libraries: {origin}'}"
    )
    order = sorted(choices, key=lambda choice: (not choice.confirmed, inf if isnan(choice.time) else choice.time))
    return Recommendation(question=asked, choices=tuple(order), basis=basis)


@dataclass(frozen=True)
class Search:
    """Search for the largest step of each method that answers a question."""

    asked: Question
    exact: Reference | None

    @cached_property
    def starts(self) -> Floats:
        """The starts (M, 4 D) whose errors are taken: all, or as many of a larger ensemble in even distances."""
        return _evenly(self.asked.starts, MOST_STARTS)

    @cached_property
    def orbits(self) -> Orbits:
        """Orbits from the starts that the search runs."""
        asked = self.asked
        return orbits(asked.system, Fraction(asked.t_end), _evenly(self.starts, SEARCHED), asked.budget)

    @cached_property
    def perturbation(self) -> float:
        """Relative change of a perturbed start, too small for its energy to matter unless it grows."""
        return min(max(sqrt(self.asked.error) / 100, 1e-9), 1e-3)

    @property
    def bound(self) -> float:
        """Largest error of a run of the search."""
        return self.asked.error * (1 - MEAN_ROUNDING) if self.asked.measure == "mean" else self.asked.error

    @property
    def checks(self) -> str:
        """Checks beside the error of the run, as text."""
        asked, omega = self.asked, self.orbits.frequency
        where = "along the orbit" if len(asked.starts) == 1 else f"along {min(SEARCHED, len(asked.starts))} orbits"
        stable = f"the largest frequency {where}, {omega:.3g}, times the step is below the limit of linear stability"
        if asked.system.regularisation is not None:
            stable = "linear stability is not checked for regularised systems"
        elif not omega:
            stable = f"there is no frequency {where} that bounds a step"
        others = f"{PERTURBED} starts perturbed by {self.perturbation:.0e}"
        if len(asked.starts) > 1:
            others = f"all of {len(self.starts)} starts"
            stable += f"; the search ran {min(SEARCHED, len(asked.starts))} of them, and the {QUANTILE:g} quantile of "
            stable += f"{len(self.starts)} meets the error"
        kind = "an energy error at most twice its own" if self.exact else "at most twice the error"
        return f"{stable}; confirmed by {kind} from {others} and over {LONGER} times the interval"

    def choices(self, report: Callable[[str], None]) -> Iterable[Choice]:
        """Return a choice for each method, not timed yet; those of the fewest evaluations from a denser search."""
        coarse, unrun = self._coarse(report)
        few, found = sum(name not in unrun for name in coarse) <= RANKED, dict[str, Choice]()
        for i, (name, tableau) in enumerate(self.asked.methods.items(), 1):
            choice = Choice(method=name, label=tableau.label, kind="splitting", status="not run")
            if name in unrun:
                choice = replace(choice, reason=unrun[name])
            else:
                choice = self._choice(choice, coarse[name], dense=few)
            found[name] = choice
            told = choice.reason or f"error {choice.error:.1e} at tau {choice.tau:.4g}"
            report(f"{i} of {len(self.asked.methods)}: {choice.shown}: {choice.status}, {told}")
        met = sorted((one for one in found.values() if one.status == "met"), key=lambda one: one.evaluations)
        for choice in [] if few else met[:RANKED]:
            found[choice.method] = self._choice(choice, coarse[choice.method], dense=True)
            report(f"{choice.shown}: searched with more step sizes")
        return found.values()

    def _coarse(self, report: Callable[[str], None]) -> tuple[dict[str, dict[int, float]], dict[str, str]]:
        """Return the errors of coarse runs by method, the last of which meets the bound, and why others are not run."""
        asked, coarse, unrun = self.asked, dict[str, dict[int, float]](), dict[str, str]()
        for name, tableau in asked.methods.items():
            reason, _ = misfit(asked.system, tableau)
            one_step = tableau.evaluations(1)
            if reason:
                unrun[name] = f"does not fit: {reason}"
            elif one_step > asked.budget:
                unrun[name] = f"a single step takes {one_step} evaluations"
            else:
                coarse[name] = {}
        going, evaluations, met, last = list(coarse), 2, list[tuple[int, str]](), asked.longest
        while going and evaluations < last:
            evaluations = min(2 * evaluations, last)
            for name in tuple(going):
                errors, tableau = coarse[name], asked.methods[name]
                steps = evaluations // tableau.stages
                # No method is stable at a step above 2 a stage.
                if steps < 1 or self._radians(steps) > 2 * tableau.stages:
                    continue
                run = self._runs(tableau, [steps], _evenly(self.starts, SEARCHED))
                errors[steps] = float(self._each(run).max())
                if errors[steps] <= self.bound and steps >= self._least(tableau):
                    going.remove(name)
                    # Those of an implicit method depend on its iterations.
                    met = sorted([*met, (max(evaluations, int(run.evaluations.max())), name)])
            if asked.every and len(met) >= RANKED:
                last = min(last, max(DROPPED * met[0][0], met[RANKED - 1][0]))
            if met:
                report(f"runs of {evaluations} evaluations: {len(met)} of {len(asked.methods)} methods meet the error")
        if last < asked.longest:
            reason = f"more than {evaluations} evaluations, and {met[0][1]} takes at most {met[0][0]}"
            unrun |= dict.fromkeys(going, reason)
        return coarse, unrun

    def _radians(self, steps: int) -> float:
        """Product of the largest frequency and the step size of so many steps."""
        return float(self.asked.t_end) / steps * self.orbits.frequency

    def _least(self, tableau: Tableau) -> int:
        """Fewest steps that are linearly stable at the largest frequency."""
        limit = float(stability_limit(tableau))  # infinite for an implicit method
        return int(self._radians(1) / limit) + 1

    def _choice(self, unrun: Choice, coarse: Mapping[int, float], *, dense: bool) -> Choice:
        """Return the largest step of a method that meets the bound, after its coarse runs."""
        asked, tableau, errors = self.asked, self.asked.methods[unrun.method], dict(coarse)
        choice = Choice(method=unrun.method, label=tableau.label, kind="splitting", status="missed")
        most, least, last = asked.longest // tableau.stages, self._least(tableau), max(errors, default=0)
        if errors and errors[last] <= self.bound and least <= last:
            finest = min(most, REACH * last)
            rungs = sorted({max(least, last // 2), last, finest, *ladder(most if dense else finest)})
            rungs = [n for n in rungs if max(least, last // 2) <= n <= finest]
            floor = POSITION_ROUNDING if asked.measure == "position" else ROUNDING
            errors |= measured_errors(lambda steps: self._errors(tableau, steps), rungs, self.bound, floor)
            first = fewest_for_good({n: error for n, error in errors.items() if n >= least}, self.bound)
            if first is not None:
                found = self._confirmed(choice, first, [n for n in errors if n > first])
                if found.status == "met":
                    plain = self._measured(found, "plain")
                    harmless = plain.error <= self.bound and _loses_nothing(plain, found)
                    return plain if harmless else found
        within = [n for n in errors if tableau.evaluations(n) <= asked.budget]
        if least > asked.budget // tableau.stages:
            reason = f"a stable step is below {float(asked.t_end) / least:.2g}"
            choice = replace(choice, reason=reason)
        if not within:
            return replace(choice, status="not run", reason=choice.reason or "its steps are not stable")
        return self._measured(self._with_steps(choice, min(within, key=errors.__getitem__)), "compensated")

    def _with_steps(self, choice: Choice, steps: int) -> Choice:
        evaluations = self.asked.methods[choice.method].evaluations(steps)
        return replace(choice, tau=float(Fraction(self.asked.t_end) / steps), steps=steps, evaluations=evaluations)

    def _confirmed(self, choice: Choice, first: int, finer: Sequence[int]) -> Choice:
        """Return a choice of ``first`` or more steps that meets the bound from all starts, confirmed if one is.

        Its status is that of ``choice`` if there is none within the budget.
        """
        asked, met = self.asked, choice
        steps, known = first, sorted(finer)
        while asked.methods[choice.method].evaluations(steps) <= asked.budget:
            if met.status == "met" and steps > MARGIN * met.steps:
                break
            one = self._measured(self._with_steps(choice, steps), "compensated")
            # The iterations of an implicit method are known afterwards.
            if one.evaluations <= asked.budget and one.error <= self.bound:
                own = one.max_energy_error if self.exact else asked.error
                limit = CONFIRMED * max(own, 10 * ROUNDING) + 10 * asked.floor
                error = self._further_error(one)
                one = replace(one, status="met", further_error=error, confirmed=error <= limit)
                met = one if met.status != "met" or one.confirmed else met
                if one.confirmed:
                    break
            wanted = max(steps + 1, int(steps * FINER))
            steps = next((n for n in known if n >= wanted), wanted)
        return met

    def _further_error(self, choice: Choice) -> float:
        """Largest energy error of the runs that confirm a choice."""
        asked, tableau, steps = self.asked, self.asked.methods[choice.method], int(choice.steps)
        name = MEASURES["max" if self.exact else asked.measure]
        longer = self._runs(tableau, [LONGER * steps], _evenly(self.starts, SEARCHED), times=LONGER)
        others = self._runs(tableau, [steps], self.starts if len(self.starts) > 1 else self._perturbed())
        errors = np.concatenate([getattr(paths, name) for paths in (longer, others)])
        return float(np.where(np.isnan(errors), inf, errors).max())

    def _perturbed(self) -> Floats:
        """Return starts (3, 4 D) near the one start."""
        D, d = self.starts.shape[1] // 4, self.asked.system.dimension
        rows = np.repeat(self.starts, PERTURBED, axis=0).reshape(PERTURBED, 4, D)
        change = (2 * quasi_random(PERTURBED, 2 * d, 0) - 1).reshape(PERTURBED, 2, d)
        rows[:, ::2, :d] += self.perturbation * change * self.orbits.extents[:, :d]
        return rows.reshape(PERTURBED, -1)

    def _measured(self, choice: Choice, summation: str) -> Choice:
        """Return ``choice`` with the errors of its run, of several starts their quantile."""
        run = self._runs(self.asked.methods[choice.method], [int(choice.steps)], self.starts, summation)
        return replace(
            choice,
            summation=summation,
            evaluations=int(run.evaluations.max()),
            error=_quantile(self._each(run)),
            max_energy_error=_quantile(run.max_energy_error),
            mean_energy_error=_quantile(run.mean_energy_error),
        )

    def _errors(self, tableau: Tableau, steps: Sequence[int]) -> list[float]:
        """Return errors of runs with these numbers of steps, the largest of the starts that are searched."""
        starts = _evenly(self.starts, SEARCHED)
        errors: list[float] = (
            self._each(self._runs(tableau, steps, starts)).reshape(len(steps), -1).max(axis=1).tolist()
        )
        return errors

    def _each(self, paths: Trajectories) -> Floats:
        """Return the error of each run in the requested measure, infinite where it failed."""
        if self.exact is None:
            found = getattr(paths, MEASURES[self.asked.measure])
        else:
            found = np.where(paths.left_at > 0, inf, self.exact.error(*paths.ends))
        return np.where(np.isnan(found), inf, found)

    def _runs(
        self, tableau: Tableau, steps: Sequence[int], starts: Floats, summation: str = "compensated", times: int = 1
    ) -> Trajectories:
        """Return runs from each of ``starts`` with each number of steps, over so many times the interval."""
        asked, samples = self.asked, least_samples(tableau)
        rows = np.tile(starts, (len(steps), 1))
        if summation == "plain":
            rows.reshape(len(rows), 4, -1)[:, 1::2] = 0.0
        count = np.repeat(np.array(steps), len(starts))
        size = max(1, KEPT // (samples * rows.shape[1]))
        parts = [
            integrate_batch(
                asked.system, tableau, t_end=times * Fraction(asked.t_end), steps=count[i : i + size], samples=samples,
                start=rows[i : i + size], scale=asked.scale, numerics=Numerics(summation=summation),
            )
            for i in range(0, len(rows), size)
        ]  # fmt: skip
        return parts[0] if len(parts) == 1 else joined(parts)


def _evenly(rows: Floats, most: int) -> Floats:
    """Return at most so many of ``rows``, in even distances."""
    chosen: Floats = rows[np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int)]
    return chosen


def _quantile(errors: Floats) -> float:
    """Return the quantile of the errors of several starts that is bounded, one of them."""
    return float(np.sort(errors)[int(np.ceil(QUANTILE * len(errors))) - 1])


def _loses_nothing(plain: Choice, careful: Choice) -> bool:
    errors = ("error", "max_energy_error", "mean_energy_error")
    return all(getattr(plain, name) <= LOSSLESS * getattr(careful, name) for name in errors)


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
    best = (
        min(settings, key=times.__getitem__) if settings else min(errors, key=lambda i: (isnan(errors[i]), errors[i]))
    )
    return replace(
        choice,
        status="met" if settings else "missed",
        error=errors[best],
        time=times[best] if settings else nan,
        **{name: curve[name].values[best].item() for name in SHARED},
    )
