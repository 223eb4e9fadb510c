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
from nearharmonic.engine.batch import check_bound, sample_marks
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
    problem_attributes,
    run_at,
    trajectory_variables,
)
from nearharmonic.engine.execution import Batch, Filled, Trajectories, joined
from nearharmonic.engine.kernels import formulas_digest, most_lanes_of
from nearharmonic.engine.numbers import parameter_array, parameters_at_run_time, standard_parameters, start_array
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_THREADS, checked_count, checked_samples, checked_tau
from nearharmonic.engine.setup import Setup, parameter_attributes, warn_of_step
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.output.dataset import assembled, described
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Members that a thread integrates at a time: so many that idle lanes at the end take little time.
BLOCK = 2048
#: Bytes of results that one call keeps at most.
MOST_BYTES = 8_000_000_000


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
    start = start_array(problem.system, q0, p0, plain=problem.plain)
    given = standard_parameters(problem.system)[None, :]
    if parameters is not None:
        given = parameter_array(problem.system, parameters)
    _check_rows(start, given)
    check_bound(problem.system, start, given)
    steps, kept = problem.steps_of(tau), checked_samples(samples)
    warn_of_step(problem, [asked_tau := checked_tau(tau)], [steps])
    members = _Members(problem, steps, start, given, checked_count("threads", threads, MOST_THREADS))
    if t is None:
        paths, times = members.sampled(kept), None
    else:
        asked = checked_times(t, problem)
        paths, times = members.at_times(asked), np.array([float(time) for time in asked])
    attributes = problem_attributes(problem) | parameter_attributes(problem.system, parameters or {})
    attributes |= {"formulas": formulas_digest(problem.system), "tau_requested": asked_tau}
    attributes |= problem.floor(start, given, paths.energy)
    return _dataset(problem, paths, start, given, times, attributes)


def _check_rows(start: Floats, parameters: Floats) -> None:
    members = max(len(start), len(parameters))
    for key, rows in (("q0 and p0", start), ("parameters", parameters)):
        if len(rows) not in (1, members):
            raise bad_setting(key, f"{len(rows)} rows", f"one row, or one for each of {members} members")


@dataclass(frozen=True)
class _Members:
    """Members of an ensemble, integrated in blocks of which each thread has one at a time."""

    problem: Setup
    steps: int
    start: Floats
    parameters: Floats
    threads: int

    @property
    def count(self) -> int:
        """Number of members."""
        return max(len(self.start), len(self.parameters))

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
        problem, members, d = self.problem, self.count, self.problem.states_dimension
        parameters_at_run_time(problem.system, problem.numerics, self.parameters)  # of all members, before any work
        marks, only_end = sample_marks(np.array([self.steps]), samples), samples == 1
        self._check_size(marks.size)
        kept = marks[0, only_end:]
        counters = [0, 1] * (problem.system.regularisation is not None)
        counters += [*range(-COUNTERS, 0)] * problem.tableau.implicit
        arrays = Filled(
            marks=np.broadcast_to(kept, (members, kept.size)),
            states=np.empty((members, kept.size, 4 * d)),
            blocks=np.empty((3, members, kept.size)),
            energy=np.empty((members, 2)),
            running=np.empty((members, len(counters))),
            left_at=np.empty(members, np.int64),
        )
        free: list[Batch] = []

        def compute(block: slice, start: Floats, parameters: Floats) -> None:
            size = block.stop - block.start
            batch = self._batch(marks, size, start, parameters, free)
            batch.run(size * self.steps)
            found = batch.filled.without_start(only_end)
            arrays.states[block], arrays.blocks[:, block] = found.states, found.blocks
            arrays.energy[block], arrays.left_at[block] = found.energy, found.left_at
            arrays.running[block] = found.running[:, counters]
            if size == BLOCK:
                free.append(batch)

        self._in_blocks(compute)
        return problem.trajectories(np.full(members, self.steps), arrays)

    def _check_size(self, samples: int) -> None:
        size = self.count * samples * (4 * self.problem.system.dimension + 3) * 8
        if size > MOST_BYTES:
            what = f"the states of {self.count} members would take {size:.1e} bytes"
            raise bad_setting("samples", samples, f"{what}, and a call keeps {MOST_BYTES:.0e}")

    def _in_blocks(self, compute: Callable[[slice, Floats, Floats], None]) -> None:
        """Call ``compute`` with each block of members, their starts and parameters; one row is for all members."""
        given = self.start, self.parameters

        def one(i: int) -> None:
            block = slice(i * BLOCK, min((i + 1) * BLOCK, self.count))
            compute(block, *(rows[block] if len(rows) > 1 else rows for rows in given))

        count, steps = -(-self.count // BLOCK), self.count * self.steps
        execution.Blocks(one, count, steps=steps, cost=self.problem.cost).execute(self.threads)

    def _batch(self, marks: Integers, size: int, start: Floats, parameters: Floats, free: list[Batch]) -> Batch:
        """Return a batch that holds a block of members: a free one of the same size, or a new one."""
        problem = self.problem
        try:
            batch = free.pop() if size == BLOCK else None
        except IndexError:
            batch = None
        if batch is None:
            return problem.batch(
                problem.moves([problem.end / self.steps]), np.repeat(marks, size, axis=0), np.zeros(size, np.int64),
                np.resize(start, (size, start.shape[1])), parameters.copy(),
                replace(problem.numerics, width=most_lanes_of(problem.system, problem.numerics, problem.tableau)),
            )  # fmt: skip
        batch.start[:] = start
        if batch.parameters.size:  # none if they are compiled in
            batch.parameters[:] = parameters
        return batch


def _dataset(
    problem: Setup, paths: Trajectories, start: Floats, parameters: Floats, times: Floats | None,
    attributes: Mapping[str, Any],
) -> xr.Dataset:  # fmt: skip
    constants = [column if len(parameters) == 1 else column[:, None] for column in parameters.T[::2]]
    variables = trajectory_variables(problem, paths, constants, times)
    if problem.numerics.compensated:
        variables |= over_runs(low_digits(problem, paths))
    variables |= clock_variables(problem, paths)
    variables |= error_variables(paths, problem) | initial_energy_variables(problem, paths)
    variables |= invariant_variables(problem, paths, start, constants)
    renamed = over("member", variables) | parameter_variables(problem, parameters)
    notes = described("step size as used, t_end / steps", problem.system.units["t"])
    renamed["tau"] = (), problem.taus(paths.steps[:1])[0], notes
    coordinates = [name for name in renamed if name.startswith("parameter_")]
    return assembled(renamed, coordinates, attributes)
