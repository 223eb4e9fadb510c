"""Many trajectories of one system with one step size: in SIMD lanes, in blocks that bound the memory, on threads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import execution
from nearharmonic.engine.batch.batch import sample_marks
from nearharmonic.engine.batch.lanes import most_lanes_of
from nearharmonic.engine.batch.queue import Batch
from nearharmonic.engine.batch.regularised import check_bound
from nearharmonic.engine.batch.results import Filled, Trajectories, joined
from nearharmonic.engine.numbers.initial_values import (
    parameter_array,
    parameters_at_run_time,
    standard_parameters,
    start_array,
)
from nearharmonic.engine.runs.continuation import parameter_attributes
from nearharmonic.engine.runs.description import (
    error_variables,
    initial_energy_variables,
    invariant_variables,
    low_digits,
    over_runs,
    problem_attributes,
    trajectory_variables,
)
from nearharmonic.engine.runs.output_times import checked_times, run_at
from nearharmonic.engine.runs.setup import Setup
from nearharmonic.engine.settings import KINETIC_POTENTIAL, checked_samples, checked_threads
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    import xarray as xr

#: Members that a thread integrates at a time: enough that the lanes that run empty at the end do not count.
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

    Parameters
    ----------
    q0, p0 : (M, d) array of float, or one row
        Initial values of each member, or of all; rows of decimal strings are exact.
    parameters : mapping
        Values by name: (M,) arrays of float, or one value for all.
    samples : int
        Most states that a member keeps; by default the first and the last, and 1 keeps the last alone.
    threads : int
        Threads that share the members; bits do not depend on it.
    system, integrator, tau, t_end, t, energy, energy_scale, precision, summation, first, split
        As for :func:`nearharmonic.integrate`.

    Returns
    -------
    xarray.Dataset
        Over (member, sample, component): ``t``, ``q``, ``p``, ``energy_error``; and over member ``max_energy_error``,
        ``mean_energy_error``, ``initial_energy``, ``status``, ``diverged_at`` and the parameters that vary. Each member
        has the bits of a run by :func:`nearharmonic.integrate`. What a member did not reach is NaN.

    Raises
    ------
    NearharmonicError
        An unknown name, arrays of different lengths, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy=energy,
        energy_scale=energy_scale, split=split,
    )  # fmt: skip
    start = start_array(problem.system, q0, p0, plain=problem.plain)
    given = standard_parameters(problem.system)[None, :]
    if parameters is not None:
        given = parameter_array(problem.system, parameters)
    members = _members(start, given)
    check_bound(problem.system, start, given)
    steps, kept = problem.steps_of(tau), checked_samples(samples)
    count = checked_threads(threads)
    if t is None:
        runs = _Runs(problem, steps, kept, start, given, members)
        _check_size(problem, members, runs.marks.size)
        paths, times = runs.run(count), None
    else:
        asked = checked_times(t, problem.end, problem.t_end)
        _check_size(problem, members, len(asked))
        paths = _at_times(problem, steps, asked, start, given, members, count)
        times = np.array([float(time) for time in asked])
    attributes = problem_attributes(problem) | parameter_attributes(problem.system, parameters or {})
    attributes |= problem.floor(start, given, paths.energy)
    return _dataset(problem, paths, start, given, times, attributes)


def _members(start: Floats, parameters: Floats) -> int:
    members = max(len(start), len(parameters))
    for key, rows in (("q0 and p0", start), ("parameters", parameters)):
        if len(rows) not in (1, members):
            raise bad_setting(key, f"{len(rows)} rows", f"one row, or one for each of {members} members")
    return members


def _check_size(problem: Setup, members: int, samples: int) -> None:
    size = members * samples * (4 * problem.system.dimension + 3) * 8
    if size > MOST_BYTES:
        allowed = f"the states of {members} members would take {size:.1e} bytes, and a call keeps {MOST_BYTES:.0e}"
        raise bad_setting("samples", samples, allowed)


def _block(i: int, members: int) -> slice:
    """The members that a thread integrates at a time."""
    return slice(i * BLOCK, min((i + 1) * BLOCK, members))


def _of(block: slice, rows: Floats) -> Floats:
    """The rows of a block, or the one row that is for all members."""
    return rows[block] if len(rows) > 1 else rows


def _execute(problem: Setup, compute: Callable[[int], None], members: int, steps: int, threads: int) -> None:
    """Compute all blocks of members of so many steps each."""
    count = -(-members // BLOCK)
    execution.Blocks(compute, count, steps=members * steps, cost=problem.cost).execute(threads)


def _at_times(
    problem: Setup,
    steps: int,
    times: Sequence[Fraction],
    start: Floats,
    parameters: Floats,
    members: int,
    threads: int,
) -> Trajectories:
    """The members at output times."""
    parts: dict[int, Trajectories] = {}

    def compute(i: int) -> None:
        block = _block(i, members)
        parts[i] = run_at(
            problem, [steps] * (block.stop - block.start), times, start=_of(block, start),
            parameters=_of(block, parameters), reference=(nan, nan),
        )  # fmt: skip

    _execute(problem, compute, members, steps, threads)
    return joined([parts[i] for i in sorted(parts)])


class _Runs:
    """The runs of an ensemble that are sampled at whole steps."""

    def __init__(
        self, problem: Setup, steps: int, samples: int, start: Floats, parameters: Floats, members: int
    ) -> None:
        self.problem, self.steps, self.samples, self.members = problem, steps, samples, members
        parameters_at_run_time(problem.system, problem.numerics, parameters)  # of all members, before any work
        self.start, self.parameters = start, parameters
        self.marks = sample_marks(np.array([steps]), samples)
        self.numerics = replace(problem.numerics, width=most_lanes_of(problem.system, problem.numerics))
        self._free: list[Batch] = []

    def run(self, threads: int) -> Trajectories:
        """All members, in blocks of which each thread has one at a time."""
        problem, members, samples, d = self.problem, self.members, self.marks.size, self.problem.states_dimension
        arrays = Filled(
            marks=np.broadcast_to(self.marks, (members, samples)),
            states=np.empty((members, samples, 4 * d)),
            blocks=np.empty((3, members, samples)),
            energy=np.empty((members, 2)),
            running=np.empty((members, 2 if problem.system.regularisation is not None else 0)),
            left_at=np.empty(members, np.int64),
        ).without_start(self.samples == 1)

        def compute(i: int) -> None:
            block = _block(i, members)
            batch, size = self._batch(block), block.stop - block.start
            batch.run(size * self.steps)
            found = batch.filled.without_start(self.samples == 1)
            arrays.states[block], arrays.blocks[:, block], arrays.energy[block] = (
                found.states,
                found.blocks,
                found.energy,
            )
            arrays.running[block] = found.running[:, : arrays.running.shape[1]]
            arrays.left_at[block] = found.left_at
            if size == BLOCK:
                self._free.append(batch)

        _execute(problem, compute, members, self.steps, threads)
        return problem.trajectories(np.full(members, self.steps), arrays)

    def _batch(self, block: slice) -> Batch:
        """A batch that holds the members of ``block``: a used one of the same size, or a new one."""
        size = block.stop - block.start
        start, parameters = _of(block, self.start), _of(block, self.parameters)
        try:
            batch = self._free.pop() if size == BLOCK else self._new(size, start, parameters)
        except IndexError:
            return self._new(size, start, parameters)
        batch.start[:] = start
        if batch.parameters.size:  # none if they are compiled in
            batch.parameters[:] = parameters
        return batch

    def _new(self, size: int, start: Floats, parameters: Floats) -> Batch:
        problem = self.problem
        return problem.batch(
            problem.moves([problem.end / self.steps]), np.repeat(self.marks, size, axis=0), np.zeros(size, np.int64),
            np.resize(start, (size, start.shape[1])), parameters.copy(), self.numerics,
        )  # fmt: skip


def _dataset(
    problem: Setup, paths: Trajectories, start: Floats, parameters: Floats, times: Floats | None,
    attributes: Mapping[str, Any],
) -> xr.Dataset:  # fmt: skip
    constants = [column if len(parameters) == 1 else column[:, None] for column in parameters.T[::2]]
    variables = trajectory_variables(problem, paths, constants, times)
    if problem.numerics.compensated:
        variables |= over_runs(low_digits(problem, paths))
    variables |= error_variables(paths, problem) | initial_energy_variables(problem, paths)
    variables |= invariant_variables(problem, paths, start, constants)
    for name, column in zip(problem.system.parameters, parameters.T[::2], strict=True):
        if len(parameters) > 1:
            parameter = problem.system.parameters[name]
            variables[f"parameter_{name}"] = ("tau_per_stage",), column, described(parameter.meaning, parameter.unit)
    renamed: Variables = {
        name: (("member", *dims[1:]), values, notes) for name, (dims, values, notes) in variables.items()
    }
    notes = described("step size as used, t_end / steps", problem.system.units["t"])
    renamed["tau"] = (), problem.taus(paths.steps[:1])[0], notes
    coordinates = [name for name in renamed if name.startswith("parameter_")]
    return assembled(renamed, coordinates, attributes)
