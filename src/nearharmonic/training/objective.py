"""Objective of a search: the mean logarithm of the energy error against the best known method.

Over a window of step sizes, at equal cost, the worst difference to the best known method at each step size, and half of
the mean: a method that wins at one step size and nowhere near it gains nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.population import Ensemble, Population, mean_log

#: Part of the mean that is added to the worst: it tells methods apart that are equal where they are worst.
WEIGHT_OF_MEAN = 0.5
#: Objective of what is no member of its family, and how it rises with the sum of the coefficients' absolute values.
OUTSIDE, SLOPE = 20.0, 0.01
#: Largest sum of the absolute values of all coefficients of a step, in which rounding errors grow.
LARGEST_SUM = 9.0


def mean_errors(
    ensemble: Ensemble, methods: Iterable[Tableau], tau_per_stage: Sequence[float], charge: float = 0.0
) -> Floats:
    """Return the mean of log10 max |dH/H0| of methods at equal cost (methods, T).

    Parameters
    ----------
    ensemble : Ensemble
        The problems.
    methods : iterable of Tableau
        What is compared.
    tau_per_stage : sequence of T float
        Step sizes over the cost of a step, in the ensemble's unit.
    charge : float
        Cost of the gradient of the square of grad V, in forces.
    """
    return np.stack([mean_log(errors_of(ensemble, one, tau_per_stage, charge)) for one in methods])


def errors_of(ensemble: Ensemble, method: Tableau, tau_per_stage: Sequence[float], charge: float = 0.0) -> Floats:
    """Return the largest |dH/H0| (T, M) of a method on each problem of an ensemble, as :func:`mean_errors` does."""
    cost = method.stages + charge * method.gradients
    population = Population(ensemble, method, tau_per_stage, 1, cost)
    rows = [np.array([list(map(float, row))]) for row in (method.kick, method.drift, method.square)]
    found: Floats = population.errors(rows[0], rows[1], rows[2] if method.modified else None)[0]
    return found


class Objective:
    """The objective of members of a family.

    Parameters
    ----------
    family : Family
        Whose members are tried.
    ensembles : sequence of Ensemble
        Their problems; each ensemble counts the same.
    tau_per_stage : sequence of T float
        The window.
    references : sequence of (T,) array of float
        Of each ensemble, what is subtracted from the mean of log10 max |dH/H0|.
    size : int
        Most members tried at a time.
    charge : float
        Cost of the gradient of the square of grad V, in forces.
    largest_sum : float
        Bound of the sum of the absolute values of all coefficients of a step.
    """

    def __init__(
        self,
        family: Family,
        ensembles: Sequence[Ensemble],
        tau_per_stage: Sequence[float],
        references: Sequence[Floats],
        *,
        size: int,
        charge: float = 0.0,
        largest_sum: float = LARGEST_SUM,
    ) -> None:
        self.family, self.size, self.largest_sum = family, size, largest_sum
        cost = family.stages + charge * family.gradients
        shape = family.shape()
        self._populations = [Population(one, shape, tau_per_stage, size, cost) for one in ensembles]
        self._references = [np.asarray(reference) for reference in references]
        self.trials = 0

    def __call__(self, points: Floats) -> Floats:
        """Return the objective (C,) of the members nearest to ``points`` (C, n)."""
        x, inside = self.family.project(points)
        with np.errstate(all="ignore"):  # points that are no numbers are outside
            kicks, drifts, squares = self._rows(x)
            total = np.abs(kicks).sum(axis=1) + np.abs(drifts).sum(axis=1)
        inside &= total < self.largest_sum
        found: Floats = OUTSIDE + SLOPE * np.minimum(np.nan_to_num(total, nan=np.inf), 100.0)
        if inside.any():
            found[inside] = self._values(kicks[inside], drifts[inside], squares[inside])
        self.trials += len(x)
        return found

    def gains(self, x: Floats) -> Floats:
        """Return by how much members (C, n) err less than the reference, in decades (ensembles, C, T)."""
        return -self._differences(*self._rows(x))

    def _rows(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        kicks, drifts, squares = (np.stack(row).T for row in self.family.rows(x.T))
        return kicks, drifts, squares

    def _values(self, kicks: Floats, drifts: Floats, squares: Floats) -> Floats:
        difference = self._differences(kicks, drifts, squares).mean(axis=0)
        found: Floats = difference.max(axis=1) + WEIGHT_OF_MEAN * difference.mean(axis=1)
        return found

    def _differences(self, kicks: Floats, drifts: Floats, squares: Floats) -> Floats:
        """Mean log of errors, less the reference, by ensemble (ensembles, C, T)."""
        parts = [slice(i, i + self.size) for i in range(0, len(kicks), self.size)]
        return np.stack([
            np.concatenate([
                mean_log(population.errors(kicks[part], drifts[part], squares[part])) - reference for part in parts
            ])
            for population, reference in zip(self._populations, self._references, strict=True)
        ])  # fmt: skip
