"""Long runs of small crystals, which show the drift of the energy, and averages with a thermostat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp
from nearharmonic.numerics.compiled import Normal
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Contents, coordinate, variable
from nearharmonic_studies.crystals.dynamics import Loops, halves, loops_for
from nearharmonic_studies.crystals.run import SOLIDS, Start, energies, start_of
from nearharmonic_studies.crystals.settings import CrystalsSettings
from nearharmonic_studies.crystals.solids import Solid

#: Cells of the small crystals, and the temperature of all long runs over that of the melting point.
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
    change: Floats = ((kinetic - kinetic[0]) + (potential - potential[0])) / kinetic.mean()
    return change


def averages(names: Sequence[str], settings: CrystalsSettings) -> dict[str, Contents]:
    """Return ``run``: blocks of mean potential and kinetic energy of a chain with friction and noise.

    They act in the middle of each step, where leapfrog is BAOAB, or over half the step at both ends. Each run has the
    same number of forces.
    """
    solid = SOLIDS["chain"](SMALL["chain"])
    loops = loops_for(solid.gradient)
    runs = [
        _blocks(solid, loops, integrators[name], forces, place == "ends", settings)
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


def _blocks(
    solid: Solid, loops: Loops, method: Tableau, forces: float, ends: bool, settings: CrystalsSettings
) -> Floats:
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
            loops.thermostatted(u, p, solid.masses, moves, kicks, ends, keep, noise, block)
    return found[WARM:] / (steps * np.array([n - 1, n]) * energy / 2)
