"""The best of the methods of each idea over anharmonicity and step size, and which idea is ahead by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nearharmonic.engine.portable import log10
from nearharmonic.experiments.trained.contestants import IDEAS, idea_of
from nearharmonic.experiments.trained.ideas.oscillators import (
    CHARGE,
    DIMENSION,
    Scaled,
    exact_errors,
    scaled_potentials,
)
from nearharmonic.experiments.trained.ideas.tables import ideas_table
from nearharmonic.experiments.trained.problems.anharmonicity import anharmonicities
from nearharmonic.experiments.trained.proof.gains import CONFIDENCE, RESAMPLES, bounds, means_of, resampled
from nearharmonic.experiments.trained.proof.settings import ProofSettings
from nearharmonic.modified_integrators import method_of
from nearharmonic.output.dataset import Contents, Variables, bounds_coordinate, coordinate, variable
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Floats

#: The idea that the others are compared with.
REFERENCE = "general"
#: Part of the problems of an ensemble that are potentials here, as each is taken at so many strengths.
PART, STRENGTHS = 3, 13
#: Of the anharmonicities of the potentials at one strength.
QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True, kw_only=True)
class Idea:
    """Methods of one idea: their names, and logarithms to base 10 of their errors (A, T, J, K) on K problems."""

    names: Sequence[str]
    logarithms: Floats


def measure(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings) -> dict[str, Any]:
    """Return the ``cube`` of ideas over step size and strength, and the ``table`` of which is ahead.

    Parameters
    ----------
    methods : sequence of str
        Names of the methods with T and V; those with kicks of a modified potential stand for no idea here.
    exact : sequence of str
        Names of the methods that solve the oscillator exactly.
    settings : ProofSettings
        Number of potentials, and step sizes.
    """
    taus = np.array([float(tau) for tau in settings.tau_per_stage])
    scaled = scaled_potentials(settings.systems // PART, STRENGTHS, settings.seed, float(settings.t_end))
    found = ideas_of(scaled, methods, exact, taus)
    variables = _variables(scaled, taus) | _comparison(found, settings.seed)
    return {"cube": Contents(variables=variables), "table": ideas_table(variables)}


def ideas_of(scaled: Scaled, methods: Sequence[str], exact: Sequence[str], taus: Floats) -> dict[str, Idea]:
    """Return the errors of the methods of each idea, in the order of :data:`IDEAS`.

    Parameters
    ----------
    scaled : Scaled
        K potentials at J strengths.
    methods, exact : sequence of str
        As for :func:`measure`.
    taus : (T,) array of float
        Step sizes over the cost of a step.
    """
    whole, shape = scaled.ensemble(), (len(taus), scaled.potentials.size, len(scaled.strengths))

    def logarithms(errors: Sequence[Floats]) -> Floats:
        rows = log10(np.maximum(np.reshape(errors, (len(errors), *shape)), LEAST))
        return np.ascontiguousarray(np.moveaxis(rows, 2, -1))

    split = {idea: [name for name in methods if idea_of(method_of(name)) == idea] for idea in IDEAS}
    found = {
        idea: Idea(
            names=names, logarithms=logarithms([errors_of(whole, method_of(name), taus.tolist()) for name in names])
        )
        for idea, names in split.items()
        if names
    }
    rotated = logarithms([exact_errors(scaled, method_of(name), taus) for name in exact])
    return {IDEAS[0]: Idea(names=exact, logarithms=rotated)} | found


def _variables(scaled: Scaled, taus: Floats) -> Variables:
    delta = anharmonicities(scaled.ensemble()).reshape(scaled.potentials.size, -1)
    return {
        **coordinate("tau_per_stage", taus, "step size over the cost of a step, in radians of the fastest oscillation"),
        **coordinate("strength", scaled.strengths, "by which cubic and quartic coefficients are multiplied"),
        **coordinate("idea", list(IDEAS), f"what methods are built on; {IDEAS[0]} costs {CHARGE} an evaluation"),
        **bounds_coordinate(),
        **coordinate("quantile", list(QUANTILES), "fraction of the potentials that are less anharmonic"),
        "anharmonicity": variable(
            ("strength", "quantile"), np.quantile(delta, QUANTILES, axis=0).T,
            f"variation of the Hessian of V along the orbits of {DIMENSION} coordinates",
        ),
    }  # fmt: skip


def _comparison(found: Mapping[str, Idea], seed: int, resamples: int = RESAMPLES) -> Variables:
    """Errors of the best, gains over the reference and the idea that is ahead."""
    shape = found[REFERENCE].logarithms.shape[1:]
    problems = shape[-1]
    counts = resampled(problems, resamples, seed)
    best = np.full((len(IDEAS), *shape[:-1]), np.nan)
    again = np.full((*best.shape, resamples), np.nan)
    names = np.full(best.shape, "", dtype=object)
    for i, idea in enumerate(IDEAS):
        if idea in found:
            means = found[idea].logarithms.mean(axis=-1)
            best[i] = means.min(axis=0)
            names[i] = np.array(found[idea].names, dtype=object)[means.argmin(axis=0)]
            again[i] = means_of(found[idea].logarithms, counts).min(axis=0)
    reference = IDEAS.index(REFERENCE)
    over = ("idea", "tau_per_stage", "strength")
    return {
        "mean_log_error": variable(over, best, "mean over the potentials of log10 max |dH/H0|, best method of an idea"),
        "best_method": variable(over, names.astype(str), "best method of an idea; empty if it has none"),
        "gain": variable(over, best[reference] - best, f"gain over the best method of {REFERENCE}", "decades"),
        "gain_interval": variable(
            (*over, "bound"), bounds(again[reference] - again), f"its {CONFIDENCE:.0%} interval", "decades"
        ),
        **_ahead("", best, again, "idea with the least mean error"),
        **_ahead("_split", best[1:], again[1:], f"the same without {IDEAS[0]}"),
    }  # fmt: skip


def _ahead(suffix: str, best: Floats, again: Floats, what: str) -> Variables:
    """The leader among the last of the ideas, whose errors are (I, T, J), and its lead over the second of them."""
    order = np.argsort(best, axis=0, kind="stable")  # NaN last
    first, second = (np.take_along_axis(best, order[k : k + 1], 0)[0] for k in (0, 1))
    resampled = [np.take_along_axis(again, order[k : k + 1, ..., None], 0)[0] for k in (0, 1)]
    over = ("tau_per_stage", "strength")
    interval = bounds(resampled[1] - resampled[0])
    return {
        f"leader{suffix}": variable(over, np.array(IDEAS)[len(IDEAS) - len(best) :][order[0]], what),
        f"lead{suffix}": variable(over, second - first, "by which it is ahead of the second", "decades"),
        f"lead{suffix}_interval": variable((*over, "bound"), interval, "its 95 % interval", "decades"),
    }
