"""Runs of processed methods: the start by the inverse processor, steps of the kernel, each sample by the processor.

The energy is that of the processed states, and is measured at the samples.
"""

from __future__ import annotations

from dataclasses import replace
from math import isnan
from typing import TYPE_CHECKING, Protocol

import numpy as np

from nearharmonic.core.layout import split_results

if TYPE_CHECKING:
    from nearharmonic.engine.batch.batch import Batch
    from nearharmonic.engine.batch.results import Integers
    from nearharmonic.engine.settings import Numerics
    from nearharmonic.integrators.composition import Composition
    from nearharmonic.integrators.tableau import Tableau
    from nearharmonic.numerics.types import Floats


class Prepared(Protocol):
    """Signature of :func:`nearharmonic.engine.batch.batch.prepared_batch` for one system."""

    def __call__(
        self, step: Composition, numerics: Numerics, *, marks: Integers, scheme: Integers,
        moves: Floats, start: Floats, parameters: Floats,
    ) -> Batch: ...  # fmt: skip


def processed_batch(
    prepare: Prepared, kernel: Batch, tableau: Tableau, moves: Floats, reference: tuple[float, float]
) -> Batch:
    """Return a batch of a processed method that is ready to run.

    Parameters
    ----------
    prepare : callable
        Prepares a batch of the system for one step.
    kernel : Batch
        R runs of the kernel, of S samples each.
    tableau : Tableau
        Method.
    moves : (schemes, rows, columns) array of float
        Of the kernel, of the inverse processor and of the processor, one behind the other.
    reference : pair of float
        H0 for all runs, in place of the energy of each start.
    """
    (runs, samples, width), numerics = kernel.states.shape, kernel.numerics
    many = np.repeat(kernel.scheme, samples)
    parameters = kernel.parameters if len(kernel.parameters) == 1 else np.repeat(kernel.parameters, samples, axis=0)
    first, last = (
        prepare(
            step, numerics, marks=np.tile(np.array([[0, 1]]), (scheme.size, 1)), scheme=scheme,
            moves=np.empty((len(moves), step.stages + 2, moves.shape[2])),
            start=np.empty((scheme.size, kernel.start.shape[1])), parameters=given,
        )
        for step, scheme, given in zip(
            tableau.compositions[1:], (kernel.scheme, many), (kernel.parameters, parameters), strict=True
        )
    )  # fmt: skip
    results = np.empty_like(kernel.results)
    states, blocks, energy, running = split_results(results, runs, samples, width // 4)
    batch = replace(
        kernel, moves=moves, start=kernel.start.copy(), results=results, states=states, blocks=blocks, energy=energy,
        running=running,
    )  # fmt: skip
    return replace(batch, call=ProcessedCall(batch, kernel, first, last, reference))


class ProcessedCall:
    """A call of the three batches of a processed method, which fills the arrays of ``batch``."""

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
        kernel.start[:] = first.states[:, 1]
        kernel.results.fill(np.nan)
        kernel.call()
        last.start[:] = kernel.states.reshape(last.start.shape)
        if len(batch.parameters) > 1:  # one row is shared by all batches
            last.parameters[:] = np.repeat(batch.parameters, batch.marks.shape[1], axis=0)
        self._make(last)
        batch.states[:] = last.states[:, 1].reshape(batch.states.shape)
        batch.states[:, 0] = batch.start
        batch.running[:] = kernel.running
        self._measure()

    def _make(self, part: Batch) -> None:
        part.clear()
        part.call()

    def _measure(self) -> None:
        """The energies of processed states."""
        batch, last = self._batch, self._last
        batch.energy[:] = self._first.energy
        if not isnan(self._reference[0]):
            batch.energy[:] = self._reference
        high, low = (last.energy[:, k].reshape(batch.marks.shape) - batch.energy[:, k, None] for k in (0, 1))
        error, worst, total = batch.blocks
        error[:] = (high + low) + last.blocks[0, :, 1].reshape(error.shape)
        start = self._first.energy - batch.energy
        error[:, 0] = start[:, 0] + start[:, 1]
        worst[:] = np.abs(error)
        total[:] = np.where(batch.marks > 0, worst, 0.0)
        worst[:, 0] = 0.0
