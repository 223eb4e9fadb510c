"""Trajectories as described variables and Datasets: names, units, observables, invariants; states at chosen times."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import reduce
from math import hypot as length_of
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import Trajectories, energy_unit, single_steps
from nearharmonic.engine.numbers import exact, list_of
from nearharmonic.engine.settings import MOST_SAMPLES
from nearharmonic.engine.setup import Setup, Start, end_digest, invariant_values, moves_digest, observable_values
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.math import hypot
from nearharmonic.numerics.portable import Bools, Floats, Integers
from nearharmonic.output.store import Variable, Variables, assembled, described, flags
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


# --- Trajectories as described variables and Datasets: names, units, observables and invariants.

#: Extent of a block of steps.
SINCE = "since the previous sample"
#: Words for the end of a run. A plan skips runs; no integration returns that word.
STATUSES = ("ok", "diverged", "skipped")
STATUS = "ok; diverged: the run left its energy surface; skipped: the plan left the run out (tables/skipped.csv)"
#: One more for runs of implicit methods, and what it means.
UNSOLVED, NOT_SOLVED = "not_converged", "not_converged: the iteration of an implicit step did not converge"


def error_variables(paths: Trajectories, problem: Setup) -> Variables:
    """Return errors, steps, evaluations and status of runs over tau_per_stage."""
    scale, unit = energy_scale(paths, problem)
    over = {"every": "over every step, inf if diverged", "samples": "over the samples, inf if diverged"}
    what = f"|H - H0|{scale} {over.get(problem.numerics.energy, 'was not asked for')}"
    made = paths.steps if problem.system.regularisation is None else paths.done
    return over_runs({
        "max_energy_error": (paths.max_energy_error, f"maximum of {what}", unit),
        "mean_energy_error": (paths.mean_energy_error, f"mean of {what}", unit),
        "steps": (made, "steps that cover [0, t_end]", "1"),
        "evaluations": (paths.evaluations, "force evaluations made", "1"),
    }) | {
        "status": status_variable("tau_per_stage", problem, paths.left_at, paths.unsolved),
    } | over_runs({
        "diverged_at": (paths.left_at, "step at which the run left its energy surface, 0 if it did not", "1"),
    })  # fmt: skip


def status_variable(dimension: str, problem: Setup, left_at: Integers, unsolved: Bools) -> Variable:
    """Return how runs ended, from the steps at which they left, or 0, and where an implicit step was not solved."""
    words, meaning = list(STATUSES), STATUS
    if problem.tableau.implicit:
        words, meaning = [*words, UNSOLVED], f"{meaning}; {NOT_SOLVED}"
    ended = np.where(unsolved, words[-1], np.where(left_at > 0, words[1], words[0]))
    return flags(dimension, ended, words, meaning)


def energy_scale(paths: Trajectories, problem: Setup) -> tuple[str, str]:
    """Return the divisor of energy errors as text, as in "|H - H0|/|H0|", and their unit.

    The text of a system that depends on time says that its H includes p_t, the momentum conjugate to time.
    """
    H = ", H = T + V + p_t," if problem.system.time_dependent else ""
    if problem.scale != 0:
        return f"/({problem.scale:g} {problem.system.units['energy']}){H}", "1"
    unit, none = problem.system.units["energy"], paths.energy == 0
    if none.all():
        return H, unit
    return f"/|H0|{f' (absolute, in {unit}, where H0 = 0)' if none.any() else ''}{H}", "1"


def trajectory_variables(
    problem: Setup, paths: Trajectories, constants: Sequence[Any], times: Floats | None = None
) -> Variables:
    """Return states at the samples, their energy errors, and the system's observables.

    ``constants`` are the parameters of the system, floats or arrays (R, 1), and ``times`` (S,) or (R, S) the times of
    samples that are not at whole steps.
    """
    system, d = problem.system, problem.system.dimension
    units = system.units
    if times is None:
        # The sum makes 0 of the -0 with which a run backwards begins.
        times = np.where(paths.marks >= 0, paths.marks * float(problem.end) / paths.steps[:, None] + 0.0, np.nan)
    scale, unit = energy_scale(paths, problem)
    table = {
        "t": (np.broadcast_to(times, paths.marks.shape), "time", units["t"]),
        "q": (paths.q[..., :d], "position", units["q"]),
        "p": (paths.p[..., :d], "momentum", units["p"]),
        "energy_error": (paths.energy_error, f"(H - H0){scale}".rstrip(","), unit),
    }
    if problem.numerics.precision == "extended":
        table |= low_digits(problem, paths)
    for name, values in observable_values(system, paths.q[..., :d], paths.p[..., :d], constants).items():
        table[name] = values, system.observables[name].meaning, system.observables[name].unit
    return over_runs(table)


def low_digits(problem: Setup, paths: Trajectories) -> dict[str, tuple[Any, str, str]]:
    """Return the digits below q and p: the low halves of double-doubles, or the carries of compensated sums."""
    units, d = problem.system.units, problem.system.dimension
    return {
        "q_low": (paths.q_low[..., :d], "position, digits below q", units["q"]),
        "p_low": (paths.p_low[..., :d], "momentum, digits below p", units["p"]),
    }


def invariant_variables(problem: Setup, paths: Trajectories, begin: Start) -> Variables:
    """Return the invariants at the samples of runs from their starts, and their drifts."""
    system, d, count = problem.system, problem.system.dimension, len(paths.q)
    state = np.broadcast_to(begin.state, (count, begin.state.shape[1])).reshape(count, 4, -1)[..., :d]
    q, p = paths.q[..., :d], paths.p[..., :d]
    if (kept := np.flatnonzero(paths.left_at == 0)).size:  # a run on its energy surface
        own = [float(np.broadcast_to(x, (count, 1))[kept[0], 0]) for x in begin.constants]
        warn_of_changing(system, q[kept[0]], p[kept[0]], own)
    return drift_variables(system, q, p, paths.left_at > 0, begin.constants, start=(state[:, 0], state[:, 2]))


def run_variables(
    problem: Setup, paths: Trajectories, begin: Start, times: Floats | None, steps: int | Integers
) -> Variables:
    """Return all variables of runs from ``begin``; ``times`` are as for :func:`trajectory_variables`."""
    unit = problem.system.units["energy"]
    variables = trajectory_variables(problem, paths, begin.constants, times) | error_variables(paths, problem)
    if problem.numerics.compensated:
        variables |= over_runs(low_digits(problem, paths))
    if problem.system.time_dependent:
        t, d, time = problem.system.units["t"], problem.system.dimension, "time as it is integrated"
        momentum = "momentum conjugate to time: minus the energy received"
        variables |= over_runs({
            "clock": (paths.q[..., d], time, t),
            "clock_low": (paths.q_low[..., d], f"{time}, digits below", t),
            "clock_momentum": (paths.p[..., d], momentum, unit),
            "clock_momentum_low": (paths.p_low[..., d], f"{momentum}, digits below", unit),
        })  # fmt: skip
    variables |= invariant_variables(problem, paths, begin)
    variables["tau"] = step_used(problem, steps)
    return variables | over_runs({
        "initial_energy": (paths.energy, "energy H0 at the start", unit),
        "initial_energy_low": (paths.energy_low, "energy H0 at the start, digits below initial_energy", unit),
    })  # fmt: skip


def trajectory_dataset(
    problem: Setup, paths: Trajectories, *, begin: Start, asked: float, times: Floats | None = None
) -> xr.Dataset:
    """Return the first of ``paths``, from ``begin`` with the step ``asked``, as :func:`nearharmonic.integrate` does."""
    kept = int(np.isfinite(paths.q[0, :, 0]).sum())  # up to the last sample that it reached
    one = {
        name: (dimensions[1:], values[0, :kept] if "sample" in dimensions else values[0], attributes)
        for name, (dimensions, values, attributes) in run_variables(problem, paths, begin, times, paths.steps).items()
    }
    notes = run_attributes(problem, begin, asked) | problem.floor(begin.state, begin.parameters, paths.energy[:1])
    ends = times is None or np.ravel(times)[-1] == float(problem.end) + begin.t  # the last sample is the end of the run
    if ends and paths.running.size:
        units = problem.system.units
        what = "state of the last force: position, momentum, the digits below each, and what the next position adds"
        one["running"] = ("running_component",), paths.running[0], described(what, f"{units['q']}, {units['p']}")
        notes["moves"] = moves_digest(problem, int(paths.steps[0]))
        notes["end"] = end_digest(one, notes.get("parameters", ""))
    return assembled(one, ["t"], notes)


def parameter_variables(problem: Setup, parameters: Floats) -> Variables:
    """Return parameters (M, 2 P) that differ between members, and the digits below them."""
    if len(parameters) == 1:
        return {}
    low = described("digits below the parameters, in the order of the system", "unknown")
    return {
        f"parameter_{name}": (("member",), column, described(parameter.meaning, parameter.unit))
        for (name, parameter), column in zip(problem.system.parameters.items(), parameters.T[::2], strict=True)
    } | {"parameters_low": (("member", "parameter"), parameters[:, 1::2], low)}


def step_used(problem: Setup, steps: int | Integers) -> Variable:
    """Return the step size of so many steps, or the step sizes of runs over tau_per_stage."""
    notes = described("step size as used, t_end / steps", problem.system.units["t"])
    taus = problem.taus(np.atleast_1d(steps))
    return (("tau_per_stage",), taus, notes) if np.ndim(steps) else ((), taus[0], notes)


def run_attributes(problem: Setup, begin: Start, asked_tau: float) -> dict[str, Any]:
    """Return the attributes of a Dataset of runs with one step size that was asked for."""
    return problem_attributes(problem) | begin.attributes() | {"tau_requested": asked_tau}


def problem_attributes(problem: Setup) -> dict[str, Any]:
    """Return the attributes of a Dataset: system, method and settings."""
    tableau = problem.tableau
    told = tableau.name in integrators and integrators.entry(tableau.name).label == tableau.label  # users' may not be
    notes = {
        "system": problem.system.name,
        "integrator": tableau.name,
        **({} if told else {"label": tableau.label}),
        **({} if problem.tableau.implicit else {"first": problem.tableau.first}),
        "t_end": problem.t_end,
        "precision": problem.numerics.precision,
        "summation": problem.numerics.summation,
    }
    if problem.tableau.modified:
        notes["gradients_per_step"] = str(problem.tableau.gradients)
    if problem.tableau.processed:
        notes["processed"] = "states and energies are processed at the samples; evaluations count the kernel alone"
    if problem.numerics.energy != "every":
        notes["energy"] = problem.numerics.energy
    if problem.numerics.exact_oscillator:
        notes["split"] = problem.numerics.split
    return notes


def kernel_in_words(problem: Setup) -> str:
    """Return the arithmetic of a run in words, as an attribute of its file."""
    numerics = problem.numerics
    return ", ".join((
        "double-double" if numerics.precision == "extended" else "double",
        f"{'compensated' if numerics.compensated else 'plain'} sums",
        "implicit" if problem.tableau.implicit else f"{problem.tableau.first} first",
        *(["oscillator solved exactly"] if numerics.exact_oscillator else []),
        {"every": "energy at every step", "samples": "energy at the samples", "none": "no energy"}[numerics.energy],
    ))  # fmt: skip


def over(dimension: str, variables: Variables) -> Variables:
    """Return variables of runs over another first dimension."""
    return {name: ((dimension, *rest[1:]), values, notes) for name, (rest, values, notes) in variables.items()}


def without_members(variables: Variables) -> Variables:
    """Return the variables of a single member without their dimension ``member``."""
    return {
        name: (dimensions[1:], values[0], notes) if dimensions[:1] == ("member",) else (dimensions, values, notes)
        for name, (dimensions, values, notes) in variables.items()
    }


def over_runs(table: dict[str, tuple[Any, str, str]]) -> Variables:
    """Return described variables over runs, from (values, meaning, unit)."""
    dimensions = ("tau_per_stage", "sample", "component")
    return {name: (dimensions[: v.ndim], v, described(text, unit)) for name, (v, text, unit) in table.items()}


def sampled(problem: Setup, steps: Sequence[int], samples: int) -> Variables:
    """Integrate one run for each of ``steps``, with at most so many samples.

    Variables are t, q, p, energy_error and the system's observables over (tau_per_stage, sample, component); the
    maximum, the mean and the number of the steps since the previous sample over (tau_per_stage, sample); tau, steps,
    evaluations, status and diverged_at over tau_per_stage, which has no coordinate. Runs with fewer samples than the
    longest are padded: NaN, and 0 steps.
    """
    paths = problem.run(steps, samples)
    path = trajectory_variables(problem, paths, problem.system.constants(float))
    length = np.where(paths.marks >= 0, np.diff(paths.marks, axis=1, prepend=0), 0)
    scale, unit = energy_scale(paths, problem)
    # Variables are in the order of the files.
    leading = {name: path.pop(name) for name in ("t", "q", "p", "energy_error")}
    blocks = over_runs({
        "block_steps": (length, f"steps {SINCE}", "1"),
        "block_max_energy_error": (paths.block_max, f"maximum of |H - H0|{scale} {SINCE}", unit),
        "block_mean_energy_error": (paths.block_mean, f"mean of |H - H0|{scale} {SINCE}", unit),
    })  # fmt: skip
    counts = error_variables(paths, problem)
    del counts["max_energy_error"], counts["mean_energy_error"]  # reductions of the blocks
    return {**leading, **blocks, **path, **counts, "tau": step_used(problem, paths.steps)}


# --- Drifts of the invariants that a system declares beside its energy, and a check.
#
# Drifts do not tell a wrong invariant from a coarse step, as a method conserves most invariants only to its order. The
# bracket {I, H} = dI/dq dH/dp - dI/dp dH/dq of an invariant vanishes at every state, on an approximate orbit as well.

#: States of a run at which brackets are evaluated, and largest number of coordinates for which they are.
STATES, MOST_COORDINATES = 3, 64
#: Two steps of the central differences, over the norms of q and of p. Where both give the same bracket, their errors,
#: a hundred times as large for the first, are negligible.
STEPS = (1e-5, 1e-6)
#: Largest |{I, H}| of an invariant, over |grad I| |grad H|; differences have errors near 1e-9.
TOLERANCE = 1e-4
#: Largest relative difference of the two brackets.
AGREEMENT = 0.1


class InvariantWarning(UserWarning):
    """A declared invariant is not conserved."""


def drift_variables(
    system: System,
    q: Floats,
    p: Floats,
    diverged: Any,
    constants: Sequence[Any] | None = None,
    *,
    start: tuple[Floats, Floats] | None = None,
) -> Variables:
    """Return the invariants of ``system`` at the samples ``q``, ``p`` (R, S, d) of R runs, and their drifts,
    ``<name>_drift``.

    Values are over (tau_per_stage, sample), with a dimension more, ``<name>_component``, for a vector. A drift is the
    maximum over the samples of |I - I0| / |I0|, Euclidean for a vector, or of |I - I0| where I0 = 0; infinite where the
    run ``diverged`` (R,). The ``long_name`` says which. I0 is the value at the first sample, or at ``start``, a pair
    of arrays (R, d).
    """
    found: Variables = {}
    q0, p0 = (q[:, 0], p[:, 0]) if start is None else start
    at_start = invariant_values(system, q0[:, None], p0[:, None], constants)
    for name, values in invariant_values(system, q, p, constants).items():
        function = system.invariants[name]
        unit, meaning = getattr(function, "unit", "unknown"), getattr(function, "meaning", "conserved quantity")
        several = [f"{name}_component"] if values.shape[-1] > 1 else []
        found[name] = (
            ("tau_per_stage", "sample", *several), values if several else values[..., 0], described(meaning, unit)
        )  # fmt: skip
        first = _length(at_start[name])
        relative = bool((first > 0).all())
        with np.errstate(all="ignore"):  # a state may be too large for an invariant
            change = _length(values - at_start[name]) / (first if relative else 1.0)
        # fmax passes over NaN, the samples that a run does not have.
        drift = np.where(diverged, np.inf, np.fmax.reduce(change, axis=1, initial=np.nan))
        measure = "|I - I0|/|I0|" if relative else "|I - I0|"
        what = f"maximum over the samples of {measure}, I = {name} in double precision, inf if diverged"
        found[f"{name}_drift"] = ("tau_per_stage",), drift, described(what, "1" if relative else unit)
    return found


def _length(vectors: Floats) -> Floats:
    """The Euclidean norms (...) of vectors (..., n), from the first component on."""
    return reduce(hypot, np.moveaxis(vectors, -1, 0), np.zeros(vectors.shape[:-1]))


@remembered
def _checked(system: System) -> set[str]:
    """Return the invariants of a system that are checked; the caller adds to them."""
    return set()


def warn_of_changing(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> None:
    """Warn of each invariant that the exact solutions through the states (S, d) of a run do not conserve, once for a
    system.

    States that are not finite are left out.
    """
    finite = np.flatnonzero(np.isfinite(q).all(axis=1) & np.isfinite(p).all(axis=1))
    if q.shape[1] > MOST_COORDINATES or not finite.size or not system.invariants.keys() - _checked(system):
        return
    _checked(system).update(system.invariants)
    rows = dict.fromkeys(finite[np.linspace(0, len(finite) - 1, STATES).round().astype(int)].tolist())
    rates = [_rates(system, q[row], p[row], constants) for row in rows]
    for name in system.invariants:
        if (rate := max(one[name] for one in rates)) > TOLERANCE:
            message = (
                f"{system.name}: the invariant {name} is not conserved: at a state of the run its rate of change is "
                f"{rate:.2g} of |grad {name}| |grad H|"
            )
            warnings.warn(message, InvariantWarning, stacklevel=2)


def _rates(system: System, q: Floats, p: Floats, constants: Sequence[float]) -> dict[str, float]:
    """Return |{I, H}| over |grad I| |grad H| of each invariant at a state, 0 where the differences are not exact."""
    try:
        with np.errstate(all="ignore"):
            coarse, fine = (_rates_by(step, system, q, p, constants) for step in STEPS)
    except (ArithmeticError, ValueError):  # beside a state, H or an invariant may have no value
        return dict.fromkeys(system.invariants, 0.0)
    return {name: rate if abs(rate - coarse[name]) <= AGREEMENT * rate else 0.0 for name, rate in fine.items()}


def _rates_by(step: float, system: System, q: Floats, p: Floats, constants: Sequence[float]) -> dict[str, float]:
    """Return the rates by central differences, in units of the norms of q and of p; the largest of the components."""
    d, energies, values = len(q), list[Floats](), list[dict[str, Floats]]()
    for signed in (step, -step):
        x, y = np.tile(q, (2 * d, 1)), np.tile(p, (2 * d, 1))
        x[:d] += signed * (float(np.linalg.norm(q)) or 1.0) * np.eye(d)
        y[d:] += signed * (float(np.linalg.norm(p)) or 1.0) * np.eye(d)
        states = zip(map(tuple, x.tolist()), map(tuple, y.tolist()), strict=True)
        energies.append(np.array([float(system.energy(*state, constants, 0.0)) for state in states]))
        values.append(invariant_values(system, x, y, constants))
    force, velocity = np.split((energies[0] - energies[1]) / (2 * step), 2)
    rates = {}
    for name in values[0]:
        of_q, of_p = np.split(slopes := (values[0][name] - values[1][name]) / (2 * step), 2)
        sizes = np.linalg.norm(slopes, axis=0) * length_of(np.linalg.norm(force), np.linalg.norm(velocity))
        rates[name] = float(np.max(abs(velocity @ of_q - force @ of_p) / np.where(sizes > 0, sizes, 1.0)))
    return rates


# --- States at times that the caller chooses: those between two steps by one shorter step from the step before.
def checked_times(t: object, problem: Setup) -> list[Fraction]:
    """Return output times exactly, sorted from 0 towards the end of the interval, which may be negative.

    Floats mean their binary value, and one within a rounding of the end, in its own precision, is the end.
    """
    given, end = list_of("t", t, "a list of output times", MOST_SAMPLES), problem.end
    if not 1 <= len(given) <= MOST_SAMPLES:
        raise bad_setting("t", f"{len(given)} times", f"from 1 to {MOST_SAMPLES} output times")
    times = [exact(f"t[{i}]", value) for i, value in enumerate(given)]
    for i, value in enumerate(given):  # text and fractions have no rounding
        rounding = np.finfo(value.dtype if isinstance(value, np.floating) else float).eps
        if isinstance(value, float | np.floating) and abs(float(times[i] - end)) <= rounding * abs(float(end)):
            times[i] = end
    sign, before = (1 if end > 0 else -1), Fraction(0)
    for i, time in enumerate(times):
        if not 0 <= sign * time <= sign * end:
            narrow = isinstance(given[i], np.floating) and given[i].dtype.itemsize < 8
            what = f"; {given[i].dtype} has {np.finfo(given[i].dtype).precision} digits" if narrow else ""
            raise bad_setting(f"t[{i}]", given[i], f"a time from 0 to t_end = {problem.t_end}{what}")
        if sign * time < sign * before:
            raise bad_setting(f"t[{i}]", given[i], "a time not earlier than the time before it")
        before = time
    return times


def run_at(problem: Setup, steps: Sequence[int], times: Sequence[Fraction], **given: Any) -> Trajectories:
    """Integrate R runs and return their states at K times; blocks between samples are not measured.

    ``times`` come from :func:`checked_times`; ``parameters`` and further arguments ``given`` are as for
    :func:`nearharmonic.engine.batch.integrate_batch`.
    """
    count = np.asarray(steps, np.int64)
    # Members of an ensemble take equal steps: exact arithmetic, which is slow, is done once for all of them.
    different, which = np.unique(count, return_inverse=True)
    exact_before = [[int(time * n / problem.end) for time in times] for n in different.tolist()]
    rests = [[time - problem.end * k / n for k, time in zip(row, times, strict=True)]
             for row, n in zip(exact_before, different.tolist(), strict=True)]  # fmt: skip
    lengths = {rest: i for i, rest in enumerate(dict.fromkeys(rest for row in rests for rest in row if rest))}
    shorter = np.array([[lengths.get(rest, -1) for rest in row] for row in rests])[which]
    before = np.array(exact_before, np.int64)[which]
    marks, where = (rows[which] for rows in _marks(np.array(exact_before, np.int64), different))
    paths = problem.run(steps, 2, marks=marks, **given)
    rows = np.arange(len(count))[:, None]
    columns = {name: getattr(paths, name)[rows, where] for name in ("q", "q_low", "p", "p_low", "energy_error")}
    if lengths:
        _step_on(problem, paths, columns, shorter, list(lengths), given["parameters"])
    unknown = np.full(before.shape, np.nan)
    found = replace(paths, marks=before, block_max=unknown, block_mean=unknown, **columns)
    if problem.numerics.energy != "samples":
        return found
    sizes = np.abs(found.energy_error)  # errors are over the output times in place of the steps before them
    largest, mean = np.fmax.reduce(sizes, axis=1), sizes.mean(axis=1)
    largest[paths.left_at > 0] = mean[paths.left_at > 0] = np.inf
    return replace(found, max_energy_error=largest, mean_energy_error=mean)


def _marks(before: Integers, count: Integers) -> tuple[Integers, Integers]:
    """Steps at which a run has to be sampled, padded with -1, and where among them each of ``before`` is."""
    rows = [np.unique([0, *row, n]) for row, n in zip(before.tolist(), count.tolist(), strict=True)]
    marks = np.full((len(rows), max(map(len, rows))), -1, np.int64)
    for line, row in zip(marks, rows, strict=True):
        line[: len(row)] = row
    return marks, np.stack([np.searchsorted(row, wanted) for row, wanted in zip(rows, before, strict=True)])


def _step_on(
    problem: Setup, paths: Trajectories, columns: dict[str, Floats], shorter: Integers, lengths: Sequence[Fraction],
    parameters: Floats,
) -> None:  # fmt: skip
    """Replace each state of the step before by the state one shorter step later.

    ``shorter`` (R, K) is the index of this step's length in ``lengths``, -1 where a state is at the end of a step.
    """
    members, samples = np.nonzero(shorter >= 0)
    first = [columns[name][members, samples] for name in ("q", "q_low", "p", "p_low")]
    batch = problem.batch(
        problem.moves(lengths), single_steps(members.size), shorter[members, samples], np.concatenate(first, axis=1),
        parameters if len(parameters) == 1 else parameters[members],
    )  # fmt: skip
    batch.run()
    found = batch.filled
    d = first[0].shape[1]
    for i, name in enumerate(("q", "q_low", "p", "p_low")):
        columns[name][members, samples] = found.states[:, 1, i * d : (i + 1) * d]
    gained = (found.energy[:, 0] - paths.energy[members]) + (found.energy[:, 1] - paths.energy_low[members])
    unit = energy_unit(paths.energy[members], problem.scale)
    columns["energy_error"][members, samples] = (gained + found.energy_error[:, 1]) / unit
