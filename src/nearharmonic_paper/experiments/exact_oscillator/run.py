"""Energy errors of single trajectories, with an exactly solved oscillator and with T and V."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import product

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import Floats, quasi_random
from nearharmonic.output.store import Contents, coordinate, variable
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper.experiments.exact_oscillator import CHARGES, ExactOscillatorSettings

WHAT = "largest |H - H0|/|H0| over every step"


def measure(split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings) -> dict[str, Contents]:
    """Integrate all trajectories with methods for T and V (``split``) and for the exact oscillator (``exact``).

    The result has ``run``: ``energy_error`` over (tau_per_stage, integrator, energy, trajectory), and
    ``exact_energy_error`` over (tau_per_stage, charge, exact_integrator, energy, trajectory).
    """
    energies = settings.surfaces()
    start = np.concatenate([starts_on(energy, settings.trajectories, settings.seed) for energy in energies])
    taus = list(map(Fraction, settings.tau_per_stage))
    what = "step size per stage of the methods that split into T and V"
    t_end, shape = Fraction(settings.t_end), (len(energies), settings.trajectories)

    def errors(names: Sequence[str], operators: str, charges: Sequence[float]) -> Floats:
        """Return the largest error of each run, over (tau, charge, method, energy, trajectory)."""
        found = [
            largest_error(integrators[name], tau * Fraction(charge), t_end, start, operators)
            for tau, charge, name in product(taus, charges, names)
        ]
        return np.reshape(found, (len(taus), len(charges), len(names), *shape))

    plain, rotated = errors(split, KINETIC_POTENTIAL, CHARGES[:1]), errors(exact, EXACT_OSCILLATOR, CHARGES)
    over = ("energy", "trajectory")
    variables = {
        **coordinate("tau_per_stage", list(map(float, taus)), what),
        **coordinate("charge", list(CHARGES), "cost of an evaluation with the exact oscillator over one of T and V"),
        **coordinate("energy", energies, "energy H0"),
        **coordinate("integrator", list(split), "integrator that splits into T and V"),
        **coordinate("exact_integrator", list(exact), "integrator that solves the oscillator exactly"),
        "label": variable("integrator", [integrators[name].label for name in split], "name in the paper"),
        "exact_label": variable("exact_integrator", [integrators[name].label for name in exact], "name in the paper"),
        "energy_error": variable(("tau_per_stage", "integrator", *over), plain[:, 0], f"{WHAT}, with T and V"),
        "exact_energy_error": variable(
            ("tau_per_stage", "charge", "exact_integrator", *over), rotated,
            f"{WHAT}, with the oscillator solved exactly, at a step size per stage of charge * tau_per_stage",
        ),
    }  # fmt: skip
    return {"run": Contents(variables=variables, coordinates=("label", "exact_label"))}


def largest_error(tableau: Tableau, tau_per_stage: Fraction, t_end: Fraction, start: Floats, split: str) -> Floats:
    """Return the largest |dH/H0| of each run from ``start`` (runs, 8), of an integer number of steps in [0, t_end]."""
    steps = tableau.steps(tau_per_stage, t_end)
    paths = integrate_batch(
        SYSTEM, tableau, t_end=t_end, steps=np.full(len(start), steps), samples=1, numerics=Numerics(split=split),
        start=start,
    )  # fmt: skip
    return paths.max_energy_error


def radius(energy: float) -> float:
    """Return the largest |q| on the bounded part of V <= ``energy``, where r^2/2 - r^3/3 = ``energy`` and r <= 1."""
    lowest, highest = 0.0, 1.0
    for _ in range(60):
        r = (lowest + highest) / 2
        lowest, highest = (r, highest) if r * r / 2 - r * r * r / 3 < energy else (lowest, r)
    return highest


def starts_on(energy: float, count: int, seed: int) -> Floats:
    """Return starts (count, 8) in the layout of the kernel, in the microcanonical measure of H = ``energy``.

    The position is uniform where V < ``energy``, the direction of the momentum uniform on the circle. Surfaces of
    different energies have nearly the same points, in units of their radius. ``energy`` is above 0 and at most 1/6, the
    escape energy.
    """
    side = radius(energy)
    u = quasi_random(8 * count + 64, 3, seed)  # at least 1/4 of the square is inside
    x, y = ((2 * u[:, k] - 1) * side for k in range(2))
    kinetic = energy - SYSTEM.V((x, y))
    kept = np.flatnonzero((kinetic > 0) & (x * x + y * y <= side * side))[:count]
    momentum, angle = np.sqrt(2 * kinetic[kept]), 2 * np.pi * u[kept, 2]
    starts = np.zeros((count, 8))
    starts[:, 0], starts[:, 1] = x[kept], y[kept]
    starts[:, 4], starts[:, 5] = momentum * cos(angle), momentum * sin(angle)
    return starts
