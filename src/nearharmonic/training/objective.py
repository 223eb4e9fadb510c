"""Objective of a search: the mean logarithm of the energy error relative to the best known method.

The objective is the largest difference to the best known method over a window of step sizes, at equal cost, plus a
multiple of the mean difference. A method that is better only at a single step size gains nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from mpmath import mp, mpf, nstr
from numpy.typing import NDArray

from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.polynomials import BigFloat, fixed_point, newton
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic.numerics.portable import Floats
from nearharmonic.theory.order_conditions import ConditionedSteps
from nearharmonic.training.family import Family
from nearharmonic.training.population import Ensemble, Population, mean_log

#: Weight of the mean that is added to the maximum: it distinguishes methods with equal maxima.
WEIGHT_OF_MEAN = 0.5
#: Objective of points without a member of the family, and its increase with the sum of the absolute coefficients.
OUTSIDE, SLOPE = 20.0, 0.01
#: Largest sum of the absolute values of all coefficients of a step; rounding errors grow with this sum.
LARGEST_SUM = 9.0


def mean_errors(
    ensemble: Ensemble, methods: Iterable[Tableau], tau_per_stage: Sequence[float], charge: float = 0.0
) -> Floats:
    """Return the mean of log10 max |dH/H0| of methods at equal cost (methods, T).

    The T step sizes are over the cost of a step, in the unit of the ensemble; ``charge`` is the cost of the gradient of
    the square of grad V, in forces.
    """
    return np.stack([mean_log(errors_of(ensemble, one, tau_per_stage, charge)) for one in methods])


def errors_of(ensemble: Ensemble, method: Tableau, tau_per_stage: Sequence[float], charge: float = 0.0) -> Floats:
    """Return the largest |dH/H0| (T, M) of a method on each problem; arguments of :func:`mean_errors`."""
    cost = method.stages + charge * method.gradients
    population = Population(ensemble, method, tau_per_stage, 1, cost)
    rows = [np.array([list(map(float, row))]) for row in (method.kick, method.drift, method.square)]
    found: Floats = population.errors(rows[0], rows[1], rows[2] if method.modified else None)[0]
    return found


class Objective:
    """The objective of members of a family, at most ``size`` per batch; all ensembles have equal weight.

    The T step sizes are over the cost of a step. The references (T,) of each ensemble are subtracted from the mean of
    log10 max |dH/H0|. ``charge`` is the cost of the gradient of the square of grad V, in forces; ``largest_sum`` is the
    bound of the sum of the absolute values of all coefficients of a step.
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
        self.references = [np.asarray(reference) for reference in references]
        self.trials = 0
        self._runs, self._charge = (tuple(ensembles), tuple(tau_per_stage)), charge
        self._populations = self.populations(size)

    def __call__(self, points: Floats) -> Floats:
        """Return the objective (C,) of the members nearest to ``points`` (C, n)."""
        x, inside = self.family.project(points)
        kicks, drifts, squares = self.rows(x)
        total = self._sums(kicks, drifts)
        inside &= total < self.largest_sum
        found: Floats = OUTSIDE + SLOPE * np.minimum(np.nan_to_num(total, nan=np.inf), 100.0)
        if inside.any():
            found[inside] = self._values(kicks[inside], drifts[inside], squares[inside])
        self.trials += len(x)
        return found

    def gains(self, x: Floats) -> Floats:
        """Return by how many decades the errors of members (C, n) are below the reference (ensembles, C, T)."""
        return -self._differences(*self.rows(x))

    def inside(self, x: Floats) -> NDArray[np.bool_]:
        """Return the mask of points (C, n) that fulfil the equations and have coefficients within the bound."""
        kicks, drifts, _ = self.rows(x)
        return self.family.met(x) & (self._sums(kicks, drifts) < self.largest_sum)

    def _sums(self, kicks: Floats, drifts: Floats) -> Floats:
        """Return the sums (C,) of the absolute values of all coefficients; NaN, which is not small, for NaN."""
        with np.errstate(all="ignore"):
            found: Floats = np.abs(kicks).sum(axis=1) + np.abs(drifts).sum(axis=1)
        return found

    def part(self, share: int) -> Objective:
        """Return the objective on the first problems of each ensemble, one in ``share``."""
        ensembles, tau_per_stage = self._runs
        return Objective(
            self.family, [one.part(slice(-(-one.size // share))) for one in ensembles], tau_per_stage, self.references,
            size=self.size, charge=self._charge, largest_sum=self.largest_sum,
        )  # fmt: skip

    def populations(self, size: int, samples: int = 2) -> list[Population]:
        """Return the runs of at most ``size`` members on each ensemble, with so many samples."""
        (ensembles, tau_per_stage), family = self._runs, self.family
        shape, cost = family.shape(), family.stages + self._charge * family.gradients
        return [Population(one, shape, tau_per_stage, size, cost, samples) for one in ensembles]

    def rows(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return kicks, drifts and squares (C, ...) of the points (C, n)."""
        with np.errstate(all="ignore"):  # points with NaN are outside
            kicks, drifts, squares = (np.stack(row).T for row in self.family.rows(x.T))
        return kicks, drifts, squares

    def _values(self, kicks: Floats, drifts: Floats, squares: Floats) -> Floats:
        difference = self._differences(kicks, drifts, squares).mean(axis=0)
        found: Floats = difference.max(axis=1) + WEIGHT_OF_MEAN * difference.mean(axis=1)
        return found

    def _differences(self, kicks: Floats, drifts: Floats, squares: Floats) -> Floats:
        """Return the mean logarithm of the errors minus the reference (ensembles, C, T)."""
        parts = [slice(i, i + self.size) for i in range(0, len(kicks), self.size)]
        return np.stack([
            np.concatenate([
                mean_log(population.errors(kicks[part], drifts[part], squares[part])) - reference for part in parts
            ])
            for population, reference in zip(self._populations, self.references, strict=True)
        ])  # fmt: skip


# --- Refinement of a member of a family from doubles to a tableau of many digits, with minimal change.

#: Guaranteed decimals of a polished tableau.
DIGITS = 60
#: Default of the largest change of an unknown: doubles that fulfil the equations to 1e-10 need smaller changes.
NEAREST = 1e-8


class NotConvergedError(NearharmonicError):
    """Newton's method did not reach a member of the family near the point; the text has its last residual."""


def polished(
    family: ConditionedSteps,
    unknowns: Sequence[float],
    digits: int = DIGITS,
    *,
    fixed: Mapping[int, str] | None = None,
    nearest: float = NEAREST,
) -> list[BigFloat]:
    """Return the member of a family next to a point of n unknowns, as mpf, to this number of decimals.

    ``fixed`` has decimal values of fixed unknowns, by their index; no other unknown changes by more than ``nearest``.
    """
    values = dict(fixed or {})
    with mp.workdps(2 * digits + 20):
        start = [mpf(values.get(i, float(x))) for i, x in enumerate(unknowns)]
    limit = newton(family.residuals, family.slopes, start, digits=digits, fixed=tuple(values))
    moved = max((abs(a - b) for a, b in zip(limit.point, start, strict=True)), default=mpf(0))
    if not limit.converged or moved > nearest:
        raise NotConvergedError(
            f"{family}: Newton's method ends at a residual of {nstr(limit.residual, 3)}, {nstr(moved, 3)} away; wanted "
            f"1e-{digits} within {nearest:g}"
        )
    return list(limit.point)


def tableau_of(
    family: ConditionedSteps,
    unknowns: Sequence[float],
    *,
    digits: int = DIGITS,
    fixed: Mapping[int, str] | None = None,
    nearest: float = NEAREST,
    **about: Any,
) -> Tableau:
    """Return the tableau of the member next to ``unknowns``; arguments and errors are those of :func:`polished`.

    The tableau guarantees this number of decimals, and coefficients have two more. ``about`` has fields of
    :class:`Tableau`: name, label, source, note.
    """
    with mp.workdps(2 * digits + 20):
        kicks, drifts, squares = family.rows(polished(family, unknowns, digits + 10, fixed=fixed, nearest=nearest))
        rows = {"kick": _texts(kicks, digits), "drift": _texts(drifts, digits)}
        given: dict[str, Any] = {"first": family.first, "digits": digits, **rows, **about}
        if family.squares:
            given["square"] = _texts(squares, digits)
    # What has a higher order for some V alone has order 4 for others.
    order = family.order if family.potential_degree is None else 4
    return Tableau(**given, order=order, requires=QUADRATIC_KINETIC_ENERGY if order > 4 else None)


def _texts(row: Sequence[BigFloat], digits: int) -> tuple[str, ...]:
    """Return a symmetric row as decimals, with "0" for exact zeros."""
    texts = [fixed_point(c, digits + 2) if c else "0" for c in row[: (len(row) + 1) // 2]]
    return palindrome(*texts[: len(row) // 2], centre=texts[-1] if len(row) % 2 else None)
