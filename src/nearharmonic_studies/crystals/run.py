"""Energy errors of methods on a crystal, the drift of the energy, and how far from harmonic the crystal is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.compiled import Normal
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Contents, coordinate, variable
from nearharmonic_studies.crystals.dynamics import Loops, equilibrated, loops_for
from nearharmonic_studies.crystals.settings import TRAINED_ON_CRYSTALS, CrystalsSettings
from nearharmonic_studies.crystals.solids import Solid, argon, chain, copper, silicon

SOLIDS: dict[str, Callable[[int], Solid]] = {"argon": argon, "copper": copper, "silicon": silicon, "chain": chain}
#: Equilibration: steps of the fastest period over 20, friction of a twentieth of the highest frequency, and periods.
PER_PERIOD, FRICTION, EQUILIBRATION = 20, 0.05, 200
#: Hessians along a trajectory: their number, the periods between two of them, which is no simple fraction of one, and
#: the random vectors that estimate their norms.
HESSIANS, BETWEEN, VECTORS = 33, 0.77, 8
#: Displacement of the difference that multiplies the Hessian by a vector, in units of length.
DIFFERENCE = 1e-4


class Start(NamedTuple):
    """An equilibrated state of a crystal."""

    u: Floats
    p: Floats


def measure(crystal: str, names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Integrate a crystal from all starts with the methods of these names, and with that trained on model crystals.

    The result has ``run``: ``max_energy_error`` and ``mean_energy_error`` over (temperature, integrator, forces,
    start), in units of the mean kinetic energy; ``delta`` over temperature; ``frequency`` over mode.
    """
    solid = SOLIDS[crystal](settings.size(crystal))
    loops, methods = loops_for(solid.gradient), [*map(integrators.__getitem__, names), TRAINED_ON_CRYSTALS]
    temperatures, forces = (list(map(float, one)) for one in (settings.temperatures, settings.forces))
    shape = (len(temperatures), len(methods), len(forces), settings.starts)
    errors, deltas = np.empty((2, *shape)), []
    for a, temperature in enumerate(temperatures):
        starts = [start_of(solid, loops, temperature, [settings.seed, a, k]) for k in range(settings.starts)]
        deltas.append(delta(solid, loops, starts[0], settings.seed))
        for b, method in enumerate(methods):
            for c, per_period in enumerate(forces):
                errors[:, a, b, c] = energy_errors(solid, loops, method, per_period, settings.periods, starts)
    over = ("temperature", "integrator", "forces", "start")
    what = "energy error |H - H0| over steps, in units of the mean kinetic energy"
    variables = {
        **coordinate("temperature", temperatures, "temperature over that of the melting point"),
        **coordinate("integrator", [one.name for one in methods], "integrator"),
        **coordinate("forces", forces, "forces in a period of the fastest phonon"),
        "label": variable("integrator", [one.label for one in methods], "name in the paper"),
        "max_energy_error": variable(over, errors[0], f"maximum {what}"),
        "mean_energy_error": variable(over, errors[1], f"mean {what}"),
        "delta": variable("temperature", deltas, "variation of the Hessian, rms |W - mean W| / rms |W|"),
        "frequency": variable("mode", solid.frequencies, "angular frequency of each phonon at rest"),
    }
    attributes = {
        "crystal": crystal, "crystal_label": solid.label, "coordinates": solid.coordinates, "period": solid.period,
        "unit_of_time_fs": solid.unit, "melting": solid.melting, "source": solid.source,
    }  # fmt: skip
    return {"run": Contents(variables=variables, coordinates=("label",), attributes=attributes)}


def start_of(solid: Solid, loops: Loops, temperature: float, seed: list[int]) -> Start:
    """Return a state in equilibrium at a temperature, relative to that of the melting point."""
    return Start(
        *equilibrated(
            loops, solid.masses, temperature * solid.melting, solid.period / PER_PERIOD, EQUILIBRATION * PER_PERIOD,
            FRICTION * float(solid.frequencies[-1]), Normal(seed),
        )
    )  # fmt: skip


def energies(
    solid: Solid, loops: Loops, method: Tableau, tau: float, steps: int, start: Start, every: int = 1
) -> Floats:
    """Return kinetic and potential energy (k, 2) at the start and after each ``every`` steps."""
    outer, inner = (tau * np.array(row) for row in method.rows_double())
    found = np.empty((steps // every + 1, 2))
    u, p = start.u.copy(), start.p.copy()
    loops.run(u, p, solid.masses, method.first == "kick", outer, inner, steps, every, found)
    return found


def energy_errors(
    solid: Solid, loops: Loops, method: Tableau, per_period: float, periods: int, starts: Sequence[Start]
) -> Floats:
    """Return the maximum and the mean energy error (2, starts) at a number of forces in the fastest period.

    A run covers at least ``periods`` periods; the error of a run that diverges is infinite.
    """
    tau = method.stages * solid.period / per_period
    steps = max(1, round(periods * solid.period / tau))
    found = []
    for start in starts:
        kinetic, potential = energies(solid, loops, method, tau, steps, start).T
        change = np.abs((kinetic - kinetic[0]) + (potential - potential[0]))
        scale = kinetic.mean()
        lost = not np.isfinite(change).all() or not np.isfinite(scale)
        found.append((np.inf, np.inf) if lost else (change.max() / scale, change[1:].mean() / scale))
    return np.array(found).T


def delta(solid: Solid, loops: Loops, start: Start, seed: int) -> float:
    """Return the variation of the Hessian W along a trajectory, rms |W - mean W| / rms |W|, |.| the Frobenius norm.

    Norms are means of |W z|^2 over vectors z of random signs. Products W z are differences of gradients, between
    coordinates scaled by the square roots of the masses.
    """
    n, roots = solid.coordinates, np.sqrt(solid.masses)
    signs = np.where(np.random.default_rng(seed).random((VECTORS, n)) < 0.5, -1.0, 1.0)
    outer, inner = np.array([0.5, 0.5]), np.array([1.0])
    tau = solid.period * BETWEEN / PER_PERIOD
    u, p, unused = start.u.copy(), start.p.copy(), np.empty((2, 2))
    products = np.empty((HESSIANS, VECTORS, n))
    above, below = np.empty(n), np.empty(n)
    for k in range(HESSIANS):
        for m, z in enumerate(signs):
            solid.gradient(u + DIFFERENCE * z / roots, above)
            solid.gradient(u - DIFFERENCE * z / roots, below)
            products[k, m] = (above - below) / (2 * DIFFERENCE) / roots
        loops.run(u, p, solid.masses, True, tau * outer, tau * inner, PER_PERIOD, PER_PERIOD, unused)
    varying = products - products.mean(axis=0)
    return float(np.sqrt((varying**2).sum() / (products**2).sum()))
