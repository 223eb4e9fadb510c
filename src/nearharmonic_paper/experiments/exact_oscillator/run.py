"""Energy errors of single trajectories, with an exactly solved oscillator and with T and V, and their settings."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics, check_fit
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.integrators.user_file import expanded
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import Floats, geometric
from nearharmonic.numerics.statistics import quasi_random
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper.entries import (
    POSITIVE,
    STRICT,
    PositiveDecimal,
    check_affordable,
    positive_numbers,
    setting,
    whole_from,
)

#: Cost ratios of a step with the exact oscillator for the comparison.
CHARGES = (1.0, 1.1, 1.25, 1.5, 2.0)


@dataclass(frozen=True, kw_only=True)
class ExactOscillatorSettings:
    """Energy error against amplitude with the oscillator solved exactly, at equal cost."""

    __pydantic_config__ = STRICT

    integrators: tuple[str, ...] = setting(
        "Methods that solve the oscillator exactly; those of the figures split into T and V",
        "a list of at least one integrator, each named once",
        each="the name of an integrator, or the path of a Python file that defines TABLEAU or TABLEAUS",
        default=("aba104", "aba864", "aba1064", "rnia12", "na7", "trained_exact_light", "trained_exact_fine"),
        min_length=1,
    )
    energies: int = setting(
        "Energies of the Henon-Heiles system from 1/80000 to 1/6, even in the logarithm",
        default=17,
        **whole_from(2, 1000),
    )
    trajectories: int = setting("Quasi-random starts on each energy surface", default=192, **whole_from(1, 10**5))
    t_end: PositiveDecimal = setting("Every run covers [0, t_end]", POSITIVE, unit="1", default="500")
    tau_per_stage: tuple[PositiveDecimal, ...] = positive_numbers(
        "Step sizes divided by the number of stages, equal for all methods", "0.1", "0.05"
    )
    seed: int = setting("Chooses the quasi-random points", default=1, **whole_from(0))

    def check(self, methods: Sequence[Tableau], problems: Collection[str]) -> None:
        """Raise an error for unknown integrators and for too many force evaluations."""
        exact = [integrators[name] for name in expanded(self.integrators)]
        for tableau in exact:
            check_fit(SYSTEM, tableau, EXACT_OSCILLATOR)
        runs = len(methods) + len(CHARGES) * len(exact)
        each = runs * self.energies * sum(float(self.t_end) / float(tau) for tau in self.tau_per_stage)
        check_affordable("exact_oscillator.trajectories", self.trajectories, each)

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods for the exactly solved oscillator, including those from files."""
        return expanded(self.integrators)

    def surfaces(self) -> list[float]:
        """Return the energies from the smallest amplitude to that of escape."""
        return geometric(1 / 80_000, 1 / 6, self.energies)


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
