"""Many runs of one system and one tableau through the compiled kernel: exact settings in, numpy arrays out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from math import nan
from typing import Any

import numpy as np

from nearharmonic.core.layout import COUNTERS, EVERY_STEP, ITERATIONS, LOOKS, NEVER, SAMPLES, running_rows
from nearharmonic.engine.batch import execution
from nearharmonic.engine.batch.kernels import STANDARD, cost_of, kernel_of
from nearharmonic.engine.batch.lanes import with_lanes
from nearharmonic.engine.batch.processed import processed_call
from nearharmonic.engine.batch.queue import Batch
from nearharmonic.engine.batch.regularised import landing_call
from nearharmonic.engine.batch.results import Trajectories, filled, surface_limit, trajectories_of
from nearharmonic.engine.grid import check_fit
from nearharmonic.engine.numbers.coefficients import moves_of
from nearharmonic.engine.numbers.initial_values import parameters_at_run_time, standard_parameters, standard_start
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.composition import Composition
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats, Integers
from nearharmonic.systems.definition.system import System


def sample_marks(steps: Integers, samples: int) -> Integers:
    """Return the steps (R, S) at which to sample, first 0 and last ``steps``, padded with -1; S is 2 or more.

    Parameters
    ----------
    steps : (R,) array of int
        Steps of each run.
    samples : int
        Most samples of a run; they are as evenly spaced as whole steps allow.
    """
    width = max(2, min(samples, int(steps.max()) + 1))
    if width == 2:  # as for every sweep
        marks = np.zeros((steps.size, 2), np.int64)
        marks[:, 1] = steps
        return marks
    index, last = np.arange(width, dtype=np.int64), np.minimum(steps + 1, width)[:, None] - 1
    return np.where(index <= last, index * steps[:, None] // np.maximum(last, 1), -1)


def single_steps(runs: int) -> Integers:
    """Return the marks (R, 2) of runs of one step."""
    return np.tile(np.array([[0, 1]]), (runs, 1))


def prepared_batch(
    system: System,
    step: Composition,
    numerics: Numerics,
    *,
    marks: Integers,
    scheme: Integers,
    moves: Floats,
    start: Floats,
    parameters: Floats,
    scale: float = 0.0,
    reference: tuple[float, float] = (nan, nan),
    resumed: Floats | None = None,
    own_frequencies: bool = True,
) -> Batch:
    """Return a batch that is ready to run.

    Parameters
    ----------
    system, step, numerics
        Problem, method, or a single composition of one, and arithmetic.
    marks, scheme, moves, start, parameters
        Arrays that :class:`Batch` describes.
    scale : float
        Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0.
    reference : pair of float
        H0 for all runs, high and low half, in place of the energy of each start.
    resumed : (R, 5 D) array of float, optional
        Running states of runs that go on from ``start`` with the same moves.
    own_frequencies : bool
        False if ``moves`` solve oscillators of other frequencies than the system's, those of each run's parameters.
    """
    if isinstance(step, Tableau) and step.processed:
        return _prepared_processed(
            system, step, numerics, marks=marks, scheme=scheme, moves=moves, start=start, parameters=parameters,
            scale=scale, reference=reference, resumed=resumed,
        )  # fmt: skip
    cost = step.stages * cost_of(system, numerics.compiled, **step.kernel_options)
    runs, d, stages = len(marks), start.shape[1] // 4, step.stages if step.implicit else 0
    left_at, control = np.zeros(runs, np.int64), execution.control()
    results = np.empty((4 * d + 3) * marks.size + (2 + running_rows(d, stages)) * runs)
    parts = filled(marks, results, left_at, d)
    front = measured(numerics), np.argsort(-marks.max(axis=1), kind="stable"), marks, scheme, start
    behind = (
        surface_limit(system, scale), scale, np.array(reference), numerics.look or execution.stretch(cost),
        step.moves_per_step, step.first_same_as_last, moves, control, parts.states, *parts.blocks, parts.energy,
        parts.running, left_at,
    )  # fmt: skip
    call: Callable[[], object]
    if system.regularisation is not None:
        call = landing_call(system, numerics, stages, parameters, (*front, parameters, *behind))
    else:
        parameters = parameters_at_run_time(system, numerics, parameters, own_frequencies=own_frequencies)
        resumed = np.empty((0, running_rows(d, stages))) if resumed is None else resumed.copy()
        if stages:  # iterations count from the start of a run
            resumed[:, ITERATIONS - COUNTERS] = 0.0
        kernel = kernel_of(system, numerics.compiled, **step.kernel_options)
        call = kernel.prepared(*front, resumed, parameters, *behind)
    return Batch(
        numerics=numerics, marks=marks, scheme=scheme, start=start, parameters=parameters, moves=moves,
        results=results, left_at=left_at, control=control, call=call, cost=cost,
    )  # fmt: skip


def _prepared_processed(
    system: System, tableau: Tableau, numerics: Numerics, *, moves: Floats, start: Floats, parameters: Floats,
    marks: Integers, scheme: Integers, reference: tuple[float, float], **given: Any,
) -> Batch:  # fmt: skip
    """Return the batch of a processed method: the kernel starts from the inverse-processed state."""
    numerics = replace(numerics, look=None, energy="none" if numerics.energy == "none" else "samples")

    def part(step: Composition, members: Integers | slice, marks: Integers, **given: Any) -> Batch:
        rows = np.empty((len(moves), step.stages + 2, moves.shape[2]))
        shared = parameters if len(parameters) == 1 else parameters[members]
        return prepared_batch(
            system, step, numerics, marks=marks, scheme=scheme[members], moves=rows, start=start[members].copy(),
            parameters=shared, **given,
        )  # fmt: skip

    every, each = slice(None), np.repeat(np.arange(len(marks)), marks.shape[1])
    step, before, behind = tableau.compositions
    kernel = part(step, every, marks, **given)
    first = part(before, every, single_steps(len(marks)))
    last = part(behind, each, single_steps(each.size))
    batch = replace(kernel, moves=moves, start=start.copy(), results=np.empty_like(kernel.results))
    return replace(batch, call=processed_call(batch, kernel, first, last, reference))


def integrate_batch(
    system: System,
    tableau: Tableau,
    *,
    t_end: Fraction,
    steps: Sequence[int] | Integers,
    samples: int,
    numerics: Numerics = STANDARD,
    start: Floats | None = None,
    parameters: Floats | None = None,
    marks: Integers | None = None,
    scale: float = 0.0,
    reference: tuple[float, float] = (nan, nan),
    resumed: Floats | None = None,
) -> Trajectories:
    """Integrate R runs over [0, t_end], run i in ``steps[i]`` equal steps.

    Parameters
    ----------
    system, tableau, numerics, scale, reference, resumed
        As for :func:`prepared_batch`.
    t_end : Fraction
        End of the interval; negative to run backwards.
    steps : (R,) sequence of int
        Steps of each run.
    samples : int
        Most samples of a run; a single one is the end.
    start : (R or 1, 4 d) array of float, optional
        Initial states in place of the system's own, laid out as by
        :func:`nearharmonic.engine.numbers.coefficients.start_row`.
    parameters : (R or 1, 2 P) array of float, optional
        Parameters in place of the system's own, laid out as by
        :func:`nearharmonic.engine.numbers.coefficients.parameter_row`.
    marks : (R, S) array of int, optional
        Steps at which to sample in place of ``samples``: as :func:`sample_marks` returns them.

    Raises
    ------
    SettingError
        The system has no kernel for kicks of a modified potential.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.
    """
    if tableau.modified:
        check_fit(system, tableau, numerics.split, "tableau")
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = _distinct(count)
    first = standard_start(system, not numerics.compensated) if start is None else start
    rows = np.empty((count.size, first.shape[-1]))
    rows[:] = first
    numerics = with_lanes(numerics, count, system, tableau)
    taus = [t_end / n for n in distinct]
    batch = prepared_batch(
        system, tableau, numerics, marks=sample_marks(count, samples) if marks is None else marks, scheme=scheme,
        moves=moves_of(system, tableau, taus, numerics), start=rows,
        parameters=standard_parameters(system)[None, :] if parameters is None else parameters,
        scale=scale, reference=reference, resumed=resumed,
    )  # fmt: skip
    batch.run()
    only_end = samples == 1 and marks is None
    return trajectories_of(system, tableau, count, batch.filled.without_start(only_end), numerics, scale)


def measured(numerics: Numerics) -> int:
    """Return when the kernel measures the energy, as :data:`nearharmonic.core.layout.RUN` has it."""
    if numerics.energy == "samples":
        return SAMPLES if numerics.look is None else LOOKS
    return EVERY_STEP if numerics.energy == "every" else NEVER


def _distinct(count: Integers) -> tuple[list[int], Integers]:
    """The different numbers of steps, ascending, and the place of each run's among them."""
    if count.size == 1:  # sorting takes longer than a short run
        return count.tolist(), np.zeros(1, np.int64)
    distinct, where = np.unique(count, return_inverse=True)
    return distinct.tolist(), where.astype(np.int64).reshape(-1)
