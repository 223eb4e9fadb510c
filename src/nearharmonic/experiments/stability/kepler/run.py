"""Kepler maps: energy error, spurious perihelion advance and loss of the orbit over eccentricity and step size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.coefficients import Floats
from nearharmonic.engine.geometric import decades, geometric
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.portable import dot, log10
from nearharmonic.engine.results import Integers, Trajectories
from nearharmonic.engine.settings import Numerics
from nearharmonic.experiments.stability.initial_conditions import kepler_apoapsis
from nearharmonic.experiments.stability.settings import MapSettings
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp, log
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.systems.kepler import SYSTEM as MERCURY
from nearharmonic.systems.kepler import perihelion_angle
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.system import System

#: The Kepler problem in units of the orbit: GM = 1 and semi-major axis 1, so H = -1/2 and the period is 2 pi.
SYSTEM: System = replace(
    MERCURY,
    parameters={"GM": Parameter(value="1", unit="1", meaning="gravitational constant times mass, the unit")},
    units=dict.fromkeys(("q", "p", "t", "energy"), "1"),
)
PERIOD = Fraction(2 * pi)
#: Lanes of the kernel: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: An orbit whose energy error is below this at two step sizes running is not run at smaller ones.
FLOOR = 1e-10
#: The energy error whose contour is drawn and tabulated.
CONTOUR = 1e-6


def warm_up() -> dict[str, Contents]:
    """Compile the kernel into the cache; nothing is returned."""
    kernel_of(SYSTEM, Numerics(width=WIDTH))
    return {}


def measure(integrator: str, settings: MapSettings) -> dict[str, Contents]:
    """Return the contents of the file ``run``, :func:`orbit_map` of the method named ``integrator``."""
    return {"run": orbit_map(integrators[integrator], settings)}


def eccentricities(settings: MapSettings) -> Floats:
    """Return 0 to the highest, evenly in log(1 - e): what changes is the distance of the perihelion, 1 - e."""
    distances = geometric(1.0, 1.0 - settings.highest_eccentricity, settings.eccentricities)
    return 1.0 - np.array(distances)


def evaluations_grid(settings: MapSettings) -> Floats:
    """Return the force evaluations per orbit asked for, fewest first, evenly in the logarithm."""
    grid = settings.evaluations_per_orbit
    points = int(log10(grid.highest / grid.lowest) * grid.points_per_decade + 1e-9) + 1
    return np.array(decades(grid.lowest, points, grid.points_per_decade), dtype=float)


def steps_per_orbit(settings: MapSettings, stages: int) -> Integers:
    """Return the whole numbers of steps a period nearest to the grid: then all samples are a period apart."""
    return np.maximum(1, np.rint(evaluations_grid(settings) / stages)).astype(np.int64)


def orbit_runs(tableau: Tableau, steps: int, orbits: int, eccentricity: Floats) -> Trajectories:
    """Integrate orbits from their apoapsis, sampled once a period.

    Parameters
    ----------
    tableau : Tableau
        The method.
    steps : int
        Steps to a period.
    orbits : int
        Periods of each run.
    eccentricity : array of shape (n,)
        Eccentricity of each orbit.
    """
    return integrate_batch(
        SYSTEM, tableau, t_end=orbits * PERIOD, steps=np.full(eccentricity.size, orbits * steps), samples=orbits + 1,
        numerics=Numerics(width=WIDTH), start=kepler_apoapsis(eccentricity),
    )  # fmt: skip


def perihelion_advance(q: Floats, p: Floats) -> Floats:
    """Return the mean rotation per sample (rad) of the Laplace-Runge-Lenz vector of n orbits, by least squares.

    Parameters
    ----------
    q, p : array of shape (n, samples, 2)
        States of each orbit.

    Returns
    -------
    array of shape (n,)
        NaN where a sample is missing or where the vector turns by more than a quarter turn between two samples, which
        tells a rotation from its opposite no longer.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = perihelion_angle((q[..., 0], q[..., 1]), (p[..., 0], p[..., 1]), 1.0)
    turns = np.diff(angle, axis=1)
    turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
    turns[np.abs(turns) > np.pi / 2] = np.nan
    path = np.concatenate([np.zeros((len(turns), 1)), np.cumsum(turns, axis=1)], axis=1)
    index = np.arange(path.shape[1]) - (path.shape[1] - 1) / 2
    return np.array([dot(row, index) for row in path]) / dot(index, index)


