"""The measuring engine: errors, costs and wall times of methods over step sizes, and costs read off their curves.

A Dataset of measurements has the dimensions (solver, point): the settings of each method or library from coarse to
fine, padded with NaN. :func:`curves_of` gives one Dataset a solver, which is what tables, figures and rankings are made
of.
"""

from __future__ import annotations

import json
import os
import time
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from math import ceil, exp, inf, isfinite, log, nan, sqrt
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from nearharmonic.engine.batch import integrate_batch, least_samples
from nearharmonic.engine.ensemble import ensemble
from nearharmonic.engine.numbers import standard_start
from nearharmonic.engine.reference import Reference
from nearharmonic.engine.settings import Numerics, misfit
from nearharmonic.engine.trajectory import Problem
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import QUARTILES, STANDARD, Patience, interleaved, summary
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Variables, coordinate, variable
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Variables with the error of each measure, and the measures in words.
MEASURES = {"max": "max_energy_error", "mean": "mean_energy_error", "position": "position_error"}
NAMES = {
    "max": "maximum of |H - H0|/|H0|",
    "mean": "mean of |H - H0|/|H0|",
    "position": "position error at the end, relative",
}
#: Errors at which tables list the cost.
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
#: Errors below these are rounding, which finer steps do not reduce: of energies, and of positions relative to the
#: distance, to which rounding of the phase is added.
ROUNDING, POSITION_ROUNDING = 1e-15, 1e-14
#: Largest ratio of errors, plain over compensated sums, at which plain sums are used.
LOSSLESS = 1.05
#: Largest rise of a curve by rounding beyond its smallest error; if it rises further, that error is accidental.
ROUNDING_RISE = 100
#: Numbers that one batch of runs keeps at most.
KEPT = 2**22
#: Timing of ensembles: calls take some milliseconds, and allocate new arrays.
ENSEMBLES = Patience(least=5, most=15, seconds=0.05, longest=0.1)
#: Repeats of the call for one step, which measures the overhead of Python.
SETUP = Patience(least=5, most=5, longest=inf)
#: Evaluations of the force by all members of an ensemble, some milliseconds, and for a regularised system, whose
#: members run one by one instead of in lanes.
ENSEMBLE_EVALUATIONS, ONE_BY_ONE_EVALUATIONS = 2**25, 2**21
#: Fewest and most members, which share the cost of a call outside the kernel.
FEWEST_MEMBERS, MOST_MEMBERS = 64, 2048

