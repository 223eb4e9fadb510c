"""Kepler maps: states, energy error and loss of the orbit over eccentricity and step size."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from math import pi

import numpy as np

from nearharmonic.engine.batch import integrate_batch
from nearharmonic.engine.execution import Trajectories
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import cos, sin
from nearharmonic.numerics.portable import Floats, Integers, decades, geometric, log10
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.systems.kepler import SYSTEM as MERCURY
from nearharmonic.systems.quantities import Parameter
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.stability.settings import MapSettings

#: The Kepler problem in units of the orbit: GM = 1 and semi-major axis 1, so H = -1/2 and the period is 2 pi.
SYSTEM: System = replace(
    MERCURY,
    parameters={"GM": Parameter(value="1", unit="1", meaning="gravitational constant times mass, the unit")},
    units=dict.fromkeys(("q", "p", "t", "energy"), "1"),
)
PERIOD = Fraction(2 * pi)
#: Number of lanes of the kernel: two AVX-512 registers, which hide each other's latency.
WIDTH = 16
#: Energy error: an orbit with smaller errors at two successive step sizes is not run at smaller step sizes.
FLOOR = 1e-10


def warm_up() -> dict[str, Contents]:
    """Compile the kernel into the cache; nothing is returned."""
    kernel_of(SYSTEM, Numerics(width=WIDTH))
    return {}


def eccentricities(settings: MapSettings) -> Floats:
    """Return eccentricities from 0 to the highest, evenly spaced in the log of the perihelion distance 1 - e."""
    distances = geometric(1.0, 1.0 - settings.highest_eccentricity, settings.eccentricities)
    return 1.0 - np.array(distances)


def evaluations_grid(settings: MapSettings) -> Floats:
    """Return the requested force evaluations per orbit, ascending and evenly spaced in the logarithm."""
    grid = settings.evaluations_per_orbit
    points = int(log10(grid.highest / grid.lowest) * grid.points_per_decade + 1e-9) + 1
    return np.array(decades(grid.lowest, grid.points_per_decade, 0, points), dtype=float)


def steps_per_orbit(settings: MapSettings, stages: int) -> Integers:
    """Return the integer numbers of steps per period nearest to the grid, so that all samples are one period apart."""
    return np.maximum(1, np.rint(evaluations_grid(settings) / stages)).astype(np.int64)


def orbit_runs(tableau: Tableau, steps: int, orbits: int, eccentricity: Floats) -> Trajectories:
    """Integrate orbits of ``eccentricity`` (n,) from their apoapsis, ``steps`` a period, sampled once a period."""
    return integrate_batch(
        SYSTEM, tableau, t_end=orbits * PERIOD, steps=np.full(eccentricity.size, orbits * steps), samples=orbits + 1,
        numerics=Numerics(width=WIDTH), start=kepler_apoapsis(eccentricity),
    )  # fmt: skip


def _columns(tableau: Tableau, settings: MapSettings) -> Iterator[tuple[int, Integers, Trajectories]]:
    """Yield (steps per orbit, indices of the orbits, their runs), coarse steps first, while any orbit is needed."""
    grid = eccentricities(settings)
    below = np.zeros(grid.size, dtype=np.int64)
    for steps in np.unique(steps_per_orbit(settings, tableau.stages)).tolist():
        needed = np.flatnonzero(below < 2)
        if not needed.size:
            return
        paths = orbit_runs(tableau, steps, settings.orbits, grid[needed])
        below[needed] = np.where(paths.max_energy_error < FLOOR, below[needed] + 1, 0)
        yield steps, needed, paths


def measure(integrator: str, settings: MapSettings) -> dict[str, Contents]:
    """Return the file ``run``: orbits under one method, over (tau_per_stage, eccentricity), step sizes in periods.

    ``energy_error`` is infinite for a lost orbit. It is NaN for an orbit that was not run, because its error is below
    :data:`FLOOR` at two coarser step sizes; ``orbits_kept``, ``q`` and ``p`` are NaN there too. Step sizes that round
    to the same number of steps per period share one computation.
    """
    tableau, grid = integrators[integrator], eccentricities(settings)
    distinct, where = np.unique(steps_per_orbit(settings, tableau.stages), return_inverse=True)
    shape = (distinct.size, grid.size)
    error, kept = np.full(shape, np.nan), np.full(shape, np.nan)
    q, p = (np.full((*shape, settings.orbits + 1, SYSTEM.dimension), np.nan) for _ in range(2))
    evaluations = np.zeros(distinct.size, dtype=np.int64)
    for i, (steps, orbits, paths) in enumerate(_columns(tableau, settings)):
        error[i, orbits], q[i, orbits], p[i, orbits] = paths.max_energy_error, paths.q, paths.p
        kept[i, orbits] = np.where(paths.left_at > 0, paths.left_at / steps, settings.orbits)
        evaluations[i] = paths.evaluations.sum()
    tau, over = "tau_per_stage", ("tau_per_stage", "eccentricity")
    states = (*over, "sample", "component")
    largest = "maximum of |H - H0|/|H0| over every step, inf if the orbit is lost"
    variables = {
        "q": variable(states, q[where], "position, once a period; the semi-major axis is 1"),
        "p": variable(states, p[where], "momentum, once a period; GM is 1"),
        "energy_error": variable(over, error[where], largest),
        "orbits_kept": variable(over, kept[where], "periods until |H - H0| = |H0|, or all if it never is"),
        "steps_per_orbit": variable(tau, distinct[where], "steps per period of the exact orbit"),
        "evaluations": variable(tau, evaluations[where], "force evaluations of the orbits run, all eccentricities"),
        **coordinate(tau, 1 / evaluations_grid(settings), "step size per stage asked for", "period"),
        **coordinate("eccentricity", grid, "eccentricity of the exact orbit"),
    }
    return {"run": Contents(variables=variables)}


def kepler_apoapsis(eccentricity: Floats, orientation: Floats | float = 0.0) -> Floats:
    """Return starts (n, 8) in the layout of the kernel, at the apoapsis of orbits of semi-major axis 1 with GM = 1.

    ``eccentricity`` (n,) is at least 0 and below 1; ``orientation``, (n,) or one for all, is the direction from the
    centre to the apoapsis in rad.
    """
    e = eccentricity
    cosine, sine = cos(orientation), sin(orientation)
    distance, speed = 1 + e, np.sqrt((1 - e) / (1 + e))
    starts = np.zeros((e.size, 8))
    starts[:, 0], starts[:, 1] = distance * cosine, distance * sine
    starts[:, 4], starts[:, 5] = -speed * sine, speed * cosine
    return starts
