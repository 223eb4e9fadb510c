"""Random potentials at all strengths, whose oscillators can be solved exactly.

Each is drawn as :mod:`nearharmonic_studies.trained.problems.random_potentials` has it, with strength
1; its cubic and quartic coefficients are then multiplied by each strength, with the same start. The frequencies do not
change, so that they can be declared.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, geometric
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Ensemble
from nearharmonic_studies.trained.problems.random_potentials import random_ensemble, with_exact_oscillators

#: Number of coordinates and of frequencies, which are the first parameters.
DIMENSION = 2
#: Smallest and largest strength.
WEAKEST, STRONGEST = 1e-4, 1.0
#: Cost of an evaluation with the exact oscillator over one with T and V, measured: docs/results/exact_oscillator.md.
CHARGE = 1.12


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """K ``potentials``, given at strength 1, at J ``strengths`` each: factors of cubic and quartic coefficients."""

    potentials: Ensemble
    strengths: Floats

    def ensemble(self) -> Ensemble:
        """Return all K J problems, the strengths of the first potential first."""
        whole, count = self.potentials, len(self.strengths)
        parameters = np.repeat(whole.parameters, count, axis=0).reshape(whole.size, count, -1)
        parameters[:, :, 2 * DIMENSION :] *= self.strengths[:, None]
        return Ensemble(
            name=whole.name, system=whole.system, start=np.repeat(whole.start, count, axis=0),
            parameters=parameters.reshape(whole.size * count, -1), t_end=whole.t_end,
        )  # fmt: skip


def scaled_potentials(count: int, strengths: int, seed: int, t_end: float) -> Scaled:
    """Return random potentials at logarithmically spaced strengths; ``t_end`` is in radians of the frequency 1."""
    whole = random_ensemble(DIMENSION, count, seed, band=(1.0, 1.0), t_end=t_end)
    return Scaled(potentials=whole, strengths=np.array(geometric(WEAKEST, STRONGEST, strengths)))


def exact_errors(scaled: Scaled, method: Tableau, tau_per_stage: Floats) -> Floats:
    """Return the largest |dH/H0| (T, K J) of a method for exactly solved oscillators, at equal cost.

    An evaluation costs :data:`CHARGE`. Diverged runs have the error 1.
    """
    found = errors_of(with_exact_oscillators(scaled.ensemble()), method, (tau_per_stage * CHARGE).tolist())
    return np.maximum(found, LEAST)
