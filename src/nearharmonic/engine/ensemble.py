"""Many trajectories of one system with one step size: in SIMD lanes, in blocks that bound the memory, on threads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.layout import COUNTERS
from nearharmonic.engine import execution
from nearharmonic.engine.batch import sample_marks
from nearharmonic.engine.description import (
    checked_times,
    clock_variables,
    error_variables,
    initial_energy_variables,
    invariant_variables,
    low_digits,
    over,
    over_runs,
    parameter_variables,
    run_at,
    run_attributes,
    step_used,
    trajectory_variables,
)
from nearharmonic.engine.execution import Batch, Filled, Trajectories, joined, sample_size, shapes
from nearharmonic.engine.kernels import most_lanes_of
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_THREADS, checked_count, checked_samples
from nearharmonic.engine.setup import Setup, Start, asked_steps, check_memory, start_of
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.output.store import assembled
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Members that a thread integrates at a time: so many that idle lanes at the end take little time.
BLOCK = 2048


def ensemble(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    t_end: float | str | None = None,
    t: object = None,
    samples: int = 2,
    energy: str = "every",
    energy_scale: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    split: str = KINETIC_POTENTIAL,
    threads: int = 1,
) -> xr.Dataset:
    """Integrate many trajectories that differ in initial values or parameters.

    Each covers [0, t_end] in ``steps = max(1, round(|t_end| / tau))`` equal steps.

    Parameters
    ----------
    system, integrator, tau
        As for :func:`nearharmonic.integrate`.
    q0, p0 : (M, d) array of float, or one row, optional
        Initial values of each member, or of all; rows of decimal strings are exact.
    parameters : mapping, optional
        Values by name: (M,) arrays of float, or one value for all.
    t_end, t
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a member keeps; by default the first and the last, and 1 keeps the last alone.
    energy, energy_scale, precision, summation, first, split
        As for :func:`nearharmonic.integrate`.
    threads : int
        Threads that share the members; bits do not depend on it.

    Returns
    -------
    xarray.Dataset
        Over (member, sample, component): ``t``, ``q``, ``p``, ``energy_error``; and over member ``max_energy_error``,
        ``mean_energy_error``, ``initial_energy``, ``status``, ``diverged_at`` and the parameters that vary. Each member
        has the bits of a run by :func:`nearharmonic.integrate`. Samples that a member did not reach are NaN.

    Raises
    ------
    NearharmonicError
        An unknown name, arrays of different lengths, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.ensemble("henon_heiles", "ruth", 0.1, q0=[[0.1, 0], [0.2, 0], [0.3, 0]], t_end=10)
    >>> [f"{error:.1e}" for error in found.max_energy_error.values]
    ['2.0e-05', '1.9e-05', '1.4e-05']
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy=energy,
        energy_scale=energy_scale, split=split,
    )  # fmt: skip
    begin = start_of(problem, q0, p0, parameters, several=True)
    (steps, asked_tau), kept = asked_steps(problem, tau), checked_samples(samples)
    members = _Members(problem, steps, begin, checked_count("threads", threads, MOST_THREADS))
    if t is None:
        paths, times = members.sampled(kept), None
    else:
        asked = checked_times(t, problem)
        paths, times = members.at_times(asked), np.array([float(time) for time in asked])
    attributes = run_attributes(problem, begin, asked_tau) | problem.floor(begin.state, begin.parameters, paths.energy)
    constants = [column if len(begin.parameters) == 1 else column[:, None] for column in begin.parameters.T[::2]]
    variables = trajectory_variables(problem, paths, constants, times)
    if problem.numerics.compensated:
        variables |= over_runs(low_digits(problem, paths))
    variables |= clock_variables(problem, paths)
    variables |= error_variables(paths, problem) | initial_energy_variables(problem, paths)
    variables |= invariant_variables(problem, paths, begin.state, constants)
    renamed = over("member", variables) | parameter_variables(problem, begin.parameters)
    renamed["tau"] = step_used(problem, steps)
    coordinates = [name for name in renamed if name.startswith("parameter_")]
    return assembled(renamed, coordinates, attributes)


