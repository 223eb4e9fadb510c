"""Runs of processed methods: the start by the inverse processor, steps of the kernel, each sample by the processor.

The energy is that of the processed states, and is measured at the samples.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isnan

import numpy as np

from nearharmonic.engine.batch.queue import Batch


def processed_call(
    batch: Batch, kernel: Batch, first: Batch, last: Batch, reference: tuple[float, float]
) -> Callable[[], None]:
    """Return a call of the three batches of a processed method, which fills the arrays of ``batch``.

    Parameters
    ----------
    batch : Batch
        R runs; its moves are those of the kernel, of the inverse processor and of the processor, one behind the other.
    kernel, first, last : Batch
        Runs of the kernel, of the inverse processor from each start, and of the processor from each sample.
    reference : pair of float
        H0 for all runs, in place of the energy of each start.
    """
    parts = kernel, first, last
    given = np.split(batch.moves, np.cumsum([part.moves.shape[1] for part in parts[:-1]]), axis=1)
    inner, before, behind = (part.filled for part in parts)
    marks, states, (error, worst, total), energy, running, _ = batch.filled

    def call() -> None:
        for part, moves in zip(parts, given, strict=True):
            part.moves[:] = moves
        first.start[:] = batch.start
        first.clear()
        first.call()
        kernel.start[:] = before.states[:, 1]
        kernel.results.fill(np.nan)
        kernel.call()
        last.start[:] = inner.states.reshape(last.start.shape)
        if len(batch.parameters) > 1:  # one row is shared by all batches
            last.parameters[:] = np.repeat(batch.parameters, marks.shape[1], axis=0)
        last.clear()
        last.call()
        states[:] = behind.states[:, 1].reshape(states.shape)
        states[:, 0] = batch.start
        running[:] = inner.running
        measure()

    def measure() -> None:
        """Measure the energies of processed states."""
        energy[:] = before.energy if isnan(reference[0]) else reference
        high, low = (behind.energy[:, k].reshape(marks.shape) - energy[:, k, None] for k in (0, 1))
        error[:] = (high + low) + behind.blocks[0, :, 1].reshape(error.shape)
        start = before.energy - energy
        error[:, 0] = start[:, 0] + start[:, 1]
        worst[:] = np.abs(error)
        total[:] = np.where(marks > 0, worst, 0.0)
        worst[:, 0] = 0.0

    return call
