"""Random potentials at all strengths, whose oscillators can be solved exactly.

Each is drawn as :mod:`nearharmonic.reproduction.experiments.trained.problems.random_potentials` has it, with strength
1; its cubic and quartic coefficients are then multiplied by each strength, with the same start. The frequencies do not
change, so that they can be declared.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.engine.batch.batch import integrate_batch
from nearharmonic.engine.settings import EXACT_OSCILLATOR, Numerics
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.geometric import geometric
from nearharmonic.numerics.types import Floats
from nearharmonic.reproduction.experiments.trained.problems.random_potentials import random_ensemble
from nearharmonic.systems.definition.quantities import Parameter
from nearharmonic.systems.definition.system import System
from nearharmonic.training.population import LANES, LEAST, LOST, Ensemble

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


def declared(system: System, squares: Floats, number: int) -> System:
    """Return a random potential as a system that declares its frequencies, with a number in its name.

    The first parameters of ``system`` are the ``squares`` (d,) of its frequencies.
    """
    names = list(system.parameters)[: len(squares)]

    def V(q: Any, *given: Any) -> Any:
        frequencies, rest = given[: len(names)], given[len(names) :]
        return system.V(q, *(w * w for w in frequencies), *rest)

    roots = zip(names, np.sqrt(squares).tolist(), strict=True)
    parameters = dict(system.parameters) | {name: Parameter(value=str(Decimal(w))) for name, w in roots}
    return System(
        name=f"{system.name}_{number}", V=V, q0=system.q0, p0=system.p0, t_end=system.t_end, parameters=parameters,
        source=system.source, frequencies=tuple(names),
    )  # fmt: skip


def exact_errors(scaled: Scaled, method: Tableau, tau_per_stage: Floats) -> Floats:
    """Return the largest |dH/H0| (T, K J) of a method for exactly solved oscillators, at equal cost.

    An evaluation costs :data:`CHARGE`. Diverged runs have :data:`LOST`.
    """
    whole = scaled.ensemble()
    J, P = len(scaled.strengths), whole.parameters.shape[1]
    found = np.empty((len(tau_per_stage), whole.size))
    t_end = Fraction(whole.t_end)
    steps = [method.steps(tau * CHARGE, whole.t_end) for tau in tau_per_stage.tolist()]
    numerics = Numerics(summation="plain", split=EXACT_OSCILLATOR, width=LANES)
    for k, squares in enumerate(scaled.potentials.parameters[:, : 2 * DIMENSION : 2]):
        system, here = declared(whole.system, squares, k), slice(k * J, (k + 1) * J)
        parameters = whole.parameters[here].copy()
        parameters[:, : 2 * DIMENSION : 2] = np.sqrt(squares)
        paths = integrate_batch(
            system, method, t_end=t_end, steps=np.repeat(steps, J), samples=1, numerics=numerics,
            start=np.tile(whole.start[here], (len(steps), 1)),
            parameters=np.tile(parameters, (len(steps), 1)).reshape(-1, P),
        )  # fmt: skip
        found[:, here] = paths.max_energy_error.reshape(len(steps), J)
    return np.where(found < LOST, np.maximum(found, LEAST), LOST)