def _columns(tableau: Tableau, settings: MapSettings) -> Iterator[tuple[int, Integers, Trajectories]]:
    """(steps per orbit, indices of the orbits run, their runs), coarse steps first, as long as an orbit is needed."""
    grid = eccentricities(settings)
    below = np.zeros(grid.size, dtype=np.int64)
    for steps in np.unique(steps_per_orbit(settings, tableau.stages)).tolist():
        needed = np.flatnonzero(below < 2)
        if not needed.size:
            return
        paths = orbit_runs(tableau, steps, settings.orbits, grid[needed])
        below[needed] = np.where(paths.max_energy_error < FLOOR, below[needed] + 1, 0)
        yield steps, needed, paths


def orbit_map(tableau: Tableau, settings: MapSettings) -> Contents:
    """Return what becomes of each orbit under one method, over (tau_per_stage, eccentricity), step sizes in periods.

    ``energy_error`` is infinite where the orbit was lost and NaN where it was not run, being below :data:`FLOOR` at
    two coarser step sizes; ``orbits_kept`` is NaN there too. Step sizes that round to the same number of steps a
    period are one and the same computation.
    """
    grid = eccentricities(settings)
    distinct, where = np.unique(steps_per_orbit(settings, tableau.stages), return_inverse=True)
    error, advance, kept = (np.full((distinct.size, grid.size), np.nan) for _ in range(3))
    evaluations = np.zeros(distinct.size, dtype=np.int64)
    for i, (steps, orbits, paths) in enumerate(_columns(tableau, settings)):
        error[i, orbits] = paths.max_energy_error
        kept[i, orbits] = np.where(paths.left_at > 0, paths.left_at / steps, settings.orbits)
        rotation = np.where(paths.left_at > 0, np.nan, perihelion_advance(paths.q, paths.p))
        advance[i, orbits] = np.where(grid[orbits] > 0, rotation, np.nan)  # a circle has no perihelion
        evaluations[i] = paths.evaluations.sum()
    contour = evaluations_below(distinct * float(tableau.stages), error, CONTOUR)
    tau, over = "tau_per_stage", ("tau_per_stage", "eccentricity")
    largest = "maximum of |H - H0|/|H0| over every step, inf if the orbit is lost"
    turned = "rotation of the Laplace-Runge-Lenz vector per orbit"
    below = f"force evaluations per orbit from which on the energy error stays below {CONTOUR:g}"
    return Contents(
        variables={
            "energy_error": variable(over, error[where], largest),
            "perihelion_advance": variable(over, advance[where], turned, "rad"),
            "orbits_kept": variable(over, kept[where], "periods until |H - H0| = |H0|, or all if it never is"),
            "steps_per_orbit": variable(tau, distinct[where], "steps per period of the exact orbit"),
            "evaluations": variable(tau, evaluations[where], "force evaluations of the orbits run, all eccentricities"),
            "evaluations_for_contour": variable("eccentricity", contour, below),
            **coordinate(tau, 1 / evaluations_grid(settings), "step size per stage asked for", "period"),
            **coordinate("eccentricity", grid, "eccentricity of the exact orbit"),
        }
    )


def evaluations_below(evaluations: NDArray[Any], error: Floats, level: float) -> Floats:
    """Return the number of evaluations at which each column of ``error`` falls below ``level`` for good.

    Parameters
    ----------
    evaluations : array of shape (n,)
        Ascending.
    error : array of shape (n, m)
        NaN where nothing was run, which counts as below.
    level : float
        Above 0.

    Returns
    -------
    array of shape (m,)
        Interpolated in the logarithms; NaN where the error never falls below for good.
    """
    found = np.full(error.shape[1], np.nan)
    for column in range(error.shape[1]):
        above = np.flatnonzero(error[:, column] >= level)
        last = above[-1] if above.size else len(evaluations)
        if last + 1 >= len(evaluations):
            continue
        (x0, x1), (y0, y1) = log(evaluations[last : last + 2]), log(error[last : last + 2, column])
        inside = np.isfinite([y0, y1]).all()
        found[column] = exp(x0 + (x1 - x0) * (y0 - log(level)) / (y0 - y1)) if inside else exp(x1)
    return found
