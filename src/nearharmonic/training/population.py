"""A population of methods on an ensemble of problems, in one queue of runs: each lane has its own coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, SQUARE, columns, modified_columns
from nearharmonic.engine.batch import Batch, energy_unit, prepared_batch, sample_marks
from nearharmonic.engine.numbers import moves_behind, rounded_rotations
from nearharmonic.engine.settings import EXACT_OSCILLATOR, KINETIC_POTENTIAL, Numerics, check_fit
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System

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

        All of those of a diverged run are infinite. Arguments are those of :meth:`errors`.
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
