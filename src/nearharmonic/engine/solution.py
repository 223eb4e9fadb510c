"""Prepared problems, and the lightweight result of one run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import sample_marks
from nearharmonic.engine.description import UNSOLVED, trajectory_dataset
from nearharmonic.engine.execution import Batch, Trajectories, filled
from nearharmonic.engine.kernels import kernel_of
from nearharmonic.engine.numbers import standard_parameters, standard_start
from nearharmonic.engine.settings import checked_tau
from nearharmonic.engine.setup import Setup, Start, start_of, warn_of_step
from nearharmonic.numerics.portable import Floats, Integers

if TYPE_CHECKING:
    import xarray as xr


# --- Result of one run of a prepared problem: lightweight; derived values are computed lazily.
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


# --- Runs of one method on one system, prepared once for many calls.

#: Step sizes whose coefficients a problem keeps: half a kilobyte each.
MOST_STEP_SIZES = 4096


class _Slot:
    """A batch of one run, with what its arrays hold."""

    __slots__ = ("batch", "given", "step")

    def __init__(self, batch: Batch, step: StepSize) -> None:
        self.batch, self.step = batch, step
        self.given: Start | None = None  # the system's own start


class Problem(Setup):
    """Runs of one method on one system, prepared for calls that take microseconds.

    A call ``run(tau, q0=None, p0=None, parameters=None)`` integrates one trajectory, from several threads at once if
    wanted. The three arguments are those of :func:`nearharmonic.integrate`. The result has the arrays ``t`` (S,), ``q``
    and ``p`` (S, d) of its S samples, ``energy_error`` (S,), and the numbers ``max_energy_error``,
    ``mean_energy_error``, ``tau``, ``tau_requested``, ``steps``, ``evaluations``, ``status`` and ``diverged_at``; its
    method ``to_dataset()`` returns the Dataset of :func:`nearharmonic.integrate`.

    Parameters
    ----------
    system, integrator, precision, summation, first, energy, t_end, energy_scale, split
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a run keeps, by default the first and the last.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> run = nh.problem("henon_heiles", "babps8o7h", t_end=100)
    >>> [f"{run(tau).max_energy_error:.1e}" for tau in (0.8, 0.4)]
    ['9.5e-07', '1.2e-08']
    """

    @cached_property
    def _step_sizes(self) -> dict[Any, StepSize]:
        return {}

    @cached_property
    def _slots(self) -> dict[int, list[_Slot]]:
        return {}

    def __reduce__(self) -> tuple[Any, ...]:
        settings = partial(
            Problem, precision=self.numerics.precision, energy=self.numerics.energy, t_end=self.t_end,
            energy_scale=self.scale or None, samples=self.samples, **self.numerics.shared_settings,
        )  # fmt: skip
        return settings, (self.system, self.tableau)

    def __repr__(self) -> str:
        return f"Problem({self.system.name!r}, {self.tableau.name!r}, t_end={self.t_end})"

    @property
    def memory(self) -> int:
        """Bytes that a trajectory works in, beside the states that are kept."""
        kernel = kernel_of(self.system, replace(self.numerics, width=1).compiled, **self.tableau.kernel_options)
        return sum(array.nbytes for array in kernel.workspace(self.tableau.moves_per_step))

    def __call__(
        self, tau: float, q0: object = None, p0: object = None, parameters: Mapping[str, Any] | None = None
    ) -> Solution:
        """Integrate one trajectory with a step size ``tau``; from several threads at once if wanted.

        The step as used is t_end / steps; a difference of 1 % or more is warned of. ``q0``, ``p0`` and ``parameters``
        by name take the place of the system's own: strings and fractions exact, floats as their binary value. Values
        outside what is allowed are refused before any work.
        """
        try:
            step = self._step_sizes.get((type(tau), tau))  # True equals 1.0
        except TypeError:  # a list or an array
            step = None
        if step is None:
            step = self._prepared_step(tau)
            warn_of_step(self, [step.tau_requested], [step.steps])
        slots = self._slots.setdefault(step.marks.size, [])
        try:
            slot = slots.pop()  # a call in another thread finds another slot, or makes one
        except IndexError:
            slot = _Slot(self._new_batch(step), step)
        if slot.step is not step:
            batch = slot.batch
            batch.marks[:], batch.moves[:] = step.marks, step.moves
            slot.step = step
        if q0 is not None or p0 is not None or parameters is not None:
            self._fill(slot, q0, p0, parameters)
        elif slot.given is not None:
            slot.batch.start[:] = standard_start(self.system, self.plain)
            slot.batch.parameters[:] = standard_parameters(self.system)
            slot.given = None
        slot.batch.run(step.steps)
        solution = Solution(self, step, slot.batch, slot.given)
        slots.append(slot)
        return solution

    def _prepared_step(self, tau: object) -> StepSize:
        steps = self.steps_of(tau)
        size = self.end / steps
        step = StepSize(
            float(size), checked_tau(tau), steps, sample_marks(np.array([steps]), self.samples), self.moves([size])
        )
        if len(self._step_sizes) >= MOST_STEP_SIZES:
            self._step_sizes.clear()
        self._step_sizes[type(tau), tau] = step
        return step

    def _new_batch(self, step: StepSize) -> Batch:
        start, parameters = standard_start(self.system, self.plain), standard_parameters(self.system)
        return self.batch(
            step.moves.copy(), step.marks.copy(), np.zeros(1, np.int64), start[None, :].copy(),
            parameters[None, :].copy(), replace(self.numerics, width=1),
        )  # fmt: skip

    def _fill(self, slot: _Slot, q0: object, p0: object, parameters: Mapping[str, Any] | None) -> None:
        """The initial values and parameters of a run, which the slot holds only once all of them are checked."""
        given = start_of(self, q0, p0, parameters)
        slot.batch.start[:], slot.batch.parameters[:] = given.state, given.parameters
        slot.given = given


#: The name at the top of the package.
problem = Problem
