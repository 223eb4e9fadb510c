"""Runs of the comparison, of long times and of the ideas behind trained methods, and gains at equal time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.engine.batch import Trajectories, integrate_batch, prepared_batch
from nearharmonic.engine.numbers import moves_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.clock import Patience, interleaved, pinned, processor
from nearharmonic.numerics.portable import Floats, geometric, log10
from nearharmonic.output.store import Contents, Variables, coordinate, method_coordinates, read, variable
from nearharmonic.output.table import Table
from nearharmonic.training.objective import LANES, LEAST, Ensemble, errors_of
from nearharmonic_paper.tasks.provenance import measures_time
from nearharmonic_studies.trained import problems
from nearharmonic_studies.trained.settings import (
    CHARGE,
    CHARGE_OF_ORBITS,
    ECCENTRICITIES,
    ORBITS,
    ProofSettings,
    idea_of,
    kind_of,
)

# --- Energy errors of all methods on each problem of the test ensembles, at equal cost.

#: Auxiliary coordinates.
COORDINATES = ("label", "kind", "panel", "problems", "tau_per_stage")
UNIT = "radians of the fastest small oscillation"
WHAT = "log10 of the largest |H - H0|/|H0| over every step"


def proof_measure(methods: Sequence[str], settings: ProofSettings) -> dict[str, Contents]:
    """Integrate all problems of all ensembles with all methods of the comparison.

    The result has ``run``: ``log_error`` over (ensemble, integrator, point, problem), NaN if an ensemble has fewer step
    sizes than another, and ``anharmonicity`` over (ensemble, problem).
    """
    trials = list(proof_ensembles(settings))
    ensembles, points = [trial.ensemble for trial in trials], max(trial.tau_per_stage.size for trial in trials)
    kinds, taus = list(map(kind_of, methods)), np.full((len(trials), points), np.nan)
    errors = np.full((len(trials), len(methods), points, settings.systems), np.nan)
    for e, trial in enumerate(trials):
        here = slice(trial.tau_per_stage.size)
        taus[e, here] = trial.tau_per_stage
        errors[e, :, here] = log_errors(trial.ensemble, methods, trial.tau_per_stage, trial.charge)
    variables = {
        **coordinate("ensemble", [one.name for one in ensembles], "ensemble of problems"),
        **method_coordinates(map(integrators.__getitem__, methods)),
        "kind": variable("integrator", kinds, "trained, published, or own: found by this project"),
        "panel": variable("ensemble", [trial.panel for trial in trials], "panel of the figure of gains"),
        "problems": variable("ensemble", [one.size for one in ensembles], "number of problems"),
        "tau_per_stage": variable(("ensemble", "point"), taus, f"step size over the cost of a step, in {UNIT}"),
        "log_error": variable(
            ("ensemble", "integrator", "point", "problem"), errors, WHAT
        ),
        "anharmonicity": variable(
            ("ensemble", "problem"), [one.strength for one in ensembles],
            "variation of the Hessian of V along the orbits of the problems",
        ),
    }  # fmt: skip
    return {"run": Contents(variables=variables, coordinates=COORDINATES)}


def log_errors(ensemble: Ensemble, methods: Sequence[str], tau_per_stage: Floats, charge: float) -> Floats:
    """Return log10 max |dH/H0| (methods, T, M) on M problems at equal cost, at least the resolution of doubles.

    ``tau_per_stage`` (T,) are step sizes over the cost of a step, and ``charge`` the cost of the gradient of the square
    of grad V, in forces.
    """
    errors = [errors_of(ensemble, integrators[name], tau_per_stage.tolist(), charge) for name in methods]
    found: Floats = log10(np.maximum(errors, LEAST))
    return found


#: Numbers of coordinates of the random potentials, and ranges of their strength, the widest last.
DIMENSIONS = (2, 3)
BANDS = ((1e-3, 1e-2), (1e-2, 1e-1), (1e-1, 0.5), (1e-2, 0.5))
#: Named systems with more coordinates are chains.
CHAIN = 2


class Trial(NamedTuple):
    """An ensemble, step sizes over the cost of a step (T,), the panel of its curve, and the cost of a gradient."""

    ensemble: Ensemble
    tau_per_stage: Floats
    panel: str
    charge: float = CHARGE


def proof_ensembles(settings: ProofSettings) -> Iterator[Trial]:
    """Yield each ensemble; step sizes are in its unit."""
    taus = np.array([float(tau) for tau in settings.tau_per_stage])
    t_end = float(settings.t_end)
    for dimension in DIMENSIONS:
        for band in BANDS:
            found = problems.random_ensemble(dimension, settings.systems, settings.seed, band=band, t_end=t_end)
            yield Trial(problems.with_anharmonicity(found), taus, f"random potentials, d = {dimension}")
    for named in problems.named_ensembles(settings.systems, settings.seed, t_end):
        yield Trial(named, taus, "chains" if named.system.dimension > CHAIN else "one or two coordinates")
    orbits = problems.orbit_ensemble(settings.systems, settings.seed, eccentricities=ECCENTRICITIES, orbits=ORBITS)
    evaluations = np.array(settings.evaluations_per_orbit, dtype=float)
    yield Trial(problems.with_anharmonicity(orbits), 2 * np.pi / evaluations, "Kepler orbits", CHARGE_OF_ORBITS)


# --- Long runs of the trained methods, backward runs, and runs with steps so short that rounding errors dominate.

#: Systems of the runs, and number of starts on each of them.
SYSTEMS, STARTS = ("henon_heiles", "morse"), 16
#: Step sizes per stage, in radians of the fastest small oscillation, of the long runs and of the runs for rounding.
TAU_PER_STAGE, FINE = 0.1, 0.02
#: Number of samples of a long run; inverse fractions of its steps for forward and backward runs, and for evaluations of
#: the runs for rounding.
SAMPLES, BACK, ROUNDED = 4001, Fraction(1, 100), Fraction(1, 10)
SUMS = ("compensated", "plain")
#: Maximum number of samples of the runs for rounding.
SAMPLES_ROUNDED = 64

#: Variables over (system, integrator): their further dimensions and meaning.
_STATES = ("summation", "problem", "end", "component")
MEANINGS = {
    "energy_error": (("problem", "sample"), "(H - H0)/|H0| of the long runs"),
    "max_energy_error": (("problem",), "maximum of |H - H0|/|H0| over every step of the long runs"),
    "q": (_STATES, "coordinates at the start, at the end of the run there and after the run back"),
    "q_low": (_STATES, "low part of q"),
    "p": (_STATES, "momenta at the start, at the end of the run there and after the run back"),
    "p_low": (_STATES, "low part of p"),
    "fine_energy_error": (("arithmetic", "problem", "fine_sample"), "(H - H0)/|H0| of the runs for rounding"),
}


def run(
    ensemble: Ensemble, method: Tableau, tau_per_stage: float, steps: int, start: Floats | None = None, *,
    samples: int, back: bool = False, **how: Any,
) -> Trajectories:  # fmt: skip
    """Return runs of one method on some problems, from their own initial conditions by default.

    ``tau_per_stage`` is in the unit of the ensemble; ``back`` reverses time; ``how`` are members of :class:`Numerics`.
    """
    tau = Fraction(tau_per_stage * ensemble.unit * method.stages)
    return integrate_batch(
        ensemble.system, method, t_end=(-tau if back else tau) * steps, steps=np.full(ensemble.size, steps),
        samples=samples, numerics=Numerics(width=LANES, **how), start=ensemble.start if start is None else start,
        parameters=ensemble.parameters,
    )  # fmt: skip


def long_runs_measure(methods: Sequence[str], beside: str, settings: ProofSettings) -> dict[str, Contents]:
    """Return the file ``run``: :func:`long_runs` of the reference method ``beside``, which comes first, and others."""
    chosen = [one for one in problems.NAMED if one.name in SYSTEMS]
    ensembles = {one.name: problems.named_ensemble(one, STARTS, settings.seed, float(settings.t_end)) for one in chosen}
    variables = long_runs(ensembles, [integrators[name] for name in (beside, *methods)], settings.steps)
    return {"run": Contents(variables=variables, coordinates=("label", "step"))}


def long_runs(ensembles: Mapping[str, Ensemble], methods: Sequence[Tableau], steps: int) -> Variables:
    """Integrate ensembles of equal size, by the name of their system, with all methods; a long run has ``steps``.

    The variables are as in :data:`MEANINGS`, NaN after the last sample of a run and the last coordinate of a system.
    """
    samples = min(SAMPLES, steps + 1)
    coordinates = {
        **coordinate("system", list(ensembles), "system"),
        **method_coordinates(methods),
        **coordinate("summation", list(SUMS), "summation of the steps"),
        **coordinate("end", ["start", "there", "back"], "end of the runs there and back"),
        **coordinate("arithmetic", [*SUMS, "extended"], "summation of the steps, or double-double"),
    }
    sizes = {name: len(values) for name, (_, values, _) in coordinates.items()} | {
        "problem": next(iter(ensembles.values())).size, "sample": samples, "fine_sample": SAMPLES_ROUNDED,
        "component": max(one.system.dimension for one in ensembles.values()),
    }  # fmt: skip
    found: Variables = {}
    for key, (dims, meaning) in MEANINGS.items():
        over = ("system", "integrator", *dims)
        found[key] = variable(over, np.full([sizes[name] for name in over], np.nan), meaning)
    for i, ensemble in enumerate(ensembles.values()):
        for j, method in enumerate(methods):
            for key, values in _computed(ensemble, method, steps).items():
                found[key][1][(i, j, *map(slice, values.shape))] = values
    marks = np.arange(samples) * steps // (samples - 1)
    return found | coordinates | {
        "step": variable("sample", marks, "step of the sample"),
        "tau_per_stage": variable((), TAU_PER_STAGE, "step size per stage, in radians of the fastest oscillation"),
    }  # fmt: skip


def _computed(ensemble: Ensemble, method: Tableau, steps: int) -> dict[str, Floats]:
    """Return the variables of one method on one system."""
    long = run(ensemble, method, TAU_PER_STAGE, steps, samples=SAMPLES)
    short = partial(run, ensemble, method, TAU_PER_STAGE, max(1, int(steps * BACK)), samples=2)
    evaluated = max(1, round(steps * ROUNDED / method.stages))
    fine = partial(run, ensemble, method, FINE, evaluated, samples=SAMPLES_ROUNDED)
    there = [short(summation=sums) for sums in SUMS]
    ends = [np.concatenate([x[:, -1] for x in (one.q, one.q_low, one.p, one.p_low)], axis=1) for one in there]
    again = [short(end, summation=sums, back=True) for sums, end in zip(SUMS, ends, strict=True)]
    rounded = [fine(summation=sums) for sums in SUMS]
    exact = fine(precision="extended", double_coefficients=True)
    found = {
        "energy_error": long.energy_error,
        "max_energy_error": long.max_energy_error,
        "fine_energy_error": np.array([path.energy_error for path in (*rounded, exact)]),
    }
    for name in ("q", "q_low", "p", "p_low"):
        pairs = [(getattr(one, name), getattr(other, name)) for one, other in zip(there, again, strict=True)]
        found[name] = np.array([np.concatenate([one, other[:, -1:]], axis=1) for one, other in pairs])
    return found


# --- Energy errors of the methods of each idea on random potentials of all strengths, at equal cost.
#
# Each potential is drawn as :mod:`nearharmonic_studies.trained.problems` has it, with strength 1; its cubic and quartic
# coefficients are then multiplied by each strength, with the same start. The frequencies do not change, so that they
# can be declared and their oscillators solved exactly.

#: Number of coordinates and of frequencies, which are the first parameters.
DIMENSION = 2
#: Smallest and largest strength, their number, and the problems of an ensemble over the number of potentials.
WEAKEST, STRONGEST, STRENGTHS, PART = 1e-4, 1.0, 13, 3
#: Cost of an evaluation with the exact oscillator over one with T and V, measured: docs/results/exact_oscillator.md.
CHARGE_OF_ROTATIONS = 1.12


def scaled_potentials(count: int, strengths: Floats, seed: int, t_end: float) -> Ensemble:
    """Return ``count`` random potentials at each of J strengths (J,), the strengths of the first potential first.

    Strengths multiply cubic and quartic coefficients; ``t_end`` is in radians of the frequency 1.
    """
    whole = problems.random_ensemble(DIMENSION, count, seed, band=(1.0, 1.0), t_end=t_end)
    parameters = np.repeat(whole.parameters, len(strengths), axis=0).reshape(count, len(strengths), -1)
    parameters[:, :, 2 * DIMENSION :] *= strengths[:, None]
    start = np.repeat(whole.start, len(strengths), axis=0)
    return replace(whole, start=start, parameters=parameters.reshape(len(start), -1), strength=None)


def ideas_measure(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings) -> dict[str, Contents]:
    """Return ``run``: ``log_error`` and ``exact_log_error`` over (integrator, tau_per_stage, strength, problem).

    The former is of ``methods`` with T and V, except those with modified potentials, which belong to no idea; the
    latter of the methods ``exact`` for the exactly solved oscillator.
    """
    taus, count = np.array([float(tau) for tau in settings.tau_per_stage]), settings.systems // PART
    strengths = np.array(geometric(WEAKEST, STRONGEST, STRENGTHS))
    whole = scaled_potentials(count, strengths, settings.seed, float(settings.t_end))
    kept = [name for name in methods if idea_of(integrators[name]) is not None]
    split, rotated = (
        np.moveaxis(log_errors(ensemble, names, steps, 0.0).reshape(len(names), len(taus), count, -1), 2, -1)
        for ensemble, names, steps in (
            (whole, kept, taus), (problems.with_exact_oscillators(whole), exact, taus * CHARGE_OF_ROTATIONS),
        )
    )  # fmt: skip
    over = ("tau_per_stage", "strength", "problem")
    variables = {
        **coordinate("tau_per_stage", taus, "step size over the cost of a step, in radians of the fastest oscillation"),
        **coordinate("strength", strengths, "by which cubic and quartic coefficients are multiplied"),
        **method_coordinates(map(integrators.__getitem__, kept)),
        **coordinate("exact_integrator", list(exact), "integrator that solves the oscillator exactly"),
        "idea": variable("integrator", [idea_of(integrators[name]) for name in kept], "idea that it is built on"),
        "log_error": variable(("integrator", *over), split, f"{WHAT}, with T and V"),
        "exact_log_error": variable(
            ("exact_integrator", *over), rotated, f"{WHAT}, with the oscillator solved exactly"
        ),
        "anharmonicity": variable(
            over[1:], problems.anharmonicities(whole).reshape(count, -1).T,
            f"variation of the Hessian of V along the orbits of {DIMENSION} coordinates",
        ),
    }  # fmt: skip
    return {"run": Contents(variables=variables, coordinates=("label", "idea"))}


# --- Gains at equal time on this machine, with the measured cost of the gradient of the square of grad V.
#
# All methods without modified potentials need equal times per evaluation on one system, so that equal evaluations are
# equal times. Methods with modified potentials are run again with the measured cost.

#: Timed methods: one without modified potentials, and one with equal stages and a gradient in each stage.
PLAIN, MODIFIED = "mclachlan_ss5", "abag5o6"
#: Number of lanes in the timing, by the name of the column.
WIDTHS = {"lanes": LANES, "single": 1}
#: Number of steps of a timed run; number of problems of a run in lanes.
TIMED_STEPS, TIMED_PROBLEMS = 2000, 2 * LANES
PATIENCE = Patience(least=7, most=25, seconds=0.1, longest=1.0)
CAPTION = (
    "Nanoseconds of an evaluation and trajectory in SIMD lanes and of a single trajectory, plain sums, no energies, "
    "minimum of interleaved calls. Additional cost of the gradient of the square of grad V, in evaluations. Gain of "
    "the best trained method over the best published one, in decades, at equal evaluations and at equal time of "
    "either kind"
)


@measures_time
def measure_times(cube: str, methods: Sequence[str], settings: ProofSettings) -> dict[str, Any]:
    """Return the ``table`` of times and of gains at equal time, from the path of the cube of mean errors."""
    found = read(cube)
    names = [name for name in methods if integrators[name].modified]
    rows: list[list[Any]] = []
    known: dict[str, dict[str, tuple[float, float]]] = {}
    with pinned():
        for e, trial in enumerate(proof_ensembles(settings)):
            system = trial.ensemble.system.name
            if system not in known:
                known[system] = {mode: costs(trial.ensemble, width) for mode, width in WIDTHS.items()}
            errors = found["mean_log_error"].isel(ensemble=e, point=slice(len(trial.tau_per_stage))).values
            rows += _rows_of_times(trial, methods, names, errors, known[system])
    header = ["ensemble", "tau_per_stage", *(f"ns_{mode}" for mode in WIDTHS), *(f"charge_{mode}" for mode in WIDTHS)]
    header += ["gain", *(f"gain_{mode}" for mode in WIDTHS)]
    return {"table": Table(header=header, rows=rows, caption=f"{CAPTION}; {processor()}.")}


def costs(ensemble: Ensemble, width: int) -> tuple[float, float]:
    """Return nanoseconds per evaluation and trajectory, and the additional cost of a gradient in evaluations.

    Some problems of the ensemble are run in ``width`` SIMD lanes; with one lane, a single trajectory.
    """
    few = ensemble.part(np.arange(TIMED_PROBLEMS if width > 1 else 1) % ensemble.size)
    methods = [integrators[PLAIN], integrators[MODIFIED]]
    calls = [prepared_run(few, method, width) for method in methods]
    for call in calls:
        call()
    plain, modified = (
        1e9 * min(times) / (TIMED_STEPS * method.stages * few.size)
        for method, times in zip(methods, interleaved(calls, PATIENCE), strict=True)
    )
    share = getattr(methods[1], "gradients", 0) / methods[1].stages
    return plain, max(0.0, (modified / plain - 1) / share)


def prepared_run(ensemble: Ensemble, method: Tableau, width: int) -> Callable[[], None]:
    """Return a call of :data:`STEPS` steps of each problem, with a tenth of a radian per stage."""
    numerics = Numerics(summation="plain", energy="none", width=width)
    tau = Fraction(ensemble.unit * method.stages) / 10
    marks = np.tile(np.array([[0, TIMED_STEPS]]), (ensemble.size, 1))
    batch = prepared_batch(
        ensemble.system, method, numerics, marks=marks, scheme=np.zeros(ensemble.size, np.int64),
        moves=moves_of(ensemble.system, method, [tau], numerics), start=ensemble.start, parameters=ensemble.parameters,
    )  # fmt: skip
    return batch.run


def _rows_of_times(
    trial: Trial, methods: Sequence[str], modified: Sequence[str], errors: Floats,
    known: dict[str, tuple[float, float]],
) -> Iterator[list[Any]]:  # fmt: skip
    """Return the rows of an ensemble, with the modified methods run again at the measured cost."""
    kinds = np.array([kind_of(name) for name in methods])
    places = [list(methods).index(name) for name in modified]
    gains = [gain(errors, kinds)]
    for _, charge in known.values():
        again = errors.copy()
        if places:
            again[places] = log_errors(trial.ensemble, modified, trial.tau_per_stage, charge).mean(axis=-1)
        gains.append(gain(again, kinds))
    for t, tau in enumerate(trial.tau_per_stage.tolist()):
        numbers = [[one[k] for one in known.values()] for k in (0, 1)]
        yield [trial.ensemble.name, tau, *numbers[0], *numbers[1], *(float(row[t]) for row in gains)]


def gain(errors: Floats, kinds: Any) -> Floats:
    """Return best published minus best trained (T,) of mean logarithms (A, T); NaN if there is none."""
    best = [errors[kinds == kind].min(axis=0, initial=np.inf) for kind in ("published", "trained")]
    found: Floats = np.where(np.isfinite(best).all(axis=0), best[0] - best[1], np.nan)
    return found