@dataclass(frozen=True)
class _Members:
    """Members of an ensemble, integrated in blocks of which each thread has one at a time."""

    problem: Setup
    steps: int
    begin: Start
    threads: int

    def at_times(self, times: Sequence[Fraction]) -> Trajectories:
        """Return all members at output times."""
        self._check_size(len(times))
        parts: dict[int, Trajectories] = {}

        def compute(block: slice, start: Floats, parameters: Floats) -> None:
            steps = [self.steps] * (block.stop - block.start)
            parts[block.start] = run_at(
                self.problem, steps, times, start=start, parameters=parameters, reference=(nan, nan)
            )

        self._in_blocks(compute)
        return joined([parts[i] for i in sorted(parts)])

    def sampled(self, samples: int) -> Trajectories:
        """Return all members, sampled at whole steps."""
        problem, members, d = self.problem, self.begin.members, self.problem.states_dimension
        marks, only_end = sample_marks(np.array([self.steps]), samples), samples == 1
        self._check_size(marks.size)
        kept = marks[0, only_end:]
        counters = [0, 1] * (problem.system.regularisation is not None)
        counters += [*range(-COUNTERS, 0)] * problem.tableau.implicit
        shown = shapes((members, kept.size), d, len(counters))
        arrays = Filled(
            np.broadcast_to(kept, (members, kept.size)), np.empty(members, np.int64),
            **{name: np.empty(shape) for name, shape in shown.items()},
        )  # fmt: skip
        free: list[Batch] = []

        def compute(block: slice, start: Floats, parameters: Floats) -> None:
            size = block.stop - block.start
            batch = self._batch(marks, size, start, parameters, free)
            batch.run(size * self.steps)
            found = batch.filled.without_start(only_end)
            found = found._replace(running=found.running[:, counters])
            for name in (*shown, "left_at"):
                getattr(arrays, name)[block] = getattr(found, name)
            if size == BLOCK:
                free.append(batch)

        self._in_blocks(compute)
        return problem.trajectories(np.full(members, self.steps), arrays)

    def _check_size(self, samples: int) -> None:
        members, size = self.begin.members, sample_size(self.problem.system.dimension)
        check_memory(f"the states of {members} members", members * samples * size, samples)

    def _in_blocks(self, compute: Callable[[slice, Floats, Floats], None]) -> None:
        """Call ``compute`` with each block of members, their starts and parameters; one row is for all members."""
        given, members = (self.begin.state, self.begin.parameters), self.begin.members

        def one(i: int) -> None:
            block = slice(i * BLOCK, min((i + 1) * BLOCK, members))
            compute(block, *(rows[block] if len(rows) > 1 else rows for rows in given))

        count, steps = -(-members // BLOCK), members * self.steps
        execution.Blocks(one, count, steps=steps, cost=self.problem.cost).execute(self.threads)

    def _batch(self, marks: Integers, size: int, start: Floats, parameters: Floats, free: list[Batch]) -> Batch:
        """Return a batch that holds a block of members: a free one of the same size, or a new one."""
        problem = self.problem
        try:
            batch = free.pop() if size == BLOCK else None
        except IndexError:
            batch = None
        if batch is None:
            lanes = replace(problem.numerics, width=most_lanes_of(problem.system, problem.numerics, problem.tableau))
            return problem.batch(
                problem.moves([problem.end / self.steps]), np.repeat(marks, size, axis=0), np.zeros(size, np.int64),
                np.resize(start, (size, start.shape[1])), parameters.copy(), lanes,
            )  # fmt: skip
        batch.start[:] = start
        if batch.parameters.size:  # none if they are compiled in
            batch.parameters[:] = parameters
        return batch
