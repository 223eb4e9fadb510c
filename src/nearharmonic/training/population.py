"""A population of methods on an ensemble of problems, in one queue of runs: each lane has its own coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, SQUARE, modified_columns
from nearharmonic.engine.batch.batch import prepared_batch
from nearharmonic.engine.batch.queue import Batch
from nearharmonic.engine.batch.results import energy_unit
from nearharmonic.engine.numbers.coefficients import moves_behind
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System

#: Number of lanes: two registers, because the parameters of a problem use the others.
LANES = 16
#: Smallest and largest error that are distinguished: the resolution of doubles, and the error of a diverged run.
LEAST, LOST = 1e-16, 1.0


@dataclass(frozen=True, kw_only=True)
class Ensemble:
    """M problems of one system, with different initial values or parameters.

    Attributes
    ----------
    name : str
        Name of the ensemble in tables.
    system : System
        System with d coordinates and P parameters.
    start : (M, 4 d) array of float
        Initial states, in the layout of :func:`nearharmonic.engine.numbers.coefficients.start_row`.
    parameters : (M, 2 P) or (1, 2 P) array of float
        Parameters, in the layout of :func:`nearharmonic.engine.numbers.coefficients.parameter_row`.
    t_end : float
        Length of every run, in the unit of time of the system.
    unit : float
        Unit of time of step sizes: one radian of the fastest oscillation.
    strength : (M,) array of float, optional
        Anharmonicity of each problem.
    scale : float
        Reference energy of relative errors; 0 for |H0| of each problem.
    """

    name: str
    system: System
    start: Floats
    parameters: Floats
    t_end: float
    unit: float = 1.0
    strength: Floats | None = None
    scale: float = 0.0

    @property
    def size(self) -> int:
        """Number M of problems."""
        return len(self.start)

    def part(self, which: slice | NDArray[np.int64]) -> Ensemble:
        """Return the ensemble of some of the problems."""
        parameters = self.parameters if len(self.parameters) == 1 else self.parameters[which]
        strength = None if self.strength is None else self.strength[which]
        return replace(self, start=self.start[which], parameters=parameters, strength=strength)


class Population:
    """Runs of methods of one shape on all problems of an ensemble, with several step sizes.

    Parameters
    ----------
    shape : Tableau
        A method with the stages and the role of all methods.
    tau_per_stage : sequence of T float
        Step sizes over the cost of a step, in the ensemble's unit of time.
    size : int
        Maximum number of methods per batch.
    cost : float, optional
        Cost of a step in force evaluations; the stages if None.
    """

    def __init__(
        self, ensemble: Ensemble, shape: Tableau, tau_per_stage: Sequence[float], size: int, cost: float | None = None
    ) -> None:
        self.ensemble, self.stages, self.modified = ensemble, shape.stages, shape.modified
        self.kick_first = shape.first == "kick"
        each = ensemble.unit * (shape.stages if cost is None else cost)
        self.steps = np.array([shape.steps(tau, ensemble.t_end, each) for tau in tau_per_stage])
        self.taus = ensemble.t_end / self.steps
        self.shape = size, len(self.steps), ensemble.size
        columns = modified_columns(1) if self.modified else COLUMNS
        self._moves = np.zeros((size * len(self.steps), shape.stages + 2, columns))
        self._batch = self._prepared(shape)

    def errors(self, kicks: Floats, drifts: Floats, squares: Floats | None = None) -> Floats:
        """Return the largest |dH/H0| (C, T, M) over all steps of each run; :data:`LOST` for diverged runs.

        Parameters
        ----------
        kicks, drifts : (C, s + 1) and (C, s) array of float, or the other way round
            Rows of each method; C is at most ``size``.
        squares : array of float, optional
            Coefficients of the squares, one for each kick.
        """
        count = len(kicks)
        moves = self._moves.reshape(self.shape[0], len(self.steps), *self._moves.shape[1:])
        rows = _in_order(kicks, drifts, np.zeros_like(kicks) if squares is None else squares, self.kick_first)
        kick, drift, square = (row[:, None, :] for row in rows)
        tau = self.taus[None, :, None]
        moves[:count, :, :, KICK], moves[:count, :, :, DRIFT] = kick * tau, drift * tau
        if self.modified:
            moves[:count, :, :, SQUARE] = square * tau * tau * tau
            moves[:count, :, :, -1] = _square_behind(np.abs(square[:, 0]) > 0)[:, None, :]
        else:
            moves[:count, :, :, PRODUCT] = kick * drift * tau * tau
        moves[count:] = moves[:1]
        self._batch.run(self._total)
        return self._found()[:count]

    def _found(self) -> Floats:
        batch = self._batch.filled
        worst = batch.blocks[1, :, -1].reshape(self.shape)
        with np.errstate(all="ignore"):
            errors = worst / energy_unit(batch.energy[:, 0], self.ensemble.scale).reshape(self.shape)
        lost = batch.left_at.reshape(self.shape) != 0
        return np.where(lost | ~(errors < LOST), LOST, errors)

    def _prepared(self, shape: Tableau) -> Batch:
        size, taus, problems = self.shape
        ensemble = self.ensemble
        runs = size * taus * problems
        marks = np.zeros((size, taus, problems, 2), np.int64)
        marks[..., 1] = self.steps[:, None]
        self._total = int(marks.sum())
        parameters = ensemble.parameters
        if len(parameters) > 1:
            parameters = np.tile(parameters, (size * taus, 1))
        lanes = LANES if ensemble.system.energies[0].traced else 1
        return prepared_batch(
            ensemble.system, shape, Numerics(summation="plain", width=lanes), marks=marks.reshape(runs, 2),
            scheme=np.repeat(np.arange(size * taus), problems), moves=self._moves,
            start=np.tile(ensemble.start, (size * taus, 1)), parameters=parameters,
            scale=ensemble.scale,
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
