"""Kepler maps: energy error, spurious perihelion advance and loss of the orbit over eccentricity and step size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.batch import Floats, Integers, Trajectories, integrate_batch, kernel_of
from nearharmonic.stability.initial_conditions import kepler_apoapsis
from nearharmonic.stability.settings import MapSettings
from nearharmonic.systems import systems
from nearharmonic.systems.kepler import perihelion_angle
from nearharmonic.systems.system import Parameter, System
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

#: The Kepler problem in units of the orbit: GM = 1 and semi-major axis 1, so H = -1/2 and the period is 2 pi.
SYSTEM: System = replace(
    systems["kepler"],
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


def warm_up() -> None:
    """Compile the kernel into the cache."""
    kernel_of(SYSTEM, "double", "compensated", WIDTH, True)


def eccentricities(settings: MapSettings) -> Floats:
    """From 0 to the highest, evenly in log(1 - e): what changes is the distance of the perihelion, 1 - e."""
    fractions = np.linspace(0.0, 1.0, settings.eccentricities)
    return np.asarray(1.0 - (1.0 - settings.highest_eccentricity) ** fractions)


def evaluations_grid(settings: MapSettings) -> Floats:
    """Force evaluations per orbit asked for, fewest first, evenly in the logarithm."""
    points = int(np.log10(settings.most / settings.fewest) * settings.points_per_decade + 1e-9) + 1
    return np.asarray(settings.fewest * 10.0 ** (np.arange(points) / settings.points_per_decade))


def steps_per_orbit(settings: MapSettings, stages: int) -> Integers:
    """The whole numbers of steps a period nearest to the grid, at least 1: then all samples are a period apart."""
    return np.maximum(1, np.rint(evaluations_grid(settings) / stages)).astype(np.int64)


def orbit_runs(tableau: Tableau, steps: int, orbits: int, eccentricity: Floats) -> Trajectories:
    """``orbits`` periods from the apoapsis of each orbit (n,), ``steps`` to a period, sampled once a period."""
    return integrate_batch(
        SYSTEM, tableau, t_end=orbits * PERIOD, steps=np.full(eccentricity.size, orbits * steps), samples=orbits + 1,
        width=WIDTH, start=kepler_apoapsis(eccentricity),
    )  # fmt: skip


def perihelion_advance(q: Floats, p: Floats) -> Floats:
    """Mean rotation per sample (rad) of the Laplace-Runge-Lenz vector over states (n, samples, 2), by least squares.

    NaN where a sample is missing or where it turns by more than a quarter turn between two samples, which tells a
    rotation from its opposite no longer.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = perihelion_angle((q[..., 0], q[..., 1]), (p[..., 0], p[..., 1]), 1.0)
    turns = np.diff(angle, axis=1)
    turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
    turns[np.abs(turns) > np.pi / 2] = np.nan
    path = np.concatenate([np.zeros((len(turns), 1)), np.cumsum(turns, axis=1)], axis=1)
    index = np.arange(path.shape[1]) - (path.shape[1] - 1) / 2
    return np.asarray((path @ index) / (index @ index))


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


def run(tableau: Tableau, settings: MapSettings) -> xr.Dataset:
    """What becomes of each orbit under one method, over (tau_per_stage, eccentricity), step sizes in periods.

    ``energy_error`` is infinite where the orbit was lost and NaN where it was not run, being below :data:`FLOOR` at
    two coarser step sizes; ``orbits_kept`` is NaN there too. Step sizes that round to the same number of steps a
    period are one and the same computation.
    """
    import xarray as xr

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
    table = {
        "energy_error": (error[where], "1", "maximum of |H - H0|/|H0| over every step, inf if the orbit is lost"),
        "perihelion_advance": (advance[where], "rad", "rotation of the Laplace-Runge-Lenz vector per orbit"),
        "orbits_kept": (kept[where], "1", "periods until |H - H0| = |H0|, or all if it never is"),
        "steps_per_orbit": (distinct[where], "1", "steps per period of the exact orbit"),
        "evaluations": (evaluations[where], "1", "force evaluations of the orbits run, all eccentricities"),
    }
    dims = ("tau_per_stage", "eccentricity")
    note = f"force evaluations per orbit from which on the energy error stays below {CONTOUR:g}"
    coordinates = {
        "tau_per_stage": (1 / evaluations_grid(settings), "period", "step size per stage asked for"),
        "eccentricity": (grid, "1", "eccentricity of the exact orbit"),
    }
    return xr.Dataset(
        {k: (dims[: v.ndim], v, {"units": u, "long_name": text}) for k, (v, u, text) in table.items()}
        | {"evaluations_for_contour": (("eccentricity",), contour, {"units": "1", "long_name": note})},
        coords={k: (k, v, {"units": u, "long_name": text}) for k, (v, u, text) in coordinates.items()},
    )


def evaluations_below(evaluations: NDArray[Any], error: Floats, level: float) -> Floats:
    """Number of evaluations at which each column of ``error`` (n, m) falls below ``level`` for good.

    ``evaluations`` (n,) ascend. Interpolated in the logarithms; NaN if it never does. What was not run counts as below.
    """
    found = np.full(error.shape[1], np.nan)
    for column in range(error.shape[1]):
        above = np.flatnonzero(error[:, column] >= level)
        last = above[-1] if above.size else len(evaluations)
        if last + 1 >= len(evaluations):
            continue
        (x0, x1), (y0, y1) = np.log(evaluations[last : last + 2]), np.log(error[last : last + 2, column])
        inside = np.isfinite([y0, y1]).all()
        found[column] = np.exp(x0 + (x1 - x0) * (y0 - np.log(level)) / (y0 - y1)) if inside else np.exp(x1)
    return found
