"""The ensembles of the proof: random potentials by band of strength, systems with names, Kepler orbits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from nearharmonic.numerics.types import Floats
from nearharmonic.reproduction.experiments.trained.problems.anharmonicity import with_anharmonicity
from nearharmonic.reproduction.experiments.trained.problems.named_systems import named_ensembles
from nearharmonic.reproduction.experiments.trained.problems.orbits import orbit_ensemble
from nearharmonic.reproduction.experiments.trained.problems.purposes import CHARGE, CHARGE_OF_ORBITS, ECCENTRICITIES
from nearharmonic.reproduction.experiments.trained.problems.random_potentials import random_ensemble
from nearharmonic.reproduction.experiments.trained.proof.settings import ORBITS, ProofSettings
from nearharmonic.training.population import Ensemble

#: Coordinates of the random potentials, and bands of their strength, the widest last.
DIMENSIONS = (2, 3)
BANDS = ((1e-3, 1e-2), (1e-2, 1e-1), (1e-1, 0.5), (1e-2, 0.5))
#: Systems with a name that have more coordinates are chains.
CHAIN = 2


class Trial(NamedTuple):
    """An ensemble, step sizes over the cost of a step (T,), the panel of its curve, and what a gradient costs."""

    ensemble: Ensemble
    tau_per_stage: Floats
    panel: str
    charge: float = CHARGE


def proof_ensembles(settings: ProofSettings) -> Iterator[Trial]:
    """Yield each ensemble; step sizes are in its unit."""
    taus = np.array([float(tau) for tau in settings.tau_per_stage])
    t_end = float(settings.t_end)
    for dimension in DIMENSIONS:
        for band in BANDS:
            found = random_ensemble(dimension, settings.systems, settings.seed, band=band, t_end=t_end)
            yield Trial(with_anharmonicity(found), taus, f"random potentials, d = {dimension}")
    for named in named_ensembles(settings.systems, settings.seed, t_end):
        yield Trial(named, taus, "chains" if named.system.dimension > CHAIN else "one or two coordinates")
    orbits = orbit_ensemble(settings.systems, settings.seed, eccentricities=ECCENTRICITIES, orbits=ORBITS)
    evaluations = np.array(settings.evaluations_per_orbit, dtype=float)
    yield Trial(with_anharmonicity(orbits), 2 * np.pi / evaluations, "Kepler orbits", CHARGE_OF_ORBITS)
