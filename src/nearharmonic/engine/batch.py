"""Many runs of one system and one tableau through the compiled kernel: exact settings in, numpy arrays out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.core.layout import FAR
from nearharmonic.core.number import Constant
from nearharmonic.engine.settings import Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems.gradients import check_gradients
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.core.kernel import Kernel, Physics

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: Numerics of the calls that name none.
STANDARD = Numerics()


@cache
def kernel_of(system: System, numerics: Numerics = STANDARD) -> Kernel:
    """Return the compiled kernel for ``system``, from the cache on disk if it is there.

    Parameters
    ----------
    system : System
        Its gradients are compared with its energies when it is first used in this process.
    numerics : Numerics
        Of these, the code depends on those that :attr:`Numerics.compiled` keeps.

    Raises
    ------
    SystemDefinitionError
        A formula fails or uses what formulas cannot (a branch, a function of math), or a gradient contradicts its
        potential.
    CompiledCodeError
        The machine code cannot be loaded.
    """
    from nearharmonic.core.kernel import build

    return build(
        physics_of(system),
        extended=numerics.precision == "extended",
        compensated=numerics.compensated,
        width=numerics.width,
        every_step=numerics.every_step,
    )


def physics_of(system: System) -> Physics:
    """Return what a kernel has to know of ``system``, whose gradients are compared with its energies first.

    Raises
    ------
    SystemDefinitionError
        A gradient contradicts its potential.
    """
    from nearharmonic.core.kernel import Physics

    check_gradients(system)
    formulas, parameters = system.formulas(), system.constants(Constant)
    return Physics(
        name=formulas.name,
        V=formulas.V,
        grad_V=formulas.grad_V,
        T=lambda p: formulas.T(p, *parameters),
        grad_T=lambda p: formulas.grad_T(p, *parameters),
        parameters=parameters,
        dimension=formulas.dimension,
    )


@dataclass(frozen=True, kw_only=True)
class Trajectories:
    """R runs of up to S samples each, of a system with d coordinates.

    ``marks`` (R, S): the step of each sample, -1 where a run has fewer. ``q``, ``p``, ``q_low``, ``p_low`` (R, S, d):
    the states and what compensation or double-double keeps below them; NaN where there is no sample, or where the run
    had left before. ``energy_error`` (R, S): (H - H0)/|H0|. ``block_max``, ``block_mean`` (R, S): of |H - H0|/|H0|
    over the steps since the previous sample. ``max_energy_error``, ``mean_energy_error`` (R,): over every step,
    infinite if the run left. Where the energy is not measured at every step, maxima are over the looks and means NaN.
    ``steps`` (R,) asked for; ``done`` (R,) taken; ``left_at`` (R,) step at which the run left its energy surface, 0 if
    it did not; ``evaluations`` (R,) of the force; ``energy`` (R,): H0.
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

    def take(self, runs: Integers) -> Trajectories:
        """The runs at these indices, in this order."""
        return Trajectories(**{field.name: getattr(self, field.name)[runs] for field in fields(self)})


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


def start_rows(q: Sequence[Fraction], p: Sequence[Fraction], summation: str) -> Floats:
    """Return one start (4 d,) as the kernel takes it: q, the digits below q, p, the digits below p.

    Parameters
    ----------
    q, p : sequence of d Fraction
        Exact position and momentum.
    summation : {"compensated", "plain"}
        Without compensation the digits below a double are dropped.
    """
    pairs = [[rounded_pair(*x.as_integer_ratio()) for x in row] for row in (q, p)]
    keep = 0.0 if summation == "plain" else 1.0
    return np.array([part for row in pairs for part in ([h for h, _ in row], [low * keep for _, low in row])]).ravel()


@lru_cache(maxsize=128)
def _standard_start(system: System, summation: str) -> Floats:
    return start_rows(*system.extended_start(Fraction), summation)


def _standard_starts(system: System, numerics: Numerics, runs: int) -> Floats:
    rows = np.empty((runs, 4 * system.formulas().dimension))
    rows[:] = _standard_start(system, numerics.compiled.summation)
    return rows


def coefficients(tableau: Tableau, taus: Sequence[Fraction], parts: int) -> tuple[Floats, Floats]:
    """Return drift and kick coefficients (len(taus), s + 1, parts), multiplied by tau exactly and rounded once.

    Parameters
    ----------
    tableau : Tableau
        Method of s stages.
    taus : sequence of Fraction
        Step sizes.
    parts : {1, 2}
        Doubles that make a number: 2 for double-doubles.
    """
    arrays = np.empty((2, len(taus), tableau.stages + 1, parts))
    for i, tau in enumerate(taus):
        arrays[:, i] = _products(tableau, tau.numerator, tau.denominator, parts)
    return arrays[0], arrays[1]


@lru_cache(maxsize=256)
def _ratios(tableau: Tableau) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """The rows of drift and kick as quotients of whole numbers; kicks have the sign of the force."""
    outer, inner = tableau.rows_exact()
    drift, kick = (inner, outer) if tableau.first == "kick" else (outer, inner)
    return [c.as_integer_ratio() for c in drift], [(-c).as_integer_ratio() for c in kick]