#: Numbers of a setting: unit and meaning.
COLUMNS = {
    "tau": ("{t}", "step size; NaN if the method chooses its own"),
    "tau_per_stage": ("{t}", "step size per stage"),
    "tolerance": ("1", "tolerance asked for; NaN if the step size is the setting"),
    "steps": ("1", "steps"),
    "evaluations": ("1", "evaluations of the force; NaN if unknown"),
    "compensated": ("1", "1 if the sums are compensated, 0 if plain; NaN for other libraries"),
    "members": ("1", "trajectories that a call in lanes integrates; NaN if none was timed"),
    "max_energy_error": ("1", "maximum of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "mean_energy_error": ("1", "mean of |H - H0|/|H0| over the steps; infinite if the run failed"),
    "position_error": ("1", "distance from the exact position at the end, over the larger of |q(0)| and |q(t)|"),
}
#: Modes of a timed call.
MODES = {
    "trajectory": "a whole call for one trajectory, without a look at the energy",
    "lanes": "each trajectory of a whole call for many, in SIMD lanes on one thread, without a look at the energy",
    "energy": "a whole call for one trajectory, the energy measured at every step",
}
#: Facts of a solver: unit, empty for words, and meaning.
FACTS = {
    "label": ("", "name in legends"),
    "kind": ("", "splitting: a method of this package; peer: another library's"),
    "status": ("", "ok, or why the curve is empty or ends early"),
    "version": ("", "version of the peer's library"),
    "setup": ("s", "a whole call of a prepared problem for one step"),
    "sweep": ("s", "one call for all step sizes in lanes, energies at every step"),
}


class Interval(NamedTuple):
    """A system over [0, ``t_end``], its exact position there if errors of positions are measured, and the energy that
    errors are relative to: 0 for |H0|."""

    system: System
    t_end: str
    exact: Reference | None = None
    scale: float = 0.0


@dataclass(kw_only=True)
class Solver:
    """Measurements of one method or library in progress: its settings from the cheapest to the most expensive.

    ``status``: "ok", or the reason for an empty curve. ``setup`` and ``sweep``: seconds, as :data:`FACTS` says.
    ``columns``: numbers (n,) by the names of :data:`COLUMNS`; a missing column is NaN. ``calls``: functions to be
    timed, and ``times``: seconds of each repeat, per trajectory, by (mode, index of the setting).
    """

    method: str
    label: str
    kind: Literal["splitting", "peer"]
    status: str = "ok"
    version: str = ""
    setup: float = nan
    sweep: float = nan
    columns: dict[str, Any] = field(default_factory=dict)
    calls: dict[tuple[str, int], Callable[[], object]] = field(default_factory=dict)
    times: dict[tuple[str, int], Sequence[float]] = field(default_factory=dict)

    @property
    def settings(self) -> int:
        """Number of settings."""
        return max(map(len, self.columns.values()), default=0)

    def prepare(self, problem: Interval, tableau: Tableau, mode: str) -> None:
        """Add the calls of a mode for all settings whose runs end."""
        columns = self.columns
        for i in np.flatnonzero(np.isfinite(columns["max_energy_error"])).tolist():
            steps, way = int(columns["steps"][i]), "compensated" if columns["compensated"][i] else "plain"
            self.calls[mode, i] = prepared_call(problem.system, tableau, problem.t_end, steps, way, mode)
            if mode == "lanes":
                members = columns.setdefault("members", np.full(self.settings, nan))
                members[i] = members_of(problem.system, tableau, steps)


def measure(
    problem: Interval, methods: Iterable[Tableau], taus: Sequence[float], modes: Collection[str] = ("trajectory",),
    careful: bool = False,
) -> xr.Dataset:  # fmt: skip
    """Return errors, evaluations and wall times of methods over step sizes, with dimensions (solver, point).

    ``taus`` are step sizes per stage, in the system's unit of time; ``modes`` are timed in interleaved order, none if
    it is empty. A method that does not fit the system has NaN, and the reason as ``status``. ``careful`` gives the
    errors of compensated sums where plain ones lose nothing, too.
    """
    solvers = [measured(problem, tableau, taus, modes=modes, careful=careful) for tableau in methods]
    clock(solvers, modes)
    return dataset_of(solvers, problem.system.units["t"])


def measured(
    problem: Interval,
    tableau: Tableau,
    taus: Iterable[float],
    summation: str = "compensated",
    evaluations: int = 2**62,
    modes: Collection[str] = ("trajectory", "energy"),
    careful: bool = False,
) -> Solver:
    """Return the errors of ``tableau`` at step sizes ``taus`` per stage, with calls to be timed.

    Each number of steps is run once; runs of more than ``evaluations`` of the force are left out. Plain sums are used
    at points where they do not increase the errors (:data:`LOSSLESS`), compensated sums at all others;
    ``summation="plain"`` makes all plain. The curve ends at the first point where every error is rounding. A method
    that does not fit the system has no point, and its status is the reason.
    """
    solver = Solver(method=tableau.name, label=tableau.label, kind="splitting")
    tau_of = {tableau.steps(tau, problem.t_end): tau for tau in taus}
    steps = [n for n in sorted(tau_of) if tableau.evaluations(n) <= evaluations]
    if reason := misfit(problem.system, tableau)[0]:
        solver.status = f"does not fit: {reason}"
    elif not steps:
        solver.status = "no step size: every run would take more evaluations than allowed"
    if solver.status != "ok":
        return solver
    begin = time.perf_counter()
    best = errors_of(problem, tableau, steps, summation)
    solver.sweep = time.perf_counter() - begin
    plain = best if summation == "plain" else errors_of(problem, tableau, steps, "plain")
    # A NaN is a position that was compared with nothing.
    lost = np.any([plain[name] > LOSSLESS * best[name] for name in MEASURES.values()], axis=0)
    columns = {name: np.where(lost | (careful & (name != "evaluations")), best[name], plain[name]) for name in best}
    columns |= {
        "tau": np.array([float(Fraction(problem.t_end) / n) for n in steps]),
        "tau_per_stage": np.array([tau_of[n] for n in steps]),
        "steps": np.array(steps),
        "compensated": lost * 1.0,
    }
    rounding = (columns["max_energy_error"] <= ROUNDING) & ~(columns["position_error"] > POSITION_ROUNDING)
    end = int(rounding.argmax()) + 1 if rounding.any() else len(steps)
    solver.columns = {name: values[:end] for name, values in columns.items()}
    for mode in modes:
        solver.prepare(problem, tableau, mode)
    if modes:
        solver.setup = min(interleaved([prepared_call(problem.system, tableau, problem.t_end, 1, "plain")], SETUP)[0])
    return solver


def errors_of(
    problem: Interval,
    tableau: Tableau,
    steps: Sequence[int],
    summation: str = "compensated",
    starts: Floats | None = None,
    times: int = 1,
) -> dict[str, Any]:
    """Return errors, by the variables of :data:`MEASURES`, and ``evaluations`` of runs over so many ``times`` the
    interval.

    Each number of ``steps`` is run from each of ``starts`` (M, 4 D), by default the system's own. Errors of runs that
    left are infinite, errors of positions NaN if no exact position is known.
    """
    numerics, samples = Numerics(summation=summation), least_samples(tableau)
    first = standard_start(problem.system, False)[None, :] if starts is None else starts
    rows, count = np.tile(first, (len(steps), 1)), np.repeat(np.array(steps), len(first))
    if summation == "plain":
        rows.reshape(len(rows), 4, -1)[:, 1::2] = 0.0
    size, parts = max(1, KEPT // (samples * rows.shape[1])), list[tuple[Any, ...]]()
    for some in (slice(i, i + size) for i in range(0, len(rows), size)):
        paths = integrate_batch(
            problem.system, tableau, t_end=times * Fraction(problem.t_end), steps=count[some], samples=samples,
            start=rows[some], scale=problem.scale, numerics=numerics,
        )  # fmt: skip
        worst, off = paths.max_energy_error, np.full(len(count[some]), nan)
        if problem.exact is not None:
            off = np.where(np.isfinite(worst), problem.exact.error(*paths.ends), inf)
        parts.append((worst, paths.mean_energy_error, off, paths.evaluations))
    return dict(zip((*MEASURES.values(), "evaluations"), map(np.concatenate, zip(*parts, strict=True)), strict=True))


def members_of(system: System, tableau: Tableau, steps: int) -> int:
    """Return the number of members of a timed ensemble."""
    most = ENSEMBLE_EVALUATIONS if system.regularisation is None else ONE_BY_ONE_EVALUATIONS
    return min(max(most // tableau.evaluations(steps), FEWEST_MEMBERS), MOST_MEMBERS)


def prepared_call(
    system: System, tableau: Tableau, t_end: str, steps: int, summation: str, mode: str = "trajectory"
) -> Callable[[], Any]:
    """Return a complete call of a prepared problem, to be timed, which returns the final q (d,) and p (d,).

    The interval [0, ``t_end``] is covered in ``steps`` equal steps. In the mode ``lanes`` it is a call of
    :func:`nearharmonic.ensemble` on one thread, for :func:`members_of` trajectories. They all begin at the start of the
    system, so that all have the same error, and so that no member of another library's adaptive batch waits for
    another. The call has run once.
    """
    tau = float(t_end) / steps
    if mode == "lanes":
        q0, p0 = (np.repeat([row], members_of(system, tableau, steps), axis=0) for row in system.start(float))

        def call() -> Any:
            states = ensemble(
                system, tableau, tau, q0=q0, p0=p0, t_end=t_end, energy="none", summation=summation, samples=1
            )
            return states.q.values, states.p.values

    else:
        energy = "every" if mode == "energy" else "none"
        problem = Problem(system, tableau, t_end=t_end, summation=summation, energy=energy)

        def call() -> Any:
            solution = problem(tau)
            return solution.q[-1], solution.p[-1]

    call()
    return call


def clock(solvers: Iterable[Solver], modes: Iterable[str]) -> None:
    """Time the calls of all solvers in interleaved order: their ``times`` get the seconds of each repeat."""
    waiting = [(solver, key, call) for solver in solvers for key, call in solver.calls.items()]
    # One mode at a time, because wide registers may reduce the clock rate for other code.
    for mode in modes:
        chosen = [(solver, i, call) for solver, (own, i), call in waiting if own == mode]
        with quiet():
            repeats = interleaved([call for _, _, call in chosen], ENSEMBLES if mode == "lanes" else STANDARD)
        for (solver, i, _), seconds in zip(chosen, repeats, strict=True):
            members = solver.columns["members"][i] if mode == "lanes" else 1
            solver.times[mode, i] = [each / members for each in seconds]


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress warnings: coarse settings overflow, which the errors show, and libraries have unrelated warnings."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def variables(solvers: Sequence[Solver], unit: str) -> Variables:
    """Return measurements as arrays over (solver, point), padded with NaN; times also over ``quartile``.

    ``unit`` is the unit of time of the system and of step sizes.
    """
    shape = len(solvers), max([solver.settings for solver in solvers] + [1])
    # Not a dimension "method": xarray's sel() takes that word for itself.
    table = coordinate("solver", [solver.method for solver in solvers], "solver")
    for name, (units, text) in FACTS.items():
        facts = [getattr(solver, name) for solver in solvers]
        table[name] = variable("solver", np.array(facts, dtype=float if units else str), text, units or "1")
    for name, (units, text) in COLUMNS.items():
        values = np.full(shape, nan)
        for row, solver in zip(values, solvers, strict=True):
            row[: solver.settings] = solver.columns.get(name, nan)
        table[name] = variable(("solver", "point"), values, text, units.format(t=unit))
    table |= coordinate("quartile", QUARTILES, "minimum and quartiles")
    for mode, text in MODES.items():
        times, repeats = np.full((*shape, len(QUARTILES)), nan), np.zeros(shape, np.int64)
        for i, solver in enumerate(solvers):
            for (own, j), seconds in solver.times.items():
                if own == mode:
                    times[i, j], repeats[i, j] = summary(seconds), len(seconds)
        table[f"time_{mode}"] = variable(("solver", "point", "quartile"), times, f"wall time of {text}", "s")
        table[f"repeats_{mode}"] = variable(("solver", "point"), repeats, f"repeats of {text}")
    return table


def dataset_of(solvers: Sequence[Solver], unit: str) -> xr.Dataset:
    """Return :func:`variables` as a Dataset."""
    import xarray as xr

    return xr.Dataset(variables(solvers, unit))


# --- Curves of measurements, and costs read off them ------------------------------------------------------------------

#: Curves of one interval of a system: (t_end, measures, curves).
Part = tuple[str, Sequence[str], Sequence["xr.Dataset"]]


def curves_of(group: xr.Dataset, quartile: str = "min") -> list[xr.Dataset]:
    """Return a Dataset over ``point`` for each solver, without padding, with one of the :data:`QUARTILES` of times."""
    rows = group.sel(quartile=quartile)
    settings = (rows["tau"].notnull() | rows["tolerance"].notnull()).values
    return [rows.isel(solver=i, point=np.flatnonzero(kept)) for i, kept in enumerate(settings)]


def read_parts(path: str | os.PathLike[str], system: str, quartile: str = "min") -> tuple[list[Part], dict[str, Any]]:
    """Return every interval of a system in a cube, and the cube's attributes.

    Raises ResultFileError: as :func:`nearharmonic.output.store.read` does.
    """
    from nearharmonic.output import store

    attributes = store.attributes_of(path)
    with store.as_written(path):
        parts: list[Part] = [
            (told["t_end"], tuple(told["measures"]), curves_of(store.read(path, name), quartile))
            for name, told in json.loads(attributes["problems"]).items()
            if told["system"] == system
        ]
    return parts, attributes


class Crossing(NamedTuple):
    """Point where a curve reaches an error.

    ``status``: "reached"; "below throughout" (the coarsest setting meets the error, and its cost is an upper bound); or
    "not reached", with NaN for cost and setting.
    """

    status: str
    time: float = nan
    evaluations: float = nan
    tau: float = nan
    tolerance: float = nan


def cross(errors: Sequence[float], columns: Sequence[Sequence[float]], target: float) -> tuple[str, tuple[float, ...]]:
    """Return the status, and each of ``columns`` where ``errors``, from coarse to fine, falls to ``target`` for good.

    :func:`for_good` says what that is, so that neither a zero of a signed error nor a gap between step-size resonances
    counts. Between the last point above and the first at or below, logarithms of error and column are interpolated
    linearly, unless the point above is not finite. If a finer point costs less, in the first of ``columns``, that point
    is taken: adaptive methods may be more expensive at a coarser tolerance.
    """
    i = next((i for i, error in enumerate(for_good(errors)) if error <= target), None)
    if i is None:
        return "not reached", (nan,) * len(columns)
    points = [tuple(float(column[j]) for column in columns) for j in range(i, len(errors)) if errors[j] <= target]
    above, below = (errors[i - 1], errors[i]) if i else (inf, errors[0])
    if isfinite(above) and below > 0:
        w = (log(above) - log(target)) / (log(above) - log(below))
        pairs = [(float(column[i - 1]), float(column[i])) for column in columns]
        points.insert(0, tuple(exp((1 - w) * log(a) + w * log(b)) if a > 0 and b > 0 else b for a, b in pairs))
    return "reached" if i else "below throughout", min(points, key=lambda row: row[0])


def for_good(errors: Sequence[float]) -> list[float]:
    """Return for each of ``errors``, from coarse to fine, the largest error from there to the smallest of all.

    NaN counts as infinite. Errors after the smallest are dropped: there curves rise again by rounding. An error that
    finer settings exceed by more than :data:`ROUNDING_RISE` is accidental, and not taken as the smallest.
    """
    usable = np.where(np.isnan(errors), inf, errors)
    worst = np.maximum.accumulate(usable[::-1])[::-1]
    borne_out = np.flatnonzero(np.append(worst[1:], 0.0) <= ROUNDING_RISE * usable)  # the last one always is
    end = borne_out[usable[borne_out].argmin()] if usable.size else 0
    return [float(error) for error in np.maximum.accumulate(usable[end::-1])[::-1]]


def crossing(curve: xr.Dataset, measure: str, target: float, mode: str = "trajectory") -> Crossing:
    """Find where a curve reaches ``target`` in ``measure`` (key of :data:`MEASURES`), by its times in ``mode``."""
    times = curve[f"time_{mode}"].values
    used = np.isfinite(times) | ~np.isfinite(curve["max_energy_error"].values)
    columns = [times[used], *(curve[name].values[used] for name in ("evaluations", "tau", "tolerance"))]
    status, values = cross(curve[MEASURES[measure]].values[used].tolist(), columns, target)
    return Crossing(status, *values)


def ranking(
    curves: Iterable[xr.Dataset], measure: str, target: float, mode: str = "trajectory"
) -> list[tuple[xr.Dataset, Crossing]]:
    """Return ``curves`` with their crossings, the fastest first, and last the curves that do not reach ``target``."""
    pairs = ((curve, crossing(curve, measure, target, mode)) for curve in curves)
    return sorted(pairs, key=lambda pair: pair[1].time if isfinite(pair[1].time) else inf)


def fastest(
    curves: Iterable[xr.Dataset], measure: str, target: float, mode: str = "trajectory"
) -> list[tuple[xr.Dataset, Crossing]]:
    """Return the curves that reach ``target`` with their crossings, the fastest first."""
    return [(curve, at) for curve, at in ranking(curves, measure, target, mode) if isfinite(at.time)]


def of_kind(curves: Iterable[xr.Dataset], kind: str) -> list[xr.Dataset]:
    """Return the curves of one kind: "splitting", methods of this package, or "peer", other libraries."""
    return [curve for curve in curves if curve["kind"].item() == kind]


# --- Searches for the fewest steps that meet an error bound, by functions from numbers of steps to errors -------------

#: Ratio of the finest two step sizes that may be run: 1 + 1/FINE.
FINE = 24
#: Every SCOUT-th rung is run for any error bound, so that step-size resonances below the recommended step are seen.
SCOUT = 8
#: All rungs are run from the last step size that misses the bound to the recommended one divided by MARGIN.
MARGIN = 2
#: Relative distance of the recommended step from one that misses the bound: closer steps are not run.
CLOSE = 1 / 200
#: Runs side by side in one call: the lanes of the kernel.
LANES = 8
#: Inverse of the relative distance from the fewest steps at which doubling and halving end.
HALVED = 20


def ladder(most: int) -> list[int]:
    """Return numbers of steps from 1 to ``most``, the denser the cheaper their runs are.

    The ratio of neighbours n' and n is 1 + (n / ``most``)^(1/2) / ``FINE``, rounded to an integer n' > n: the narrow
    step-size resonances lie at few steps, where every number of steps is a rung.
    """
    rungs, steps = [], 1
    while steps <= most:
        rungs.append(steps)
        steps += max(1, int(steps * sqrt(steps / most) / FINE))
    return rungs


def fewest_steps(meets: Callable[[int], bool], least: int, most: int) -> int | None:
    """Return the fewest steps from ``least`` to ``most`` that meet a bound, by doubling and halving, or None.

    The result is within 1/:data:`HALVED` of the fewest where all larger numbers of steps meet the bound too.
    """
    missed, steps = least - 1, least
    while steps > most or not meets(steps):
        if steps >= most:
            return None
        missed, steps = steps, min(2 * steps, most)
    while steps - missed > max(1, steps // HALVED):
        middle = (missed + steps) // 2
        missed, steps = (missed, middle) if meets(middle) else (middle, steps)
    return steps


def fewest_for_good(errors: Mapping[int, float], bound: float) -> int | None:
    """Return the fewest steps in ``errors`` from which on all errors meet ``bound``.

    NaN meets no bound; None if the largest number of steps misses it.
    """
    missed = max((steps for steps, error in errors.items() if not error <= bound), default=-inf)
    return min((steps for steps in errors if steps > missed), default=None)


def measured_errors(
    run: Callable[[Sequence[int]], Sequence[float]], rungs: Sequence[int], bound: float, floor: float
) -> dict[int, float]:
    """Run the rungs that decide which is the fewest number of steps that meets ``bound``.

    The scouts come first, every ``SCOUT``-th rung from coarse to fine, and the finest. They end where all errors of one
    call are down to ``floor``, the error of rounding: finer steps would show rounding only. Then all rungs around
    :func:`fewest_for_good` and its finer neighbours are run, and numbers of steps between it and the last that misses
    the bound, until none is left out. ``run`` takes numbers of steps and returns the errors of their runs; ``rungs``
    are increasing. The result is the error by number of steps, of all runs made.
    """
    errors: dict[int, float] = {}
    scouts = sorted({*rungs[::SCOUT], rungs[-1]})
    for i in range(0, len(scouts), LANES):
        call = dict(zip(scouts[i : i + LANES], run(scouts[i : i + LANES]), strict=True))
        errors |= call
        if max(call.values()) <= min(floor, bound):
            break
    while due := _due(errors, rungs, bound):
        errors |= dict(zip(due, run(due), strict=True))
    return errors


def _due(errors: Mapping[int, float], rungs: Sequence[int], bound: float) -> list[int]:
    """Return the numbers of steps to be run next, none at the end.

    They are the rungs from the last number of steps that misses ``bound`` to ``MARGIN`` times the fewest that meets it,
    and the next numbers of steps, at least ``LANES`` and more where runs are cheap; and after these up to ``LANES``
    numbers between the two, until they differ by less than ``CLOSE``.
    """
    fewest = fewest_for_good(errors, bound)
    if fewest is None:
        return []
    missed = max((steps for steps in errors if steps < fewest), default=rungs[0] - 1)
    wanted = {steps for steps in rungs if missed < steps <= MARGIN * fewest}
    following = min(LANES // 2 * max(2, rungs[-1] // fewest), MARGIN * fewest, rungs[-1] - fewest)
    wanted.update(range(fewest + 1, fewest + following + 1))
    gap, due = fewest - missed, sorted(wanted - errors.keys())
    if due or gap <= CLOSE * fewest:
        return due
    stride = ceil(gap / (LANES + 1))
    return list(range(missed + stride, fewest, stride))
