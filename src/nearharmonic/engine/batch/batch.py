"""Many runs of one system and one tableau through the compiled kernel: exact settings in, numpy arrays out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from math import nan
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.core.layout import EVERY_STEP, LOOKS, NEVER, SAMPLES, running_rows, split_results
from nearharmonic.engine.batch import execution
from nearharmonic.engine.batch.kernels import STANDARD, cost_of, kernel_of
from nearharmonic.engine.batch.lanes import with_lanes
from nearharmonic.engine.batch.parameters import parameters_at_run_time
from nearharmonic.engine.batch.processed import ProcessedCall, processed_batch
from nearharmonic.engine.batch.regularised import LandingCall
from nearharmonic.engine.batch.results import Integers, Trajectories, surface_limit, trajectories_of
from nearharmonic.engine.numbers.coefficients import moves_of
from nearharmonic.engine.numbers.initial_values import standard_parameters, standard_start
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.processed_tableau import ProcessedTableau, Processor
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.system import System

if TYPE_CHECKING:
    from nearharmonic.core.machine.native import PreparedCall


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


@dataclass(frozen=True, kw_only=True)
class Batch:
    """A queue of R runs with their arrays, which may be filled anew and run again.

    Attributes
    ----------
    numerics : Numerics
        Arithmetic, lanes, and when the energy is measured.
    marks : (R, S) array of int
        Steps at which to sample, first 0, padded with -1.
    scheme : (R,) array of int
        The row of ``moves`` that each run takes.
    start : (R, 4 D) array of float
        Initial states of the D coordinates of the kernel.
    parameters : (R or 1, 2 P) array of float
        Parameters of each run, or of all.
    moves : (schemes, s + 2, columns) array of float
        Coefficients with the step sizes multiplied in, from :func:`nearharmonic.engine.numbers.coefficients.moves_of`.
    results : array of float
        The next four in one piece.
    states, blocks, energy, running, left_at
        (R, S, 4 D) states; (3, R, S) energy error, and the maximum and sum of its modulus over the block before each
        sample; (R, 2) H0 as pairs; (R, 5 D) the states that run at the end, from which a run may go on; (R,) the step
        at which a run left its energy surface, or 0.
    cost : int
        Cost of a step.
    """

    numerics: Numerics
    marks: Integers
    scheme: Integers
    start: Floats
    parameters: Floats
    moves: Floats
    results: Floats
    states: Floats
    blocks: Floats
    energy: Floats
    running: Floats
    left_at: Integers
    control: Integers
    call: PreparedCall | LandingCall | ProcessedCall
    cost: int

    @property
    def steps(self) -> Integers:
        """Steps of each run (R,)."""
        steps: Integers = self.marks.max(axis=1)
        return steps

    def clear(self) -> None:
        """Forget what an earlier call computed, and that it was told to stop."""
        self.results.fill(nan)
        self.left_at.fill(0)
        self.control.fill(0)

    def run(self, steps: int | None = None) -> None:
        """Compute the results.

        Parameters
        ----------
        steps : int, optional
            Steps of all runs together, where they are known.
        """
        self.clear()
        execution.execute(self.call, self.control, int(self.steps.sum()) if steps is None else steps, self.cost)


def prepared_batch(
    system: System,
    tableau: Tableau | Processor,
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
) -> Batch:
    """Return a batch that is ready to run.

    Parameters
    ----------
    system, tableau, numerics
        Problem, method and arithmetic.
    marks, scheme, moves, start, parameters
        As :class:`Batch` has them.
    scale : float
        Energy that errors are relative to; 0 for |H0|.
    reference : pair of float
        H0 for all runs, in place of the energy of each start.
    resumed : (R, 5 D) array of float, optional
        States that run, of runs that go on from ``start`` with the same moves.
    """
    if isinstance(tableau, ProcessedTableau):
        return _prepared_processed(
            system, tableau, numerics, marks, scheme, moves, start, parameters, scale, reference, resumed
        )
    if system.regularisation is not None and isinstance(tableau, Tableau):
        return _prepared_landing(system, tableau, numerics, marks, scheme, moves, start, parameters, scale, reference)
    kernel = kernel_of(system, numerics.compiled, modified=tableau.modified)
    parameters = parameters_at_run_time(system, numerics, parameters)
    cost = tableau.stages * cost_of(system, numerics.compiled, modified=tableau.modified)
    runs, d = len(marks), kernel.dimension
    left_at, control = np.zeros(runs, np.int64), execution.control()
    results = np.empty((4 * d + 3) * marks.size + (2 + running_rows(d)) * runs)
    states, blocks, energy, running = split_results(results, runs, marks.shape[1], d)
    resumed = np.empty((0, running_rows(d))) if resumed is None else resumed
    call = kernel.prepared(
        measured(numerics), np.argsort(-marks.max(axis=1), kind="stable"), marks, scheme, start, resumed, parameters,
        surface_limit(system, scale), scale, np.array(reference), numerics.look or execution.stretch(cost),
        tableau.stages, tableau.first == "kick", moves, control, states, *blocks, energy, running, left_at,
    )  # fmt: skip
    return Batch(
        numerics=numerics, marks=marks, scheme=scheme, start=start, parameters=parameters, moves=moves,
        results=results, states=states, blocks=blocks, energy=energy, running=running, left_at=left_at,
        control=control, call=call, cost=cost,
    )  # fmt: skip


def _prepared_processed(
    system: System, tableau: ProcessedTableau, numerics: Numerics, marks: Integers, scheme: Integers, moves: Floats,
    start: Floats, parameters: Floats, scale: float, reference: tuple[float, float], resumed: Floats | None,
) -> Batch:  # fmt: skip
    """As above for processed methods: the kernel starts from the inverse-processed state."""
    numerics = replace(numerics, look=None, energy="none" if numerics.energy == "none" else "samples")
    own = np.empty((len(moves), tableau.stages + 2, moves.shape[2]))
    kernel = prepared_batch(
        system, tableau.kernel, numerics, marks=marks, scheme=scheme, moves=own, start=start, parameters=parameters,
        scale=scale, resumed=resumed,
    )  # fmt: skip
    return processed_batch(partial(prepared_batch, system), kernel, tableau, moves, reference)


def _prepared_landing(
    system: System, tableau: Tableau, numerics: Numerics, marks: Integers, scheme: Integers, pieces: Floats,
    start: Floats, parameters: Floats, scale: float, reference: tuple[float, float],
) -> Batch:  # fmt: skip
    """As above for regularised systems; ``running`` begins with the steps of each run, without and with landings."""
    runs, d, cost = len(marks), system.dimension, tableau.stages * cost_of(system, numerics.compiled)
    left_at, control = np.zeros(runs, np.int64), execution.control()
    results = np.empty((4 * d + 3) * marks.size + (2 + running_rows(d)) * runs)
    states, blocks, energy, ends = split_results(results, runs, marks.shape[1], d)
    arguments = (
        measured(numerics), np.arange(runs), marks, scheme, start, parameters, surface_limit(system, scale), scale,
        np.array(reference), numerics.look or execution.stretch(cost), tableau.stages, tableau.first == "kick",
        pieces, control, states, *blocks, energy, ends, left_at,
    )  # fmt: skip
    return Batch(
        numerics=numerics, marks=marks, scheme=scheme, start=start, parameters=parameters, moves=pieces,
        results=results, states=states, blocks=blocks, energy=energy, running=ends, left_at=left_at, control=control,
        call=LandingCall(system, numerics, parameters, arguments), cost=cost,
    )  # fmt: skip


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
    system, tableau
        Problem of d coordinates and P parameters, and method.
    t_end : Fraction
        End of the interval; negative to run backwards.
    steps : (R,) sequence of int
        Steps of each run.
    samples : int
        Most samples of a run; a single one is the end.
    numerics : Numerics
        Arithmetic, lanes, and when the energy is measured.
    start : (R, 4 d) array of float, optional
        Initial states, laid out as by :func:`start_row`, in place of the system's own; one row is for all runs.
    parameters : (R, 2 P) or (1, 2 P) array of float, optional
        Parameters of each run, or of all, laid out as by :func:`parameter_row`, in place of the system's own.
    marks : (R, S) array of int, optional
        Steps at which to sample in place of ``samples``: as :func:`sample_marks` returns them.
    scale : float
        Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0.
    reference : pair of float
        H0 for all runs, high and low half, in place of the energy of each start.
    resumed : (R, 5 d) array of float, optional
        States that run, from which the runs go on.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.
    """
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = _distinct(count)
    first = standard_start(system, not numerics.compensated) if start is None else start
    rows = np.empty((count.size, first.shape[-1]))
    rows[:] = first
    numerics = with_lanes(numerics, count, system)
    taus = [t_end / n for n in distinct]
    batch = prepared_batch(
        system, tableau, numerics, marks=sample_marks(count, samples) if marks is None else marks, scheme=scheme,
        moves=moves_of(system, tableau, taus, numerics), start=rows,
        parameters=standard_parameters(system)[None, :] if parameters is None else parameters,
        scale=scale, reference=reference, resumed=resumed,
    )  # fmt: skip
    batch.run()
    cut = int(samples == 1 and marks is None)
    results = (
        batch.marks[:, cut:],
        batch.states[:, cut:],
        batch.blocks[..., cut:],
        batch.energy,
        batch.running,
        batch.left_at,
    )
    return trajectories_of(tableau, count, *results, numerics, scale, landed=system.regularisation is not None)


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
