"""Objective of a search: energy errors of many methods on an ensemble of problems, relative to the best known method.

The objective is the largest difference to the best known method over a window of step sizes, at equal cost, plus a
multiple of the mean difference. A method that is better only at a single step size gains nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpmath import mp, mpf, nstr
from numpy.typing import NDArray

from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, SQUARE, columns, modified_columns
from nearharmonic.engine.batch import Batch, energy_unit, prepared_batch, sample_marks
from nearharmonic.engine.numbers import moves_behind, rounded_rotations
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics, check_fit
from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.polynomials import BigFloat, fixed_point, newton
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System
from nearharmonic.theory.order_conditions import ConditionedSteps
from nearharmonic.training.family import Family

# --- A population of methods on an ensemble, in one queue of runs: each lane has its own coefficients.

#: Number of lanes: two registers, because the parameters of a problem use the others.
LANES = 16
#: Smallest and largest error that are distinguished: the resolution of doubles, and the error of a diverged run.
LEAST, LOST = 1e-16, 1.0


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """M problems of one system of d coordinates and P parameters, with different initial values or parameters.

    Attributes
    ----------
    start, parameters : (M, 4 d), and (M, 2 P) or (1, 2 P) array of float
        In the layouts of ``start_row`` and ``parameter_row`` of :mod:`nearharmonic.engine.numbers`.
    t_end, unit : float
        Length of every run in the unit of time of the system, and unit of step sizes: one radian of the fastest
        oscillation.
    strength : (M,) array of float, optional
        Anharmonicity of each problem.
    scale : float
        Reference energy of relative errors; 0 for |H0| of each problem.
    frequencies : (M, F) array of float, optional
        Distinct frequencies of each problem, in the order of the system's coordinates. The oscillators of these
        frequencies are solved exactly; without them steps have T and V.
    """

    name: str
    system: System
    start: Floats
    parameters: Floats
    t_end: float
    unit: float = 1.0
    strength: Floats | None = None
    scale: float = 0.0
    frequencies: Floats | None = None

    @property
    def size(self) -> int:
        """Number M of problems."""
        return len(self.start)

    def part(self, which: slice | NDArray[np.int64]) -> Ensemble:
        """Return the ensemble of some of the problems."""
        parameters = self.parameters if len(self.parameters) == 1 else self.parameters[which]
        strength, frequencies = (None if x is None else x[which] for x in (self.strength, self.frequencies))
        return replace(self, start=self.start[which], parameters=parameters, strength=strength, frequencies=frequencies)


class Population:
    """Runs of at most ``size`` methods on all problems of an ensemble, with T step sizes.

    ``shape`` is a method with the stages and the role of all methods. The step sizes are over the ``cost`` of a step in
    force evaluations, by default the stages, in the ensemble's unit of time. A run has at most so many ``samples``,
    from the start to the end.
    """

    def __init__(
        self, ensemble: Ensemble, shape: Tableau, tau_per_stage: Sequence[float], size: int,
        cost: float | None = None, samples: int = 2,
    ) -> None:  # fmt: skip
        self.ensemble, self.stages, self.modified = ensemble, shape.stages, shape.modified
        self.kick_first = shape.first == "kick"
        each = ensemble.unit * (shape.stages if cost is None else cost)
        self.steps = np.array([shape.steps(tau, ensemble.t_end, each) for tau in tau_per_stage])
        self.taus = ensemble.t_end / self.steps
        self.shape = size, len(self.steps), ensemble.size
        self._marks = sample_marks(self.steps, samples)
        self._moves = np.zeros((size * len(self.steps) * self._rows_a_run, shape.stages + 2, self._columns))
        self._batch = self._prepared(shape)

    def errors(self, kicks: Floats, drifts: Floats, squares: Floats | None = None) -> Floats:
        """Return the largest |dH/H0| (C, T, M) over all steps of each run; :data:`LOST` for diverged runs.

        The rows of C methods, at most ``size``, have shapes (C, s + 1) and (C, s), or the other way round; squares are
        one for each kick.
        """
        self._run(kicks, drifts, squares)
        errors = self._relative(self._batch.filled.worst[:, 1:].max(axis=1)[:, None])[..., 0]
        lost = self._batch.left_at.reshape(self.shape) != 0
        return np.where(lost | ~(errors < LOST), LOST, errors)[: len(kicks)]

    def energies(self, kicks: Floats, drifts: Floats, squares: Floats | None = None) -> Floats:
        """Return dH/H0 (C, T, M, S) at S samples of each run without its start; 0 where a run has fewer.

        They are infinite for a diverged run. Arguments are as for :meth:`errors`.
        """
        self._run(kicks, drifts, squares)
        found = self._relative(self._batch.filled.energy_error[:, 1:])
        found[:, self._marks[:, None, 1:].repeat(self.shape[2], axis=1) < 0] = 0.0
        found[self._batch.left_at.reshape(self.shape) != 0] = np.inf
        return found[: len(kicks)]

    def _run(self, kicks: Floats, drifts: Floats, squares: Floats | None) -> None:
        """Run all methods; the lanes of missing ones repeat the first."""
        count = len(kicks)
        moves = self._moves.reshape(self.shape[0], len(self.steps), self._rows_a_run, *self._moves.shape[1:])
        rows = _in_order(kicks, drifts, np.zeros_like(kicks) if squares is None else squares, self.kick_first)
        kick, drift, square = (row[:, None, None, :] for row in rows)
        tau = self.taus[None, :, None, None]
        if self.ensemble.frequencies is not None:
            moves[:count] = rounded_rotations(kick * tau, drift * tau, self.ensemble.frequencies)
        else:
            moves[:count, ..., KICK], moves[:count, ..., DRIFT] = kick * tau, drift * tau
            if self.modified:
                moves[:count, ..., SQUARE] = square * tau * tau * tau
                moves[:count, ..., -1] = _square_behind(np.abs(square[:, 0, 0]) > 0)[:, None, None, :]
            else:
                moves[:count, ..., PRODUCT] = kick * drift * tau * tau
        moves[count:] = moves[:1]
        self._batch.run(self._total)

    def _relative(self, energies: Floats) -> Floats:
        """Return energies (runs, S) over the reference of each run, as (C, T, M, S)."""
        with np.errstate(all="ignore"):
            found = energies / energy_unit(self._batch.filled.energy[:, 0], self.ensemble.scale)[:, None]
        return found.reshape(*self.shape, -1)

    @property
    def _rows_a_run(self) -> int:
        """Rows of coefficients for each method and step size: one, or one for the frequencies of each problem."""
        return 1 if self.ensemble.frequencies is None else self.ensemble.size

    @property
    def _columns(self) -> int:
        if self.ensemble.frequencies is not None:
            return columns(self.ensemble.frequencies.shape[1])
        return modified_columns(1) if self.modified else COLUMNS

    def _prepared(self, shape: Tableau) -> Batch:
        size, taus, problems = self.shape
        ensemble = self.ensemble
        marks = np.tile(np.repeat(self._marks, problems, axis=0), (size, 1))
        self._total = int(marks.max(axis=1).sum())
        parameters = ensemble.parameters
        if len(parameters) > 1:
            parameters = np.tile(parameters, (size * taus, 1))
        lanes = LANES if ensemble.system.energies[0].traced else 1
        numerics = Numerics(
            summation="plain", width=lanes, energy="every" if marks.shape[1] == 2 else "samples",
            split=KINETIC_POTENTIAL if ensemble.frequencies is None else EXACT_OSCILLATOR,
        )  # fmt: skip
        if shape.modified:
            check_fit(ensemble.system, shape, numerics.split, "shape")
        return prepared_batch(
            ensemble.system, shape, numerics, marks=marks,
            scheme=np.repeat(np.arange(len(self._moves)), len(marks) // len(self._moves)), moves=self._moves,
            start=np.tile(ensemble.start, (size * taus, 1)), parameters=parameters,
            scale=ensemble.scale, own_frequencies=ensemble.frequencies is None,
        )  # fmt: skip


def mean_log(errors: Floats) -> Floats:
    """Return the mean of log10 of the errors over the problems (last axis)."""
    found: Floats = np.log10(np.maximum(errors, LEAST)).mean(axis=-1)
    return found


def _in_order(kicks: Floats, drifts: Floats, squares: Floats, kick_first: bool) -> tuple[Floats, Floats, Floats]:
    """Return kick (with the sign of the force), drift and square (C, s + 2) of each move, in the order of kernel rows.

    The second row merges the last move of a step with the first of the next.
    """
    pulls, none = -kicks, np.zeros((len(kicks), 1))
    if kick_first:
        kick = [pulls[:, :1], pulls[:, -1:] + pulls[:, :1], pulls[:, 1:]]
        drift = [drifts[:, :1], drifts, none]
        square = [squares[:, :1], squares[:, -1:] + squares[:, :1], squares[:, 1:]]
    else:
        kick = [none, pulls[:, -1:], pulls]
        drift = [drifts[:, :1], drifts[:, -1:] + drifts[:, :1], drifts[:, 1:]]
        square = [none, squares[:, -1:], squares]
    return np.hstack(kick), np.hstack(drift), np.hstack(square)


def _square_behind(squares: NDArray[np.bool_]) -> Floats:
    """Return an array (C, s + 2): 1 for moves after which the force needs the gradient of the square, else 0."""
    found = np.zeros(squares.shape)
    for i in range(squares.shape[1]):
        found[:, i] = squares[:, list(moves_behind(i, squares.shape[1]))].any(axis=1)
    return found


# --- The mean logarithm of the energy error relative to the best known method.

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
    """Return the tableau of the member next to ``unknowns``; arguments and errors as for :func:`polished`.

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
