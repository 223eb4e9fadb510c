"""Long runs of small crystals, which show the drift of the energy, and averages with a thermostat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp
from nearharmonic.numerics.types import Floats
from nearharmonic.output.dataset import Contents, coordinate, variable
from nearharmonic.reproduction.experiments.crystals.dynamics import Loops, Normal, halves, loops_for
from nearharmonic.reproduction.experiments.crystals.run import SOLIDS, Start, energies, start_of
from nearharmonic.reproduction.experiments.crystals.settings import CrystalsSettings
from nearharmonic.reproduction.experiments.crystals.solids.solid import Solid

#: Cells of the small crystals, and the temperature of all long runs over that of the melting point.
SMALL, TEMPERATURE = {"argon": 2, "copper": 2, "silicon": 1, "chain": 32}, 0.3
#: Forces in the fastest period in the runs that measure the drift, and looks at the energy in each.
FORCES, LOOKS = 20.0, 500
#: Forces in the fastest period of the thermostatted runs, the friction over the highest frequency, blocks that give the
#: standard error, and steps whose noise is made at once.
SPACINGS, FRICTION, BLOCKS, AT_ONCE = (20.0, 14.0, 10.0, 7.0, 5.0), 0.1, 32, 2048


def drift(crystal: str, names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Return ``run``: ``energy`` over (method, start, look) of a small crystal, in units of the mean kinetic energy."""
    solid = SOLIDS[crystal](SMALL[crystal])
    loops = loops_for(solid.gradient)
    starts = [start_of(solid, loops, TEMPERATURE, [settings.seed, 100, k]) for k in range(settings.drift_starts)]
    steps = max(LOOKS, settings.drift_steps)
    found = [[_changes(solid, loops, integrators[name], steps, start) for start in starts] for name in names]
    variables = {
        **coordinate("drifting", list(names), "integrator"),
        **coordinate("look", [k * (steps // LOOKS) for k in range(LOOKS + 1)], "steps"),
        "drifting_label": variable("drifting", [integrators[name].label for name in names], "name in the paper"),
        "energy": variable(("drifting", "run", "look"), found, "H - H0 in units of the mean kinetic energy"),
    }
    return {"run": Contents(variables=variables, coordinates=("drifting_label",), attributes={"crystal": crystal})}


def _changes(solid: Solid, loops: Loops, method: Tableau, steps: int, start: Start) -> Floats:
    tau = method.stages * solid.period / FORCES
    kinetic, potential = energies(solid, loops, method, tau, steps - steps % LOOKS, start, steps // LOOKS).T
    return ((kinetic - kinetic[0]) + (potential - potential[0])) / kinetic.mean()


def averages(names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Return ``run``: blocks of mean potential and kinetic energy of a chain with friction and noise.

    Methods apply the first half of their step, friction and noise over the whole step, and the second half; leapfrog is
    BAOAB. Each run has the same number of forces.
    """
    solid = SOLIDS["chain"](SMALL["chain"])
    loops = loops_for(solid.gradient)
    found = np.array([
        [_blocks(solid, loops, integrators[name], forces, settings) for forces in SPACINGS] for name in names
    ])  # fmt: skip
    what = "energy over its value for a harmonic crystal, mean of a block"
    over = ("averaged", "spacing", "block")
    variables: dict[str, Any] = {
        **coordinate("averaged", list(names), "integrator"),
        **coordinate("spacing", list(SPACINGS), "forces in a period of the fastest phonon"),
        "averaged_label": variable("averaged", [integrators[name].label for name in names], "name in the paper"),
        "potential": variable(over, found[..., 0], f"potential {what}"),
        "kinetic": variable(over, found[..., 1], f"kinetic {what}"),
    }
    return {"run": Contents(variables=variables, coordinates=("averaged_label",))}


def _blocks(solid: Solid, loops: Loops, method: Tableau, forces: float, settings: CrystalsSettings) -> Floats:
    """Return the blocks (b, 2) of potential and kinetic energy, over n k_B T / 2 each."""
    energy, tau = TEMPERATURE * solid.melting, method.stages * solid.period / forces
    moves, kicks = halves(method, tau)
    keep = float(exp(-FRICTION * float(solid.frequencies[-1]) * tau))
    width, normal = np.sqrt((1 - keep * keep) * energy * solid.masses), Normal([settings.seed, 200])
    u, p = np.zeros(solid.coordinates), np.sqrt(2 * energy * solid.masses) * normal.rows(1, solid.coordinates)[0]
    steps = max(1, settings.average_forces // (BLOCKS * method.stages))
    found = np.zeros((BLOCKS + 4, 2))
    for block in found:
        for begin in range(0, steps, AT_ONCE):
            noise = width * normal.rows(min(AT_ONCE, steps - begin), solid.coordinates)
            loops.thermostatted(u, p, solid.masses, moves, kicks, keep, noise, block)
    return found[4:] / (steps * solid.coordinates * energy / 2)  # the first four blocks equilibrate