@lru_cache(maxsize=1024)  # half a kilobyte each; most calls take step sizes that an earlier one took
def _products(tableau: Tableau, numerator: int, denominator: int, parts: int) -> Floats:
    """Drift and kick coefficients (2, s + 1, parts) of one step size; the shorter row ends with 0."""
    array = np.zeros((2, tableau.stages + 1, parts))
    for row, ratios in zip(array, _ratios(tableau), strict=True):
        for j, (top, bottom) in enumerate(ratios):
            product = top * numerator, bottom * denominator
            row[j] = product[0] / product[1] if parts == 1 else rounded_pair(*product)
    return array


def integrate_batch(
    system: System,
    tableau: Tableau,
    *,
    t_end: Fraction,
    steps: Sequence[int] | Integers,
    samples: int,
    numerics: Numerics = STANDARD,
    start: Floats | None = None,
) -> Trajectories:
    """Integrate R runs over [0, t_end], run i in ``steps[i]`` equal steps.

    Parameters
    ----------
    system, tableau
        Problem of d coordinates, and method.
    t_end : Fraction
        End of the interval; negative to run backwards.
    steps : (R,) sequence of int
        Steps of each run.
    samples : int
        Most samples of a run; a single one is the end.
    numerics : Numerics
        Arithmetic, lanes, and how often the energy is evaluated.
    start : (R, 4 d) array of float, optional
        Initial states, laid out as by :func:`start_rows`, in place of the system's own.

    Raises
    ------
    SettingError
        H0 = 0, to which no error is relative.
    """
    kernel = kernel_of(system, numerics.compiled)
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = _distinct(count)
    drift, kick = _scaled_rows(tableau, [t_end / n for n in distinct], kernel.parts, numerics.double_coefficients)
    start = _standard_starts(system, numerics, count.size) if start is None else np.ascontiguousarray(start)
    marks, stages, look = sample_marks(count, samples), tableau.stages, numerics.look
    states = np.full((*marks.shape, 4 * kernel.dimension), np.nan)
    blocks = np.full((3, *marks.shape), np.nan)  # the energy error at each sample; maximum and sum over its block
    energy, left_at = np.zeros((count.size, 2)), np.zeros(count.size, np.int64)
    kernel.run(
        np.argsort(-count, kind="stable"), marks, scheme, start,
        system.surface_limit, FAR if look is None else look, stages, tableau.first == "kick",
        drift, kick, states, *blocks, energy, left_at,
    )  # fmt: skip
    if not numerics.every_step:
        blocks[2] = np.nan  # sums over looks are no means over steps
    cut = int(samples == 1)
    return _trajectories(system, tableau, count, marks[:, cut:], states[:, cut:], blocks[..., cut:], energy, left_at)


def _distinct(count: Integers) -> tuple[list[int], Integers]:
    """The different numbers of steps, ascending, and the place of each run's among them."""
    if count.size == 1:  # sorting takes longer than a short run
        return count.tolist(), np.zeros(1, np.int64)
    distinct, where = np.unique(count, return_inverse=True)
    return distinct.tolist(), where.astype(np.int64).reshape(-1)


def _scaled_rows(tableau: Tableau, taus: Sequence[Fraction], parts: int, rounded: bool) -> tuple[Floats, Floats]:
    """:func:`coefficients`, with zeros for the second parts if they are ``rounded`` to doubles."""
    if not rounded or parts == 1:
        return coefficients(tableau, taus, parts)
    drift, kick = (np.concatenate([row, np.zeros_like(row)], axis=2) for row in coefficients(tableau, taus, 1))
    return drift, kick


def _trajectories(
    system: System,
    tableau: Tableau,
    steps: Integers,
    marks: Integers,
    states: Floats,
    blocks: Floats,
    energy: Floats,
    left_at: Integers,
) -> Trajectories:
    """The results of a kernel by name, energies relative to |H0|."""
    scale = np.abs(energy[:, 0])
    if np.count_nonzero(scale) < scale.size:
        raise bad_setting("system", system.name, "its energy must not be 0 at the start: the energy error is relative")
    error, worst, total = blocks / scale[:, None]
    length = marks.copy()
    length[:, 1:] -= marks[:, :-1]
    np.maximum(length, 1, out=length)
    d = states.shape[2] // 4
    left = left_at > 0
    done = np.where(left, left_at, steps)
    mean = np.add.reduce(total, axis=1) / steps
    if np.isnan(mean).any():  # blocks without a step, or behind the end of a run, count for nothing
        unknown = np.isnan(total)
        mean = np.add.reduce(np.where(unknown, 0, total), axis=1) / steps
        mean[unknown.all(axis=1)] = np.nan
    largest = np.fmax.reduce(worst, axis=1)  # which passes NaN over
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
        block_mean=total / length,
        max_energy_error=largest,
        mean_energy_error=mean,
        steps=steps,
        done=done,
        left_at=left_at,
        evaluations=done * tableau.stages + int(tableau.first_same_as_last),
        energy=energy[:, 0],
    )
