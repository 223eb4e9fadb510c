"""Many runs of one system and one tableau through the compiled kernel: exact settings in, numpy arrays out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.arithmetic import rounded_pair
from nearharmonic.errors import SystemDefinitionError, bad_setting
from nearharmonic.systems.system import System
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    from nearharmonic.core.kernel import Kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

#: One AVX-512 register of doubles; on narrower processors the compiler splits it, with the same bits.
WIDTH = 8


@cache
def kernel_of(system: System, precision: str, summation: str, width: int = WIDTH, every_step: bool = True) -> Kernel:
    """The compiled kernel for ``system``, from the cache on disk if it is there.

    Raises:
        SystemDefinitionError: a formula of the system cannot be traced (it branches, or calls math on a value).
    """
    from nearharmonic.core.kernel import Physics, build

    physics = Physics(
        V=system.V,
        grad_V=system.grad_V,
        T=system.T,
        grad_T=system.grad_T,
        parameters=tuple(Fraction(p.value) for p in system.parameters.values()),
        dimension=system.dimension,
    )
    try:
        return build(
            physics,
            extended=precision == "extended",
            compensated=summation == "compensated",
            width=width,
            every_step=every_step,
        )
    except (TypeError, ValueError, AttributeError) as error:
        raise SystemDefinitionError(f"{system.name}: its formulas cannot be compiled: {error}") from error


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
    """Steps (R, S) at which to sample, as evenly as whole steps allow, first 0 and last ``steps``; padded with -1."""
    width = min(samples, int(steps.max()) + 1)
    index = np.arange(width, dtype=np.int64)[None, :]
    last = np.minimum(steps + 1, width)[:, None] - 1
    return np.where(index <= last, index * steps[:, None] // np.maximum(last, 1), -1)


def start_rows(q: Sequence[Fraction], p: Sequence[Fraction], summation: str) -> Floats:
    """One start (4 d,) as the kernel takes it; without compensation the low halves are dropped, not carried."""
    pairs = [[rounded_pair(*x.as_integer_ratio()) for x in row] for row in (q, p)]
    keep = 0.0 if summation == "plain" else 1.0
    return np.array([part for row in pairs for part in ([h for h, _ in row], [low * keep for _, low in row])]).ravel()


def coefficients(tableau: Tableau, taus: Sequence[Fraction], parts: int) -> tuple[Floats, Floats]:
    """Drift and kick coefficients (len(taus), s + 1, parts), multiplied by tau exactly and rounded once."""
    outer, inner = tableau.rows_exact()
    drift, kick = (inner, outer) if tableau.first == "kick" else (outer, inner)
    arrays = np.zeros((2, len(taus), tableau.stages + 1, parts))
    for array, row, sign in ((arrays[0], drift, 1), (arrays[1], kick, -1)):
        for j, coefficient in enumerate(row):
            numerator, denominator = sign * coefficient.numerator, coefficient.denominator
            for i, tau in enumerate(taus):
                top, bottom = numerator * tau.numerator, denominator * tau.denominator
                array[i, j] = top / bottom if parts == 1 else rounded_pair(top, bottom)
    return arrays[0], arrays[1]


def integrate_batch(
    system: System,
    tableau: Tableau,
    *,
    t_end: Fraction,
    steps: Sequence[int] | Integers,
    samples: int,
    precision: str = "double",
    summation: str = "compensated",
    width: int = WIDTH,
    every_step: bool = True,
    look: int | None = None,
    double_coefficients: bool = False,
    start: Floats | None = None,
) -> Trajectories:
    """Integrate R runs over [0, t_end], run i in ``steps[i]`` equal steps.

    ``start`` (R, 4 d) replaces the system's initial values, laid out as by :func:`start_rows`. Without ``every_step``
    the energy is looked at after every ``look`` steps of the lanes (None: at the samples alone), and errors are those
    at the looks. They do not depend on what runs beside it if ``look`` divides the steps between the samples.
    ``double_coefficients`` rounds the products of step size and coefficient to double in extended precision too.

    Raises:
        SettingError: H0 = 0, to which no error is relative.
        SystemDefinitionError: the system's formulas cannot be compiled.
    """
    kernel = kernel_of(system, precision, "compensated" if precision == "extended" else summation, width, every_step)
    count = np.asarray(steps, dtype=np.int64)
    distinct, scheme = np.unique(count, return_inverse=True)
    drift, kick = coefficients(tableau, [t_end / int(n) for n in distinct], 1 if double_coefficients else kernel.parts)
    if double_coefficients and kernel.parts > 1:
        drift, kick = (np.concatenate([row, np.zeros_like(row)], axis=2) for row in (drift, kick))
    if start is None:
        q0, p0 = (tuple(map(Fraction, row)) for row in (system.q0, system.p0))
        one = start_rows(q0, p0, "compensated" if precision == "extended" else summation)
        start = np.tile(one, (count.size, 1))
    marks = sample_marks(count, samples)
    runs, kept = marks.shape
    states = np.full((runs, kept, 4 * system.dimension), np.nan)
    error, worst, total = (np.full((runs, kept), np.nan) for _ in range(3))
    energy, left_at = np.zeros((runs, 2)), np.zeros(runs, np.int64)
    from nearharmonic.core.layout import FAR, workspace

    kernel.run(
        np.argsort(-count, kind="stable"), marks, scheme.astype(np.int64).reshape(-1), np.ascontiguousarray(start),
        system.surface_limit, FAR if look is None else look, tableau.stages, tableau.first == "kick", drift, kick,
        states, error, worst, total, energy, left_at,
        *workspace(4 * system.dimension, kernel.parts, kernel.width, tableau.stages),
    )  # fmt: skip
    if not every_step:
        total.fill(np.nan)  # sums over looks are no means over steps
    return _trajectories(system, tableau, count, marks, states, (error, worst, total), energy, left_at)


def _trajectories(
    system: System,
    tableau: Tableau,
    steps: Integers,
    marks: Integers,
    states: Floats,
    blocks: tuple[Floats, Floats, Floats],
    energy: Floats,
    left_at: Integers,
) -> Trajectories:
    scale = np.abs(energy[:, 0])
    if not scale.all():
        raise bad_setting("system", system.name, "its energy must not be 0 at the start: the energy error is relative")
    error, worst, total = (block / scale[:, None] for block in blocks)
    length = np.maximum(np.diff(marks, axis=1, prepend=0), 1)
    d = system.dimension
    done = np.where(left_at > 0, left_at, steps)
    left = left_at > 0
    result: dict[str, Any] = {
        name: states[:, :, i * d : (i + 1) * d] for i, name in enumerate(("q", "q_low", "p", "p_low"))
    }
    with np.errstate(invalid="ignore"):
        largest = np.where(left, np.inf, np.nanmax(worst, axis=1))
        mean = np.where(left, np.inf, np.where(np.isnan(total).all(1), np.nan, np.nansum(total, axis=1) / steps))
    return Trajectories(
        marks=marks,
        **result,
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
