"""Runs of the comparison, of long times, and of the ideas behind trained methods."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.engine.batch import Trajectories, integrate_batch
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, geometric, log10
from nearharmonic.output.dataset import Contents, Variables, coordinate, method_coordinates, variable
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LANES, LEAST, Ensemble
from nearharmonic_studies.trained.contestants import idea_of, kind_of
from nearharmonic_studies.trained.problems import (
    NAMED,
    anharmonicities,
    named_ensemble,
    named_ensembles,
    orbit_ensemble,
    random_ensemble,
    with_anharmonicity,
    with_exact_oscillators,
)
from nearharmonic_studies.trained.proof_settings import ORBITS, ProofSettings
from nearharmonic_studies.trained.purposes import CHARGE as CHARGE_OF_AN_EVALUATION
from nearharmonic_studies.trained.purposes import CHARGE_OF_ORBITS, ECCENTRICITIES

# --- Energy errors of all methods on each problem of the test ensembles, at equal cost.

#: Auxiliary coordinates.
COORDINATES = ("label", "kind", "panel", "problems", "tau_per_stage")
UNIT = "radians of the fastest small oscillation"


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
            ("ensemble", "integrator", "point", "problem"), errors, "log10 of the largest |H - H0|/|H0| over every step"
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
    charge: float = CHARGE_OF_AN_EVALUATION


def proof_ensembles(settings: ProofSettings) -> Iterator[Trial]:
    """Yield each ensemble; step sizes are in its unit."""
    taus = np.array([float(tau) for tau in settings.tau_per_stage])
    t_end = float(settings.t_end)
    for dimension in DIMENSIONS:
        for band in BANDS:
            found = random_ensemble(dimension, settings.systems, settings.seed, band=band, t_end=t_end)
            yield Trial(with_anharmonicity(found), taus, f"random potentials, d = {dimension}")
    for named in named_ensembles(settings.systems, settings.seed, t_end):
        yield Trial(named, taus, "chains" if named.system.dimension > CHAIN else "one or two coordinates")
    orbits = orbit_ensemble(settings.systems, settings.seed, eccentricities=ECCENTRICITIES, orbits=ORBITS)
    evaluations = np.array(settings.evaluations_per_orbit, dtype=float)
    yield Trial(with_anharmonicity(orbits), 2 * np.pi / evaluations, "Kepler orbits", CHARGE_OF_ORBITS)


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
    "q_low": (_STATES, "digits below those of q"),
    "p": (_STATES, "momenta at the start, at the end of the run there and after the run back"),
    "p_low": (_STATES, "digits below those of p"),
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
    chosen = [one for one in NAMED if one.name in SYSTEMS]
    ensembles = {one.name: named_ensemble(one, STARTS, settings.seed, float(settings.t_end)) for one in chosen}
    variables = long_runs(ensembles, [integrators[name] for name in (beside, *methods)], settings.steps)
    return {"run": Contents(variables=variables, coordinates=("label", "step"))}


def long_runs(ensembles: Mapping[str, Ensemble], methods: Sequence[Tableau], steps: int) -> Variables:
    """Integrate ensembles of equal size, by the name of their system, with all methods; a long run has ``steps``.

    The variables are those of :data:`MEANINGS`, NaN after the last sample of a run and the last coordinate of a system.
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


# --- Random potentials at all strengths, whose oscillators can be solved exactly.
#
# Each is drawn as :mod:`nearharmonic_studies.trained.problems` has it, with strength 1; its cubic and quartic
# coefficients are then multiplied by each strength, with the same start. The frequencies do not change, so that they
# can be declared.

#: Number of coordinates and of frequencies, which are the first parameters.
DIMENSION = 2
#: Smallest and largest strength.
WEAKEST, STRONGEST = 1e-4, 1.0
#: Cost of an evaluation with the exact oscillator over one with T and V, measured: docs/results/exact_oscillator.md.
CHARGE = 1.12


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """K ``potentials``, given at strength 1, at J ``strengths`` each: factors of cubic and quartic coefficients."""

    potentials: Ensemble
    strengths: Floats

    def ensemble(self) -> Ensemble:
        """Return all K J problems, the strengths of the first potential first."""
        whole, count = self.potentials, len(self.strengths)
        parameters = np.repeat(whole.parameters, count, axis=0).reshape(whole.size, count, -1)
        parameters[:, :, 2 * DIMENSION :] *= self.strengths[:, None]
        return Ensemble(
            name=whole.name, system=whole.system, start=np.repeat(whole.start, count, axis=0),
            parameters=parameters.reshape(whole.size * count, -1), t_end=whole.t_end,
        )  # fmt: skip


