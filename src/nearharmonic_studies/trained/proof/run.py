"""Energy errors of all methods on each problem of the test ensembles, at equal cost."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats, log10
from nearharmonic.output.dataset import Contents, coordinate, method_coordinates, variable
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Ensemble
from nearharmonic_studies.trained.comparison.contestants import kind_of
from nearharmonic_studies.trained.problems.anharmonicity import with_anharmonicity
from nearharmonic_studies.trained.problems.named_systems import named_ensembles
from nearharmonic_studies.trained.problems.orbits import orbit_ensemble
from nearharmonic_studies.trained.problems.purpose import CHARGE, CHARGE_OF_ORBITS, ECCENTRICITIES
from nearharmonic_studies.trained.problems.random_potentials import random_ensemble
from nearharmonic_studies.trained.proof.settings import ORBITS, ProofSettings

#: Auxiliary coordinates.
COORDINATES = ("label", "kind", "panel", "problems", "tau_per_stage")
UNIT = "radians of the fastest small oscillation"


def measure(methods: Sequence[str], settings: ProofSettings) -> dict[str, Contents]:
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
    charge: float = CHARGE


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
