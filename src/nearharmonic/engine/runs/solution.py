"""Result of one run of a prepared problem: lightweight; derived values are computed lazily."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.engine.batch.queue import Batch
from nearharmonic.engine.batch.results import Trajectories, filled
from nearharmonic.engine.runs.continuation import Start, start_of
from nearharmonic.engine.runs.description import UNSOLVED, trajectory_dataset
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.numerics.types import Floats, Integers

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, slots=True)
class StepSize:
    """A step size as used and as asked for, with its marks and moves."""

    tau: float
    tau_requested: float
    steps: int
    marks: Integers
    moves: Floats


class Solution:
    """One trajectory: ``t`` (S,), ``q`` and ``p`` (S, d), errors, steps and status, as :func:`integrate` has them.

    A run that left its energy surface keeps the samples until then; both errors are infinite.
    """

    __slots__ = ("__dict__", "_begin", "_diverged_at", "_results", "_step", "_width", "problem")

    def __init__(self, problem: Setup, step: StepSize, batch: Batch, begin: Start | None) -> None:
        self.problem, self._step, self._begin = problem, step, begin
        self._results, self._diverged_at = batch.results.copy(), int(batch.left_at[0])
        self._width = batch.start.shape[-1]

    @property
    def tau(self) -> float:
        """The step size as used."""
        return self._step.tau

    @property
    def tau_requested(self) -> float:
        """The step size asked for."""
        return self._step.tau_requested

    @property
    def steps(self) -> int:
        """Steps that cover the interval; of a regularised system, those of its fictitious time."""
        return self._step.steps if self.problem.system.regularisation is None else int(self.trajectories.done[0])

    @property
    def status(self) -> str:
        """ "ok", "diverged", or "not_converged" if an implicit step could not be solved."""
        if self._diverged_at and self.problem.tableau.implicit and self.trajectories.unsolved[0]:
            return UNSOLVED
        return "diverged" if self._diverged_at else "ok"

    @property
    def diverged_at(self) -> int:
        """The step at which the run left its energy surface, 0 if it did not."""
        return self._diverged_at

    @cached_property
    def trajectories(self) -> Trajectories:
        """The run as a batch of one."""
        arrays = filled(self._step.marks, self._results, np.array([self._diverged_at]), self.problem.states_dimension)
        return self.problem.trajectories(np.array([self._step.steps]), arrays.without_start(self.problem.samples == 1))

    def _kept(self, name: str) -> Floats:
        rows: Floats = getattr(self.trajectories, name)[0]
        return rows[np.isfinite(self.trajectories.q[0, :, 0])]

    @property
    def t(self) -> Floats:
        """Times of the samples (S,)."""
        end = float(self.problem.end)
        return self._kept("marks") * end / self._step.steps

    def _states(self, part: int) -> Floats:
        """Columns of the states as the kernel left them: part 0 the positions, part 2 the momenta.

        They are read without the energies and evaluations, which cost more than a short run does.
        """
        samples, width = self._step.marks.size, self._width
        states = self._results[: samples * width].reshape(samples, width)[int(self.problem.samples == 1) :]
        kept = states[np.isfinite(states[:, 0])] if self._diverged_at else states
        first = part * width // 4
        return kept[:, first : first + self.problem.system.dimension].copy()

    @property
    def q(self) -> Floats:
        """Positions (S, d)."""
        return self._states(0)

    @property
    def p(self) -> Floats:
        """Momenta (S, d)."""
        return self._states(2)

    @property
    def energy_error(self) -> Floats:
        """(H - H0)/|H0| at the samples (S,)."""
        return self._kept("energy_error")

    @property
    def max_energy_error(self) -> float:
        """Maximum of its modulus over every step."""
        return float(self.trajectories.max_energy_error[0])

    @property
    def mean_energy_error(self) -> float:
        """Mean of its modulus over every step."""
        return float(self.trajectories.mean_energy_error[0])

    @property
    def evaluations(self) -> int:
        """Evaluations of the force."""
        return int(self.trajectories.evaluations[0])

    def __repr__(self) -> str:
        return (
            f"Solution({self.problem!r}, tau={self.tau:g}, {self.status}, max_energy_error={self.max_energy_error:.2g})"
        )

    def to_dataset(self) -> xr.Dataset:
        """Return the run as :func:`nearharmonic.integrate` does."""
        begin = self._begin or start_of(self.problem)
        return trajectory_dataset(self.problem, self.trajectories, begin=begin, asked=self.tau_requested)
