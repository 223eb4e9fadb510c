"""Energy errors of all methods on the test ensembles, at equal cost, and the gains of the trained ones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nearharmonic.engine.portable import log10
from nearharmonic.experiments.trained.contestants import kind_of
from nearharmonic.experiments.trained.proof.ensembles import Trial, proof_ensembles
from nearharmonic.experiments.trained.proof.gains import CONFIDENCE, Gains, gains
from nearharmonic.experiments.trained.proof.settings import ProofSettings
from nearharmonic.experiments.trained.proof.tables import gain_table, method_table
from nearharmonic.modified_integrators import method_of
from nearharmonic.output.dataset import (
    Contents,
    Variables,
    bounds_coordinate,
    coordinate,
    method_coordinates,
    variable,
)
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Ensemble, Floats

#: Of the anharmonicities of the problems of an ensemble.
QUANTILES = (0.05, 0.5, 0.95)
#: Auxiliary coordinates of the cube.
COORDINATES = ("label", "kind", "panel", "problems", "tau_per_stage")
WHAT = "mean over the problems of log10 of the largest |H - H0|/|H0| over every step"
UNIT = "radians of the fastest small oscillation"


def measure(methods: Sequence[str], settings: ProofSettings) -> dict[str, Any]:
    """Return the ``cube`` of mean errors and gains, the table of ``gains``, and that of trained ``methods``.

    Parameters
    ----------
    methods : sequence of str
        Names of all methods that are compared.
    settings : ProofSettings
        Ensembles and step sizes.
    """
    kinds = [kind_of(name) for name in methods]
    trials, means, found = [], [], []
    for trial in proof_ensembles(settings):
        logarithms = log_errors(trial.ensemble, methods, trial.tau_per_stage, trial.charge)
        trials.append(trial)
        means.append(logarithms.mean(axis=-1))
        found.append(gains(logarithms, kinds, settings.seed))
    variables = _variables(methods, kinds, trials, means) | _gain_variables(methods, found)
    return {
        "cube": Contents(variables=variables, coordinates=COORDINATES),
        "gains": gain_table(variables),
        "methods": method_table(variables),
    }


def log_errors(ensemble: Ensemble, methods: Sequence[str], tau_per_stage: Floats, charge: float) -> Floats:
    """Return log10 max |dH/H0| (methods, T, M) at equal cost, not below what doubles resolve.

    Parameters
    ----------
    ensemble : Ensemble
        The M problems.
    methods : sequence of str
        Names of the methods.
    tau_per_stage : (T,) array of float
        Step sizes over the cost of a step.
    charge : float
        Cost of the gradient of the square of grad V, in forces.
    """
    errors = [errors_of(ensemble, method_of(name), tau_per_stage.tolist(), charge) for name in methods]
    found: Floats = log10(np.maximum(errors, LEAST))
    return found


def padded(rows: Sequence[Any], fill: Any) -> Any:
    """Return arrays of shape (..., T) with different T as one array, short ones filled up behind."""
    longest = max(np.shape(row)[-1] for row in rows)
    missing = [(*np.shape(row)[:-1], longest - np.shape(row)[-1]) for row in rows]
    return np.stack([np.concatenate([row, np.full(m, fill)], -1) for row, m in zip(rows, missing, strict=True)])


def _variables(
    methods: Sequence[str], kinds: Sequence[str], trials: Sequence[Trial], means: Sequence[Floats]
) -> Variables:
    over, ensembles = ("ensemble", "integrator", "point"), [trial.ensemble for trial in trials]
    taus = [trial.tau_per_stage for trial in trials]
    spread = [np.quantile(one.strength, QUANTILES) for one in ensembles if one.strength is not None]
    return {
        **coordinate("ensemble", [one.name for one in ensembles], "ensemble of problems"),
        **method_coordinates(map(method_of, methods)),
        **bounds_coordinate(),
        **coordinate("quantile", list(QUANTILES), "fraction of the problems that are less anharmonic"),
        "kind": variable("integrator", list(kinds), "trained, published, or own: found by this project"),
        "panel": variable("ensemble", [trial.panel for trial in trials], "panel of the figure of gains"),
        "problems": variable("ensemble", [one.size for one in ensembles], "number of problems"),
        "tau_per_stage": variable(
            ("ensemble", "point"), padded(taus, np.nan), f"step size over the cost of a step, in {UNIT}"
        ),
        "mean_log_error": variable(over, padded(means, np.nan), WHAT),
        "anharmonicity": variable(
            ("ensemble", "quantile"), spread, "variation of the Hessian of V along the orbits of the problems"
        ),
    }


def _gain_variables(methods: Sequence[str], found: Sequence[Gains]) -> Variables:
    names = [*methods, ""]
    over = ("ensemble", "point")
    best = {
        kind: padded([[names[i] for i in getattr(one, kind)] for one in found], "") for kind in ("published", "trained")
    }
    ends = [np.moveaxis(one.interval, 0, -1) for one in found]
    return {
        "best_published": variable(over, best["published"], "published method with the least mean error"),
        "best_trained": variable(over, best["trained"], "trained method with the least mean error"),
        "gain": variable(over, padded([one.gain for one in found], np.nan), "gain of best_trained", "decades"),
        "gain_interval": variable(
            ("ensemble", "point", "bound"), np.moveaxis(padded(ends, np.nan), 1, -1),
            f"its {CONFIDENCE:.0%} interval by resampling the problems, the best of each chosen anew", "decades",
        ),
    }  # fmt: skip
