"""Energy errors of methods on a crystal, the drift of the energy over long runs, and averages with a thermostat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp
from nearharmonic.numerics.compiled import Normal
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Contents, coordinate, variable
from nearharmonic_studies.crystals.settings import TRAINED_ON_CRYSTALS, CrystalsSettings
from nearharmonic_studies.crystals.solids import (
    Solid,
    argon,
    at_rest,
    chain,
    copper,
    halves,
    silicon,
)

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
    methods = [*map(integrators.__getitem__, names), TRAINED_ON_CRYSTALS]
    temperatures, forces = (list(map(float, one)) for one in (settings.temperatures, settings.forces))
    shape = (len(temperatures), len(methods), len(forces), settings.starts)
    errors, deltas = np.empty((2, *shape)), []
    for a, temperature in enumerate(temperatures):
        starts = [start_of(solid, temperature, [settings.seed, a, k]) for k in range(settings.starts)]
        deltas.append(delta(solid, starts[0], settings.seed))
        for b, method in enumerate(methods):
            for c, per_period in enumerate(forces):
                errors[:, a, b, c] = energy_errors(solid, method, per_period, settings.periods, starts)
    over = ("temperature", "integrator", "forces", "start")
    what = "energy error |H - H0| over steps, in units of the mean kinetic energy"
    variables = {
        **coordinate("temperature", temperatures, "temperature over the melting temperature"),
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


def start_of(solid: Solid, temperature: float, seed: list[int]) -> Start:
    """Return a state in equilibrium at a temperature, relative to the melting point, without total momentum.

    Langevin steps from the lattice sites are leapfrog steps around friction and noise, BAOAB: Leimkuhler & Matthews
    (2013), Appl. Math. Res. eXpress 2013, 34.
    """
    energy, tau, n, normal = temperature * solid.melting, solid.period / PER_PERIOD, solid.coordinates, Normal(seed)
    u, p = np.zeros(n), np.sqrt(2 * energy * solid.masses) * normal.rows(1, n)[0]
    keep, average = float(exp(-FRICTION * float(solid.frequencies[-1]) * tau)), np.zeros(2)
    width = np.sqrt((1 - keep * keep) * energy * solid.masses)
    moves, kicks, steps = np.array([tau / 2, tau / 2]), np.array([True, False]), EQUILIBRATION * PER_PERIOD
    for begin in range(0, steps, 64):
        noise = width * normal.rows(min(64, steps - begin), n)
        solid.loops.thermostatted(u, p, solid.masses, moves, kicks, False, keep, noise, average)
    return Start(u, at_rest(p, solid.masses))


def energies(solid: Solid, method: Tableau, tau: float, steps: int, start: Start, every: int = 1) -> Floats:
    """Return kinetic and potential energy (k, 2) at the start and after each ``every`` steps."""
    outer, inner = (tau * np.array(row) for row in method.rows_double())
    found = np.empty((steps // every + 1, 2))
    u, p = start.u.copy(), start.p.copy()
    solid.loops.run(u, p, solid.masses, method.first == "kick", outer, inner, steps, every, found)
    return found


def energy_errors(solid: Solid, method: Tableau, per_period: float, periods: int, starts: Sequence[Start]) -> Floats:
    """Return the maximum and the mean energy error (2, starts) at a number of forces in the fastest period.

    A run covers at least ``periods`` periods; the error of a run that diverges is infinite.
    """
    tau = method.stages * solid.period / per_period
    steps = max(1, round(periods * solid.period / tau))
    found = []
    for start in starts:
        kinetic, potential = energies(solid, method, tau, steps, start).T
        change = np.abs((kinetic - kinetic[0]) + (potential - potential[0]))
        scale = kinetic.mean()
        lost = not np.isfinite(change).all() or not np.isfinite(scale)
        found.append((np.inf, np.inf) if lost else (change.max() / scale, change[1:].mean() / scale))
    return np.array(found).T


def delta(solid: Solid, start: Start, seed: int) -> float:
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
        solid.loops.run(u, p, solid.masses, True, tau * outer, tau * inner, PER_PERIOD, PER_PERIOD, unused)
    varying = products - products.mean(axis=0)
    return float(np.sqrt((varying**2).sum() / (products**2).sum()))


# --- Long runs of small crystals: the drift of the energy, and averages with a thermostat.

#: Cells of the small crystals, and the temperature of all long runs over the melting temperature.
SMALL, TEMPERATURE = {"argon": 2, "copper": 2, "silicon": 1, "chain": 32}, 0.3
#: Forces in the fastest period in the runs that measure the drift, and looks at the energy in each.
FORCES, LOOKS = 20.0, 500
#: Forces in the fastest period of the thermostatted runs, places of friction and noise, and the friction over the
#: highest frequency.
SPACINGS, BATHS, BATH_FRICTION = (20.0, 14.0, 10.0, 7.0, 5.0), ("middle", "ends"), 0.1
#: Blocks that give the standard error, blocks before them, and steps whose noise is made at once.
BLOCKS, WARM, AT_ONCE = 32, 4, 2048


def drift(crystal: str, names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Return ``run``: ``energy`` over (method, start, look) of a small crystal, in units of the mean kinetic energy."""
    solid = SOLIDS[crystal](SMALL[crystal])
    starts = [start_of(solid, TEMPERATURE, [settings.seed, 100, k]) for k in range(settings.drift_starts)]
    steps = max(LOOKS, settings.drift_steps)
    found: list[list[Floats]] = []
    for method in map(integrators.__getitem__, names):
        found.append([])
        for start in starts:
            tau, kept = method.stages * solid.period / FORCES, steps - steps % LOOKS
            kinetic, potential = energies(solid, method, tau, kept, start, steps // LOOKS).T
            found[-1].append(((kinetic - kinetic[0]) + (potential - potential[0])) / kinetic.mean())
    variables = {
        **coordinate("drifting", list(names), "integrator"),
        **coordinate("look", [k * (steps // LOOKS) for k in range(LOOKS + 1)], "steps"),
        "drifting_label": variable("drifting", [integrators[name].label for name in names], "name in the paper"),
        "energy": variable(("drifting", "run", "look"), found, "H - H0 in units of the mean kinetic energy"),
    }
    return {"run": Contents(variables=variables, coordinates=("drifting_label",), attributes={"crystal": crystal})}


def averages(names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Return ``run``: blocks of mean potential and kinetic energy of a chain with friction and noise.

    They act in the middle of each step, where leapfrog is BAOAB, or over half the step at both ends. Each run has the
    same number of forces.
    """
    solid = SOLIDS["chain"](SMALL["chain"])
    runs = [
        _blocks(solid, integrators[name], forces, place == "ends", settings)
        for place in BATHS
        for name in names
        for forces in SPACINGS
    ]
    found = np.reshape(runs, (len(BATHS), len(names), len(SPACINGS), BLOCKS, 2))
    what = "energy over its value for a harmonic crystal, mean of a block"
    over = ("bath", "averaged", "spacing", "block")
    variables: dict[str, Any] = {
        **coordinate("bath", list(BATHS), "place of friction and noise in a step"),
        **coordinate("averaged", list(names), "integrator"),
        **coordinate("spacing", list(SPACINGS), "forces in a period of the fastest phonon"),
        "averaged_label": variable("averaged", [integrators[name].label for name in names], "name in the paper"),
        "potential": variable(over, found[..., 0], f"potential {what}"),
        "kinetic": variable(over, found[..., 1], f"kinetic {what}"),
    }
    return {"run": Contents(variables=variables, coordinates=("averaged_label",))}


def _blocks(solid: Solid, method: Tableau, forces: float, ends: bool, settings: CrystalsSettings) -> Floats:
    """Return the blocks (b, 2) of potential and kinetic energy, over (n - 1) k_B T / 2 and n k_B T / 2.

    The chain as a whole has kinetic energy and no potential energy.
    """
    energy, tau = TEMPERATURE * solid.melting, method.stages * solid.period / forces
    (moves, kicks), rows, n = halves(method, tau), 2 if ends else 1, solid.coordinates
    keep = float(exp(-BATH_FRICTION * float(solid.frequencies[-1]) * tau / rows))
    width, normal = np.sqrt((1 - keep * keep) * energy * solid.masses), Normal([settings.seed, 200])
    u, p = np.zeros(n), np.sqrt(2 * energy * solid.masses) * normal.rows(1, n)[0]
    steps = max(1, settings.average_forces // (BLOCKS * method.stages))
    found = np.zeros((BLOCKS + WARM, 2))
    for block in found:
        for begin in range(0, steps, AT_ONCE):
            noise = width * normal.rows(rows * min(AT_ONCE, steps - begin), n)
            solid.loops.thermostatted(u, p, solid.masses, moves, kicks, ends, keep, noise, block)
    return found[WARM:] / (steps * np.array([n - 1, n]) * energy / 2)
