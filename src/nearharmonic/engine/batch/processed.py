"""Runs of processed methods: the start by the inverse processor, steps of the kernel, each sample by the processor.

The energy is that of the processed states, and is measured at the samples.
"""

from __future__ import annotations

from math import isnan

import numpy as np

from nearharmonic.engine.batch.queue import Batch


class ProcessedCall:
    """Call of the three batches of a processed method, which fills the arrays of ``batch``.

    Parameters
    ----------
    batch : Batch
        R runs; its moves are those of the kernel, of the inverse processor and of the processor, one behind the other.
    kernel, first, last : Batch
        Runs of the kernel, of the inverse processor from each start, and of the processor from each sample.
    reference : pair of float
        H0 for all runs, in place of the energy of each start.
    """

    def __init__(self, batch: Batch, kernel: Batch, first: Batch, last: Batch, reference: tuple[float, float]) -> None:
        self._batch, self._kernel, self._first, self._last = batch, kernel, first, last
        self._reference = reference

    def __call__(self) -> None:
        """Make the call."""
        batch, kernel, first, last = self._batch, self._kernel, self._first, self._last
        at = 0
        for part in (kernel, first, last):
            rows = part.moves.shape[1]
            part.moves[:] = batch.moves[:, at : at + rows]
            at += rows
        first.start[:] = batch.start
        self._make(first)
        kernel.start[:] = first.filled.states[:, 1]
        kernel.results.fill(np.nan)
        kernel.call()
        last.start[:] = kernel.filled.states.reshape(last.start.shape)
        if len(batch.parameters) > 1:  # one row is shared by all batches
            last.parameters[:] = np.repeat(batch.parameters, batch.marks.shape[1], axis=0)
        self._make(last)
        states = batch.filled.states
        states[:] = last.filled.states[:, 1].reshape(states.shape)
        states[:, 0] = batch.start
        batch.filled.running[:] = kernel.filled.running
        self._measure()

    def _make(self, part: Batch) -> None:
        part.clear()
        part.call()

    def _measure(self) -> None:
        """Measure the energies of processed states."""
        batch, first, last = self._batch.filled, self._first.filled, self._last.filled
        batch.energy[:] = first.energy if isnan(self._reference[0]) else self._reference
        high, low = (last.energy[:, k].reshape(batch.marks.shape) - batch.energy[:, k, None] for k in (0, 1))
        error, worst, total = batch.blocks
        error[:] = (high + low) + last.blocks[0, :, 1].reshape(error.shape)
        start = first.energy - batch.energy
        error[:, 0] = start[:, 0] + start[:, 1]
        worst[:] = np.abs(error)
        total[:] = np.where(batch.marks > 0, worst, 0.0)
        worst[:, 0] = 0.0
