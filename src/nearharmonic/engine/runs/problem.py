"""A system, a method and how to integrate, checked and prepared once for many runs; and the result of one run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.layout import workspace
from nearharmonic.engine.batch.batch import Batch, integrate_batch, prepared_batch, sample_marks
from nearharmonic.engine.batch.kernels import kernel_of
from nearharmonic.engine.batch.numba_runs import check_precision
from nearharmonic.engine.batch.regularised import check_bound
from nearharmonic.engine.batch.results import Integers, Trajectories
from nearharmonic.engine.grid import check_fit, steps_of
from nearharmonic.engine.numbers.coefficients import moves_of
from nearharmonic.engine.numbers.initial_values import (
    exact,
    standard_parameters,
    standard_start,
)
from nearharmonic.engine.runs.invariants import check_quantities
from nearharmonic.engine.runs.solution import Solution, StepSize
from nearharmonic.engine.settings import (
    KINETIC_POTENTIAL,
    Numerics,
    checked_first,
    checked_samples,
    checked_t_end,
    checked_tau,
    exact_decimal,
)
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.systems import systems
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.oscillator import check_oscillator

if TYPE_CHECKING:
    from nearharmonic.engine.runs.continuation import Start

#: Step sizes whose coefficients a problem keeps: half a kilobyte each.
MOST_STEP_SIZES = 4096


class _Slot:
    """A batch of one run, with what its arrays hold."""

    __slots__ = ("batch", "default", "given", "step")

    def __init__(self, batch: Batch, step: StepSize) -> None:
        self.batch, self.step, self.default = batch, step, True
        self.given: Start | None = None


class Problem:
    """Runs of one method on one system, prepared for calls that cost microseconds: ``nearharmonic.problem``.

    Parameters
    ----------
    system, integrator, precision, summation, first, energy, t_end, energy_scale, split
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a run keeps, by default the first and the last.

    Attributes
    ----------
    system : System
        What is integrated.
    tableau : Tableau
        The method, in the role that is used.
    t_end : str
        End of the interval [0, t_end], a decimal string; negative to run backwards.
    numerics : Numerics
        Arithmetic, when the energy is measured, and what the two operators of the method solve.
    scale : float
        Energy that errors are relative to; 0 for |H0|, or for the unit of energy where H0 = 0.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.
    """

    def __init__(
        self,
        system: str | System,
        integrator: str | Tableau,
        *,
        precision: str = "double",
        summation: str = "compensated",
        first: str | None = None,
        energy: str = "every",
        t_end: float | str | None = None,
        energy_scale: float | str | None = None,
        split: str = KINETIC_POTENTIAL,
        samples: int = 2,
    ) -> None:
        self.system = system if isinstance(system, System) else systems[system]
        tableau = integrator if isinstance(integrator, Tableau) else integrators[integrator]
        self.tableau = tableau.role(checked_first(first))  # type: ignore[arg-type]
        check_fit(self.system, self.tableau, split)
        check_quantities(self.system)
        check_bound(self.system, standard_start(self.system, False)[None, :], standard_parameters(self.system)[None, :])
        self.t_end = checked_t_end(self.system.t_end if t_end is None else t_end)
        self.end = exact_decimal(self.t_end)
        if self.tableau.processed and energy == "every":  # the states between samples are not those of the method
            energy = "samples"
        self.numerics = Numerics(precision=precision, summation=summation, energy=energy, split=split)
        check_precision(self.system, [precision])
        if self.numerics.exact_oscillator:
            check_oscillator(self.system)
        self.scale = checked_scale(self.system.energy_scale if energy_scale is None else energy_scale)
        self.samples = checked_samples(samples)
        self._step_sizes: dict[Any, StepSize] = {}
        self._slots: dict[int, list[_Slot]] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.system, self.tableau, self.t_end, self.numerics, self.scale, self.samples)

    def __repr__(self) -> str:
        return f"Problem({self.system.name!r}, {self.tableau.name!r}, t_end={self.t_end})"

    @property
    def plain(self) -> bool:
        """True if the digits below a double are dropped."""
        return not self.numerics.compensated

    @property
    def states_dimension(self) -> int:
        """Coordinates of the states that are kept: the system's own, and the time if V depends on it."""
        return self.system.dimension + self.system.time_dependent

    @property
    def memory(self) -> int:
        """Bytes that a trajectory works in, beside the states that are kept."""
        kernel = kernel_of(self.system, replace(self.numerics, width=1).compiled, modified=self.tableau.modified)
        arrays = workspace(
            kernel.dimension, self.tableau.stages, parameters=kernel.parameters, width=1, room=kernel.room,
            columns=kernel.columns,
        )  # fmt: skip
        return sum(array.nbytes for array in arrays)

    def __call__(
        self, tau: float, q0: object = None, p0: object = None, parameters: Mapping[str, Any] | None = None
    ) -> Solution:
        """Integrate one trajectory; from several threads at once if wanted.

        Parameters
        ----------
        tau : float
            Step size asked for; the step as used is t_end / steps.
        q0, p0 : sequence of d numbers or decimal strings, optional
            Initial values in place of the system's own: strings and fractions exact, floats as their binary value.
        parameters : mapping, optional
            Values of parameters by name, in place of the system's own.

        Raises
        ------
        NearharmonicError
            A step size, initial value or parameter outside what is allowed, before any work.
        """
        try:
            step = self._step_sizes.get(tau)
        except TypeError:  # a list or an array
            step = None
        if step is None:
            step = self._prepared_step(tau)
        slots = self._slots.setdefault(step.marks.size, [])
        try:
            slot = slots.pop()  # a call in another thread finds another slot, or makes one
        except IndexError:
            slot = self._new_slot(step)
        if slot.step is not step:
            batch = slot.batch
            batch.marks[:], batch.moves[:] = step.marks, step.moves
            slot.step = step
        if q0 is not None or p0 is not None or parameters is not None:
            self._fill(slot, q0, p0, parameters)
        elif not slot.default:
            slot.batch.start[:] = standard_start(self.system, self.plain)
            slot.batch.parameters[:] = standard_parameters(self.system)
            slot.default = True
        slot.batch.run(step.steps)
        solution = Solution(self, step, slot.batch, None if slot.default else slot.given)
        slots.append(slot)
        return solution

    def run(
        self,
        steps: Sequence[int],
        samples: int,
        *,
        start: Floats | None = None,
        parameters: Floats | None = None,
        reference: tuple[float, float] = (nan, nan),
        resumed: Floats | None = None,
    ) -> Trajectories:
        """Integrate one run for each entry of ``steps``; those that are equal in all are computed once.

        Parameters
        ----------
        steps : (R,) sequence of int
            Steps of each run.
        samples : int
            Most samples of a run.
        start, parameters, reference, resumed
            As for :func:`nearharmonic.engine.batch.batch.integrate_batch`.
        """
        same = (start is None or len(start) == 1) and (parameters is None or len(parameters) == 1)
        distinct = list(dict.fromkeys(steps)) if same else list(steps)
        paths = integrate_batch(
            self.system, self.tableau, t_end=self.end, steps=distinct, samples=samples, numerics=self.numerics,
            start=start, parameters=parameters, scale=self.scale, reference=reference, resumed=resumed,
        )  # fmt: skip
        if len(distinct) == len(steps):
            return paths
        where = {n: i for i, n in enumerate(distinct)}
        return paths.take(np.array([where[n] for n in steps]))

    def steps_of(self, tau: object, key: str = "tau") -> int:
        """Return max(1, round(|t_end| / tau))."""
        return steps_of(self.t_end.lstrip("-"), checked_tau(tau, key))

    def taus(self, steps: Integers) -> Floats:
        """Return the step sizes as used, rounded once."""
        return np.array([self.end.numerator / (self.end.denominator * n) for n in steps.tolist()])

    def _prepared_step(self, tau: object) -> StepSize:
        steps = self.steps_of(tau)
        size = self.end / steps
        marks = sample_marks(np.array([steps]), self.samples)
        rows = moves_of(self.system, self.tableau, [size], self.numerics)
        step = StepSize(float(size), steps, marks, rows)
        if len(self._step_sizes) >= MOST_STEP_SIZES:
            self._step_sizes.clear()
        self._step_sizes[tau] = step
        return step

    def _new_slot(self, step: StepSize) -> _Slot:
        numerics = replace(self.numerics, width=1)
        batch = prepared_batch(
            self.system, self.tableau, numerics, marks=step.marks.copy(), scheme=np.zeros(1, np.int64),
            moves=step.moves.copy(), scale=self.scale,
            start=standard_start(self.system, self.plain)[None, :].copy(),
            parameters=standard_parameters(self.system)[None, :].copy(),
        )  # fmt: skip
        return _Slot(batch, step)

    def _fill(self, slot: _Slot, q0: object, p0: object, parameters: Mapping[str, Any] | None) -> None:
        """The initial values and parameters of a run, which the slot holds only once all of them are checked."""
        from nearharmonic.engine.runs.continuation import start_of

        given = start_of(self, q0, p0, parameters)
        slot.batch.start[:], slot.batch.parameters[:] = given.state, given.parameters
        slot.given, slot.default = given, False


#: The name at the top of the package.
problem = Problem


def _unpickled(system: System, tableau: Tableau, t_end: str, numerics: Numerics, scale: float, samples: int) -> Problem:
    return Problem(
        system, tableau, precision=numerics.precision, energy=numerics.energy, t_end=t_end,
        energy_scale=scale or None, samples=samples, **numerics.handed_on,
    )  # fmt: skip


def checked_scale(value: object, key: str = "energy_scale") -> float:
    """Return the energy that errors are relative to; 0 for None.

    Raises
    ------
    SettingError
        Not a finite number above 0.
    """
    if value is None:
        return 0.0
    scale = float(exact(key, value))
    if not scale > 0:
        raise bad_setting(key, value, "a finite number above 0, in the unit of energy")
    return scale
