"""Energy errors over amplitude, step size and cost: with the oscillator solved exactly, and with T and V."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.coefficients import Floats
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics
from nearharmonic.experiments.exact_oscillator.crossings import crossings
from nearharmonic.experiments.exact_oscillator.settings import CHARGES, ExactOscillatorSettings
from nearharmonic.experiments.exact_oscillator.surfaces import starts_on
from nearharmonic.experiments.exact_oscillator.tables import crossing_table
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Contents, Variables, bounds_coordinate, coordinate, variable
from nearharmonic.systems.henon_heiles import SYSTEM

#: Of the largest |dH/H0| over the trajectories of a surface.
QUANTILES = (0.05, 0.5, 0.95)
WHAT = "quantile over the trajectories of the largest |H - H0|/|H0| over every step"


def measure(split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings) -> dict[str, Any]:
    """Return the ``cube`` of errors and crossings, and the ``table`` of crossings.

    Parameters
    ----------
    split, exact : sequence of str
        Names of the methods that split into T and V, and of those that solve the oscillator exactly.
    settings : ExactOscillatorSettings
        Energies, starts, interval and step sizes.
    """
    energies = settings.surfaces()
    start = np.concatenate([starts_on(energy, settings.trajectories, settings.seed) for energy in energies])
    taus = [Fraction(tau) for tau in settings.tau_per_stage]
    t_end, shape = Fraction(settings.t_end), (len(energies), settings.trajectories)

    def errors(names: Sequence[str], operators: str, charges: Sequence[float]) -> Floats:
        """Of each run, over (tau, charge, method, energy, trajectory)."""
        return np.stack([
            np.stack([
                np.stack([
                    largest_error(integrators[name], tau * Fraction(charge), t_end, start, operators).reshape(shape)
                    for name in names
                ])
                for charge in charges
            ])
            for tau in taus
        ])  # fmt: skip

    plain, rotated = errors(split, KINETIC_POTENTIAL, CHARGES[:1]), errors(exact, EXACT_OSCILLATOR, CHARGES)
    found = crossings(plain[:, 0], rotated, energies, settings.seed)
    variables = _variables(split, exact, settings, energies, plain[:, 0], rotated) | found
    cube = Contents(variables=variables, coordinates=("label", "exact_label"))
    return {"cube": cube, "table": crossing_table(variables)}


def largest_error(tableau: Tableau, tau_per_stage: Fraction, t_end: Fraction, start: Floats, split: str) -> Floats:
    """Return the largest |dH/H0| of each run.

    Parameters
    ----------
    tableau : Tableau
        The method.
    tau_per_stage, t_end : Fraction
        Step size divided by the stages, and interval; the step as used is that of a whole number of steps.
    start : (runs, 8) array of float
        Initial conditions.
    split : str
        What the two operators solve.
    """
    steps = max(1, round(t_end / (tau_per_stage * tableau.stages)))
    paths = integrate_batch(
        SYSTEM, tableau, t_end=t_end, steps=np.full(len(start), steps), samples=1, numerics=Numerics(split=split),
        start=start,
    )  # fmt: skip
    return paths.max_energy_error


def _variables(
    split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings, energies: Sequence[float],
    plain: Floats, rotated: Floats,
) -> Variables:  # fmt: skip
    taus = [float(tau) for tau in settings.tau_per_stage]
    quantiles = [np.moveaxis(_quantiles(errors), 0, -1) for errors in (plain, rotated)]
    over = ("tau_per_stage", "integrator", "energy", "quantile")
    return {
        **coordinate("tau_per_stage", taus, "step size per stage of the methods that split into T and V"),
        **coordinate("charge", list(CHARGES), "cost of an evaluation with the exact oscillator over one of T and V"),
        **coordinate("energy", list(energies), "energy H0"),
        **coordinate("quantile", list(QUANTILES), "fraction of the trajectories that err less"),
        **bounds_coordinate(),
        **coordinate("integrator", list(split), "integrator that splits into T and V"),
        **coordinate("exact_integrator", list(exact), "integrator that solves the oscillator exactly"),
        "label": variable("integrator", [integrators[name].label for name in split], "name in the paper"),
        "exact_label": variable("exact_integrator", [integrators[name].label for name in exact], "name in the paper"),
        "energy_error": variable(over, quantiles[0], f"{WHAT}, with T and V"),
        "exact_energy_error": variable(
            ("tau_per_stage", "charge", "exact_integrator", "energy", "quantile"), quantiles[1],
            f"{WHAT}, with the oscillator solved exactly, at a step size per stage of charge * tau_per_stage",
        ),
    }  # fmt: skip


def _quantiles(errors: Floats) -> Floats:
    """Over the last axis, of a value that is there: diverged trajectories have infinite errors."""
    ranked = np.sort(errors, axis=-1)
    return np.stack([ranked[..., min(ranked.shape[-1] - 1, int(q * ranked.shape[-1]))] for q in QUANTILES])
