"""Energy errors for a T that is not quadratic: the relativistic oscillator, by amplitude.

At small amplitudes the system is the harmonic oscillator; at amplitude A the momentum reaches sqrt((1 + A^2/2)^2 - 1).
Each method runs in its own roles and with the roles of T and V exchanged. Exchanged roles are equivalent, after q -> p,
p -> -q, to the method in its own roles on p^2/2 + sqrt(1 + q^2) - 1. This system is equally anharmonic, but quadratic
in p: only the form of T differs.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.numbers import start_row
from nearharmonic.engine.settings import tau_grid
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Contents, coordinate, method_coordinates, variable
from nearharmonic.systems.relativistic_oscillator import SYSTEM

AMPLITUDES = ("0.01", "0.03", "0.1", "0.3", "1", "3", "10")
LOWEST, HIGHEST, POINTS_PER_DECADE = 0.01, 1.0, 20
ROLES = ("own", "exchanged")


def exchanged(tableau: Tableau) -> Tableau:
    """Return ``tableau`` with the rows of drift and kick exchanged."""
    return tableau.role("kick" if tableau.first == "drift" else "drift")


def measure(integrators: Sequence[str]) -> dict[str, Contents]:
    """Return the file ``run``: energy errors over (roles, amplitude, integrator, tau_per_stage) of methods for any T.

    max_energy_error and mean_energy_error are over all steps, relative to H0, infinite for diverged runs.
    """
    kept = [registry[name] for name in integrators if registry[name].requires is None]
    grid = tau_grid(LOWEST, HIGHEST, POINTS_PER_DECADE)
    shape = (len(ROLES), len(AMPLITUDES), len(kept), len(grid))
    largest, mean = np.empty(shape), np.empty(shape)
    for j, tableau in enumerate(kept):
        for i, method in enumerate((tableau, exchanged(tableau))):
            largest[i, :, j], mean[i, :, j] = _errors(method, grid)
    dims = ("roles", "amplitude", "integrator", "tau_per_stage")
    variables = {
        "max_energy_error": variable(dims, largest, "maximum of |H - H0|/|H0|, inf if diverged"),
        "mean_energy_error": variable(dims, mean, "mean of |H - H0|/|H0|, inf if diverged"),
        **coordinate("roles", list(ROLES), "the method's roles of T and V, or exchanged"),
        **coordinate("amplitude", [float(a) for a in AMPLITUDES], "q at the start"),
        **method_coordinates(kept),
        **coordinate("tau_per_stage", list(grid), "step size per stage"),
    }
    return {"run": Contents(variables=variables, coordinates=("label",))}


def _errors(tableau: Tableau, grid: Sequence[float]) -> tuple[Any, Any]:
    """Return largest and mean error (amplitude, tau) of all runs of one method, computed together in lanes."""
    steps = [tableau.steps(tau, SYSTEM.t_end) for tau in grid]
    _, p0 = SYSTEM.start(Fraction)
    starts = [start_row([Fraction(a)], p0) for a in AMPLITUDES for _ in grid]
    paths = integrate_batch(
        SYSTEM,
        tableau,
        t_end=Fraction(SYSTEM.t_end),
        steps=steps * len(AMPLITUDES),
        samples=2,
        start=np.array(starts),
    )
    shape = (len(AMPLITUDES), len(grid))
    return paths.max_energy_error.reshape(shape), paths.mean_energy_error.reshape(shape)
