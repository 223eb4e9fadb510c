"""Results of a batch of runs as named arrays: states, energy errors, divergence flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from math import inf
from typing import NamedTuple

import numpy as np

from nearharmonic.core.layout import COUNTERS, FAILED, ITERATIONS
from nearharmonic.engine.settings import Numerics
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Bools, Floats, Integers
from nearharmonic.systems.definition.system import System

#: Samples at which the energy of a processed method is measured if its errors alone are wanted.
SAMPLES_OF_PROCESSED = 1000


@dataclass(frozen=True, kw_only=True)
class Trajectories:
    """R runs of up to S samples each, of a system with d coordinates.

    ``marks`` (R, S): the step of each sample, -1 where a run has fewer. ``q``, ``p``, ``q_low``, ``p_low`` (R, S, d):
    the states and what compensation or double-double keeps below them; NaN where there is no sample, or where the run
    had left before. ``energy_error`` (R, S): (H - H0)/|H0|, or over the scale asked for. ``block_max``, ``block_mean``
    (R, S): of its modulus over the steps since the previous sample, as far as it was measured. ``max_energy_error``,
    ``mean_energy_error`` (R,): over every step, or over the samples, as :class:`Numerics` says, infinite if the run
    left; maxima over looks have no means. ``steps`` (R,) asked for; ``done`` (R,) taken; ``left_at`` (R,) step at
    which the run left its energy surface, 0 if it did not; ``evaluations`` (R,) of the force; ``energy``,
    ``energy_low`` (R,): H0. ``running`` (R, 5 d or more): the states of the last forces, from which the runs may go on,
    or (R, 0). ``unsolved`` (R,): True where the equations of an implicit step could not be solved at ``left_at``.
    """

    marks: Integers
    q: Floats
    p: Floats
    q_low: Floats
    p_low: Floats
    energy_error: Floats
    block_max: Floats
    block_mean: Floats
    max_energy_error: Floats
    mean_energy_error: Floats
    steps: Integers
    done: Integers
    left_at: Integers
    evaluations: Integers
    energy: Floats
    energy_low: Floats
    running: Floats
    unsolved: Bools

    @property
    def ends(self) -> tuple[Floats, Floats]:
        """Positions at the last sample of each run and the digits below them, (R, d) each."""
        place = np.arange(len(self.marks)), np.count_nonzero(self.marks >= 0, axis=1) - 1
        return self.q[place], self.q_low[place]

    def take(self, runs: Integers) -> Trajectories:
        """The runs at these indices, in this order."""
        return Trajectories(**{field.name: getattr(self, field.name)[runs] for field in fields(self)})


def least_samples(tableau: Tableau) -> int:
    """Return the samples of a run whose energy errors alone are wanted: its ends, unless only samples are measured."""
    return SAMPLES_OF_PROCESSED if tableau.processed else 2


def joined(parts: Sequence[Trajectories]) -> Trajectories:
    """Return the runs of several batches, one behind the other."""
    columns = {field.name: [getattr(part, field.name) for part in parts] for field in fields(Trajectories)}
    return Trajectories(**{name: np.concatenate(arrays) for name, arrays in columns.items()})


def energy_unit(energy: Floats, scale: float) -> Floats:
    """Return the divisor of energy errors: |H0| (R,), 1 where H0 = 0, or ``scale`` if it is not 0."""
    unit = np.abs(energy) if scale == 0 else np.full(energy.size, scale)
    unit[unit == 0] = 1.0
    return unit


class Filled(NamedTuple):
    """Arrays that a call fills for R runs of S samples each, of D coordinates.

    ``marks`` (R, S): the step of each sample, -1 where a run has fewer. ``states`` (R, S, 4 D). ``blocks`` (3, R, S):
    energy error, and maximum and sum of its modulus over the block before each sample. ``energy`` (R, 2): H0 as pairs.
    ``running`` (R, 5 D): the states of the last forces; where runs land on physical times, it begins with the steps of
    each, and those made to land. ``left_at`` (R,): the step at which a run left its energy surface, or 0.
    """

    marks: Integers
    states: Floats
    blocks: Floats
    energy: Floats
    running: Floats
    left_at: Integers

    def without_start(self, cut: bool = True) -> Filled:
        """These arrays without the first sample of each run, or as they are."""
        if not cut:
            return self
        return self._replace(marks=self.marks[:, 1:], states=self.states[:, 1:], blocks=self.blocks[..., 1:])


def filled(marks: Integers, results: Floats, left_at: Integers, d: int) -> Filled:
    """Return views of the ``results`` of runs of ``d`` coordinates with these ``marks``, an array in one piece."""
    runs, samples = marks.shape
    states, blocks = 4 * d * runs * samples, 3 * runs * samples
    behind = states + blocks + 2 * runs
    return Filled(
        marks=marks,
        states=results[:states].reshape(runs, samples, 4 * d),
        blocks=results[states : states + blocks].reshape(3, runs, samples),
        energy=results[states + blocks : behind].reshape(runs, 2),
        running=results[behind:].reshape(runs, -1),
        left_at=left_at,
    )


def trajectories_of(
    system: System, tableau: Tableau, steps: Integers, arrays: Filled, numerics: Numerics, scale: float
) -> Trajectories:
    """Return the results of a kernel by name, energies relative to |H0|, to ``scale``, or to 1."""
    marks, states, blocks, energy, running, left_at = arrays
    error, worst, total = blocks / energy_unit(energy[:, 0], scale)[:, None]
    length = marks.copy()
    length[:, 1:] -= marks[:, :-1]
    np.maximum(length, 1, out=length)
    if numerics.energy == "none":
        error[:] = worst[:] = total[:] = energy[:] = np.nan
    d = states.shape[-1] // 4
    left = left_at > 0
    done = taken = np.where(left, left_at, steps)
    weight, landed, counters = steps, system.regularisation is not None, running
    if landed:
        done, taken = np.maximum(running[:, :2], 1).T.astype(np.int64)
        weight, running = done, running[:, :0]
    evaluations, failed = evaluations_of(tableau, taken, counters)
    largest = np.fmax.reduce(worst, axis=1)  # which passes NaN over
    mean = _means(total, weight, marks, numerics)
    if left.any():
        mean[left] = largest[left] = np.inf
    return Trajectories(
        marks=marks,
        q=states[:, :, :d],
        q_low=states[:, :, d : 2 * d],
        p=states[:, :, 2 * d : 3 * d],
        p_low=states[:, :, 3 * d :],
        energy_error=error,
        block_max=worst,
        block_mean=np.full_like(total, np.nan) if landed else total / (length if numerics.energy == "every" else 1),
        max_energy_error=largest,
        mean_energy_error=mean,
        steps=steps,
        done=done,
        left_at=left_at,
        evaluations=evaluations,
        energy=energy[:, 0],
        energy_low=energy[:, 1],
        running=running,
        unsolved=left & failed,
    )


def evaluations_of(tableau: Tableau, steps: Integers, running: Floats) -> tuple[Integers, Bools]:
    """Return the force evaluations (R,) of runs, and where an implicit step was not solved.

    ``steps`` (R,) were made; those of implicit methods have their iterations among the counters that end ``running``.
    """
    if not tableau.implicit:
        return tableau.evaluations(steps), np.zeros(len(steps), bool)
    counters = running[:, -COUNTERS:]
    return tableau.evaluations(counters[:, ITERATIONS].astype(np.int64)), counters[:, FAILED] != 0


def _means(total: Floats, steps: Integers, marks: Integers, numerics: Numerics) -> Floats:
    """Mean of |H - H0| over the steps, or over the samples; NaN if it was measured at other times."""
    if numerics.look is not None and numerics.energy == "samples":  # sums over looks are no means over steps
        total[:] = np.nan
        return np.full(steps.size, np.nan)
    weight = steps if numerics.energy == "every" else np.maximum(np.count_nonzero(marks > 0, axis=1), 1)
    mean: Floats = np.add.reduce(total, axis=1) / weight
    if np.isnan(mean).any():  # blocks without a step, or behind the end of a run, count for nothing
        unknown = np.isnan(total)
        mean = np.add.reduce(np.where(unknown, 0, total), axis=1) / weight
        mean[unknown.all(axis=1)] = np.nan
    return mean


def surface_limit(system: System, scale: float) -> float:
    """Return the largest energy error of a run, in units of |H0| or of ``scale``, beyond which it has diverged.

    The energy of a system that depends on time has no surface: unless its ``scale`` is one that was asked for, only a
    state that is not finite has diverged.
    """
    return inf if system.time_dependent and scale == system.typical_energy else system.surface_limit