def scaled_potentials(count: int, strengths: int, seed: int, t_end: float) -> Scaled:
    """Return random potentials at logarithmically spaced strengths; ``t_end`` is in radians of the frequency 1."""
    whole = random_ensemble(DIMENSION, count, seed, band=(1.0, 1.0), t_end=t_end)
    return Scaled(potentials=whole, strengths=np.array(geometric(WEAKEST, STRONGEST, strengths)))


def exact_errors(scaled: Scaled, method: Tableau, tau_per_stage: Floats) -> Floats:
    """Return the largest |dH/H0| (T, K J) of a method for exactly solved oscillators, at equal cost.

    An evaluation costs :data:`CHARGE`. Diverged runs have the error 1.
    """
    found = errors_of(with_exact_oscillators(scaled.ensemble()), method, (tau_per_stage * CHARGE).tolist())
    return np.maximum(found, LEAST)


# --- Energy errors of the methods of each idea on potentials of all strengths, at equal cost.

#: Ratio of the number of potentials to the problems of an ensemble; each potential has several strengths.
PART, STRENGTHS = 3, 13
WHAT = "log10 of the largest |H - H0|/|H0| over every step"


def ideas_measure(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings) -> dict[str, Contents]:
    """Return the file ``run``: :func:`errors_of_methods` on all potentials at all strengths."""
    taus = np.array([float(tau) for tau in settings.tau_per_stage])
    scaled = scaled_potentials(settings.systems // PART, STRENGTHS, settings.seed, float(settings.t_end))
    variables = errors_of_methods(scaled, methods, exact, taus)
    return {"run": Contents(variables=variables, coordinates=("label", "idea"))}


def errors_of_methods(scaled: Scaled, methods: Sequence[str], exact: Sequence[str], taus: Floats) -> Variables:
    """Return ``log_error`` and ``exact_log_error`` over (integrator, tau_per_stage, strength, problem).

    The former is of ``methods`` with T and V, except those with modified potentials, which belong to no idea; the
    latter of the methods ``exact`` for the exactly solved oscillator. ``taus`` are step sizes over the cost of a step.
    """
    whole, shape = scaled.ensemble(), (len(taus), scaled.potentials.size, len(scaled.strengths))

    def logarithms(errors: Sequence[Floats]) -> Floats:
        return np.moveaxis(log10(np.maximum(np.reshape(errors, (len(errors), *shape)), LEAST)), 2, -1)

    kept = [name for name in methods if idea_of(integrators[name]) is not None]
    split = logarithms([errors_of(whole, integrators[name], taus.tolist()) for name in kept])
    rotated = logarithms([exact_errors(scaled, integrators[name], taus) for name in exact])
    over = ("tau_per_stage", "strength", "problem")
    delta = anharmonicities(whole).reshape(shape[1:]).T
    return {
        **coordinate("tau_per_stage", taus, "step size over the cost of a step, in radians of the fastest oscillation"),
        **coordinate("strength", scaled.strengths, "by which cubic and quartic coefficients are multiplied"),
        **method_coordinates(map(integrators.__getitem__, kept)),
        **coordinate("exact_integrator", list(exact), "integrator that solves the oscillator exactly"),
        "idea": variable("integrator", [idea_of(integrators[name]) for name in kept], "idea that it is built on"),
        "log_error": variable(("integrator", *over), split, f"{WHAT}, with T and V"),
        "exact_log_error": variable(
            ("exact_integrator", *over), rotated, f"{WHAT}, with the oscillator solved exactly"
        ),
        "anharmonicity": variable(
            over[1:], delta, f"variation of the Hessian of V along the orbits of {DIMENSION} coordinates"
        ),
    }
