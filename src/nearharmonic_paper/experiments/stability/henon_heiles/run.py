"""Henon-Heiles ensembles: fraction of escaping trajectories of an energy surface, and errors of the others."""

from __future__ import annotations

from fractions import Fraction
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import Floats
from nearharmonic.numerics.statistics import quasi_random
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.systems.henon_heiles import SYSTEM
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings

#: Box around the triangle whose corners are the saddle points: |x| up to sqrt(3)/2, and y from -1/2 to 1.
_WIDTH, _HEIGHT, _LOWEST = sqrt(3), 1.5, -0.5
#: Number of energy measurements, evenly spaced in time: enough to detect an escape soon.
LOOKS = 25
#: Number of lanes of the kernel: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: Quantiles of the largest |dH/H0| over the ensemble; an escaped trajectory counts as infinite.
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95, 1.0)


class EnsembleResult(NamedTuple):
    """One step size on n energy surfaces."""

    escaped: Floats  # (n,), fraction of the trajectories that left their surface
    quantiles: Floats  # (n, len(QUANTILES)), of the largest |dH/H0| over the measurements
    steps: int  # of a run that does not escape
    evaluations: int  # of the force, all trajectories together


def warm_up() -> dict[str, Contents]:
    """Compile the kernel into the cache; nothing is returned."""
    kernel_of(SYSTEM, Numerics(width=WIDTH, energy="samples"))
    return {}


def henon_heiles_surface(energy: Fraction, count: int, seed: int) -> Floats:
    """Return starts (count, 8) in the layout of the kernel, on the bounded part of the surface H = ``energy``.

    (x, y) is uniform in the area inside the zero-velocity curve, the direction of the momentum uniform on the circle,
    and |p| = sqrt(2 (energy - V)). In two dimensions this is the microcanonical (Liouville) measure, since
    integrating delta(p^2/2 + V - energy) p dp leaves 1 wherever V < energy.
    """
    drawn = 4 * count
    while True:
        u = quasi_random(drawn, 3, seed)
        x, y = (u[:, 0] - 0.5) * _WIDTH, u[:, 1] * _HEIGHT + _LOWEST
        kinetic = float(energy) - SYSTEM.V((x, y))
        # V = 1/6 on the sides of the triangle and larger beyond one side; it is smaller again only outside the box.
        inside = np.flatnonzero(kinetic > 0)
        if inside.size >= count:
            break
        drawn *= 2
    kept = inside[:count]
    momentum, angle = np.sqrt(2 * kinetic[kept]), 2 * np.pi * u[kept, 2]
    starts = np.zeros((count, 8))
    starts[:, 0], starts[:, 1] = x[kept], y[kept]
    starts[:, 4], starts[:, 5] = momentum * cos(angle), momentum * sin(angle)
    return starts


def starts(settings: EnsembleSettings) -> Floats:
    """Return the initial conditions (surfaces * trajectories, 8), surface by surface."""
    surfaces = [henon_heiles_surface(Fraction(e), settings.trajectories, settings.seed) for e in settings.energies]
    return np.concatenate(surfaces)


def schedule(t_end: Fraction, tau: Fraction) -> tuple[int, int]:
    """Return (steps, steps between measurements).

    Measurements are evenly spaced, so that all lanes are synchronous, and a lane is refilled at a measurement. The step
    size is exact, because resonances are narrow; the interval is ``t_end`` or longer by less than one spacing.
    """
    look = max(1, round(t_end / (LOOKS * tau)))
    return look * ceil(t_end / (look * tau)), look


def integrate_ensemble(
    tableau: Tableau, tau: Fraction, t_end: Fraction, start: Floats, surfaces: int
) -> EnsembleResult:
    """Integrate trajectories from ``start`` (surfaces * n, 8), surface by surface, over at least [0, ``t_end``]."""
    steps, look = schedule(t_end, tau)
    paths = integrate_batch(
        SYSTEM, tableau, t_end=steps * tau, steps=np.full(len(start), steps), samples=2,
        numerics=Numerics(width=WIDTH, energy="samples", look=look), start=start,
    )  # fmt: skip
    errors = np.sort(paths.max_energy_error.reshape(surfaces, -1), axis=1)
    ranks = [max(1, ceil(q * errors.shape[1])) - 1 for q in QUANTILES]
    return EnsembleResult(
        escaped=(paths.left_at.reshape(surfaces, -1) > 0).mean(axis=1),
        quantiles=errors[:, ranks],
        steps=steps,
        evaluations=int(paths.evaluations.sum()),
    )


def measure(integrator: str, settings: EnsembleSettings) -> dict[str, Contents]:
    """Return the file ``run``: fraction escaped and energy error of one method over (energy, tau_per_stage)."""
    tableau = integrators[integrator]
    start, grid, t_end = starts(settings), settings.tau_per_stage.grid(), Fraction(settings.t_end)
    rows = [integrate_ensemble(tableau, tau * tableau.stages, t_end, start, len(settings.energies)) for tau in grid]
    over = ("energy", "tau_per_stage")
    looks = f"quantile of the largest |H - H0|/|H0| over {LOOKS} or more evenly spaced instants, inf if escaped"
    escaped, errors, steps, evaluations = zip(*rows, strict=True)
    variables = {
        "escaped": variable(
            over, np.stack(escaped, axis=1), "fraction of the trajectories that left their energy surface"
        ),
        "energy_error": variable((*over, "quantile"), np.stack(errors, axis=1), looks),
        "steps": variable("tau_per_stage", steps, "steps of a run that does not escape"),
        "evaluations": variable("tau_per_stage", evaluations, "force evaluations of all trajectories and surfaces"),
        **coordinate("tau_per_stage", [float(tau) for tau in grid], "step size per stage"),
        **coordinate("energy", [float(Fraction(e)) for e in settings.energies], "energy H0"),
        **coordinate("quantile", list(QUANTILES), "fraction of the trajectories that err less"),
    }
    return {"run": Contents(variables=variables)}
