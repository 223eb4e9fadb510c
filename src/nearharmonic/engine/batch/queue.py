"""A queue of runs with their arrays, ready to run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import nan

from nearharmonic.engine.batch import execution
from nearharmonic.engine.batch.results import Filled, filled
from nearharmonic.engine.settings import Numerics
from nearharmonic.numerics.types import Floats, Integers


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
        States, blocks, energies and running states in one piece; :attr:`filled` splits it.
    left_at : (R,) array of int
        Step at which a run left its energy surface, or 0.
    control : (2,) array of int
        Control array of the call.
    call : callable
        Call of the compiled code, which fills ``results`` and ``left_at``.
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
    left_at: Integers
    control: Integers
    call: Callable[[], object]
    cost: int

    @cached_property
    def filled(self) -> Filled:
        """Arrays that :meth:`run` fills, as views of ``results``."""
        return filled(self.marks, self.results, self.left_at, self.start.shape[1] // 4)

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
        """Compute the results; ``steps`` is the number of steps of all runs together, if it is known."""
        self.clear()
        execution.execute(self.call, self.control, int(self.steps.sum()) if steps is None else steps, self.cost)
