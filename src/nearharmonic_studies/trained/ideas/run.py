"""Energy errors of the methods of each idea on potentials of all strengths, at equal cost."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats, log10
from nearharmonic.output.dataset import Contents, Variables, coordinate, method_coordinates, variable
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST
from nearharmonic_studies.trained.comparison.contestants import idea_of
from nearharmonic_studies.trained.ideas.oscillators import DIMENSION, Scaled, exact_errors, scaled_potentials
from nearharmonic_studies.trained.problems.anharmonicity import anharmonicities
from nearharmonic_studies.trained.proof.settings import ProofSettings

#: Ratio of the number of potentials to the problems of an ensemble; each potential has several strengths.
PART, STRENGTHS = 3, 13
WHAT = "log10 of the largest |H - H0|/|H0| over every step"


def measure(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings) -> dict[str, Contents]:
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
