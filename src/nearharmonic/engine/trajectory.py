"""Integrate one trajectory or a sweep over step sizes; problems that are prepared once for many calls; single steps."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property, partial
from math import isfinite
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.core.layout import ADVANCE, STEP
from nearharmonic.engine import description
from nearharmonic.engine.batch import Batch, Trajectories, least_samples, sample_marks, surface_limit, views_of
from nearharmonic.engine.kernels import STANDARD, kernel_of, most_lanes_of, physics_of
from nearharmonic.engine.numbers import list_of, moves, parameters_at_run_time, standard_parameters, standard_start
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_TAUS, WIDTH, checked_samples, checked_tau
from nearharmonic.engine.setup import Setup, Start, asked_steps, start_of, warn_of_step
from nearharmonic.errors import SettingError, bad_setting, warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.systems import systems
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.core.stepper import Step


# --- Result of one run of a prepared problem: lightweight; derived values are computed lazily.
class StepSize(NamedTuple):
    """A step size as used and as asked for, with its marks and moves."""

    tau: float
    tau_requested: float
    steps: int
    marks: Integers
    moves: Floats


class Solution:
    """One trajectory: ``t`` (S,), ``q`` and ``p`` (S, d), errors, steps and status, as :func:`integrate` has them.

    A run that left its energy surface keeps the samples until then; both errors are infinite.
    """

    __slots__ = ("__dict__", "_begin", "_diverged_at", "_results", "_step", "_width", "problem")

    def __init__(self, problem: Setup, step: StepSize, batch: Batch, begin: Start | None) -> None:
        self.problem, self._step, self._begin = problem, step, begin
        self._results, self._diverged_at = batch.results.copy(), int(batch.left_at[0])
        self._width = batch.start.shape[-1]

    @property
    def tau(self) -> float:
        """The step size as used."""
        return self._step.tau

    @property
    def tau_requested(self) -> float:
        """The step size asked for."""
        return self._step.tau_requested

    @property
    def steps(self) -> int:
        """Steps that cover the interval, in the fictitious time of a regularised system."""
        return self._step.steps if self.problem.system.regularisation is None else int(self.trajectories.done[0])

    @property
    def status(self) -> str:
        """ "ok", "diverged", or "not_converged" if an implicit step could not be solved."""
        if self._diverged_at and self.problem.tableau.implicit and self.trajectories.unsolved[0]:
            return description.UNSOLVED
        return "diverged" if self._diverged_at else "ok"

    @property
    def diverged_at(self) -> int:
        """The step at which the run left its energy surface, 0 if it did not."""
        return self._diverged_at

    @cached_property
    def trajectories(self) -> Trajectories:
        """The run as a batch of one."""
        arrays = views_of(self._step.marks, self._results, np.array([self._diverged_at]), self.problem.states_dimension)
        return self.problem.trajectories(np.array([self._step.steps]), arrays.without_start(self.problem.samples == 1))

    def _kept(self, name: str) -> Floats:
        rows: Floats = getattr(self.trajectories, name)[0]
        return rows[np.isfinite(self.trajectories.q[0, :, 0])]

    @property
    def t(self) -> Floats:
        """Times of the samples (S,)."""
        end = float(self.problem.end)
        return self._kept("marks") * end / self._step.steps

    def _states(self, part: int) -> Floats:
        """Columns of the states as the kernel left them: part 0 the positions, part 2 the momenta.

        They are read without the energies and evaluations, which cost more than a short run does.
        """
        samples, width = self._step.marks.size, self._width
        states = self._results[: samples * width].reshape(samples, width)[int(self.problem.samples == 1) :]
        kept = states[np.isfinite(states[:, 0])] if self._diverged_at else states
        first = part * width // 4
        return kept[:, first : first + self.problem.system.dimension].copy()

    @property
    def q(self) -> Floats:
        """Positions (S, d)."""
        return self._states(0)

    @property
    def p(self) -> Floats:
        """Momenta (S, d)."""
        return self._states(2)

    @property
    def energy_error(self) -> Floats:
        """(H - H0)/|H0| at the samples (S,)."""
        return self._kept("energy_error")

    @property
    def max_energy_error(self) -> float:
        """Maximum of its modulus over every step."""
        return float(self.trajectories.max_energy_error[0])

    @property
    def mean_energy_error(self) -> float:
        """Mean of its modulus over every step."""
        return float(self.trajectories.mean_energy_error[0])

    @property
    def evaluations(self) -> int:
        """Evaluations of the force."""
        return int(self.trajectories.evaluations[0])

    def __repr__(self) -> str:
        return (
            f"Solution({self.problem!r}, tau={self.tau:g}, {self.status}, max_energy_error={self.max_energy_error:.2g})"
        )

    def to_dataset(self) -> xr.Dataset:
        """Return the run as :func:`nearharmonic.integrate` does."""
        begin = self._begin or start_of(self.problem)
        return description.trajectory_dataset(self.problem, self.trajectories, begin=begin, asked=self.tau_requested)


# --- Runs of one method on one system, prepared once for many calls.

#: Step sizes whose coefficients a problem keeps: half a kilobyte each.
MOST_STEP_SIZES = 4096


@dataclass(slots=True)
class _Slot:
    """A batch of one run, with what its arrays hold; ``given`` is None for the system's own start."""

    batch: Batch
    step: StepSize
    given: Start | None = None


class Problem(Setup):
    """Runs of one method on one system, prepared for calls that take microseconds.

    A call ``run(tau, q0=None, p0=None, parameters=None)`` integrates one trajectory, from several threads at once if
    wanted. The three arguments are as for :func:`nearharmonic.integrate`. The result has the arrays ``t`` (S,), ``q``
    and ``p`` (S, d) of its S samples, ``energy_error`` (S,), and the numbers ``max_energy_error``,
    ``mean_energy_error``, ``tau``, ``tau_requested``, ``steps``, ``evaluations``, ``status`` and ``diverged_at``; its
    method ``to_dataset()`` returns the Dataset of :func:`nearharmonic.integrate`.

    Parameters
    ----------
    system, integrator, precision, summation, first, energy, t_end, energy_scale, split
        As for :func:`nearharmonic.integrate`.
    samples : int
        Most states that a run keeps, by default the first and the last.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> run = nh.problem("henon_heiles", "babps8o7h", t_end=100)
    >>> [f"{run(tau).max_energy_error:.1e}" for tau in (0.8, 0.4)]
    ['9.5e-07', '1.2e-08']
    """

    @cached_property
    def _step_sizes(self) -> dict[Any, StepSize]:
        return {}

    @cached_property
    def _slots(self) -> dict[int, list[_Slot]]:
        return {}

    def __reduce__(self) -> tuple[Any, ...]:
        settings = partial(
            Problem, precision=self.numerics.precision, energy=self.numerics.energy, t_end=self.t_end,
            energy_scale=self.scale or None, samples=self.samples, **self.numerics.shared_settings,
        )  # fmt: skip
        return settings, (self.system, self.tableau)

    def __repr__(self) -> str:
        return f"Problem({self.system.name!r}, {self.tableau.name!r}, t_end={self.t_end})"

    @property
    def memory(self) -> int:
        """Bytes that a trajectory works in, beside the states that are kept."""
        kernel = kernel_of(self.system, replace(self.numerics, width=1).compiled, **self.tableau.kernel_options)
        return sum(array.nbytes for array in kernel.workspace(self.tableau.moves_per_step))

    def __call__(
        self, tau: float, q0: object = None, p0: object = None, parameters: Mapping[str, Any] | None = None
    ) -> Solution:
        """Integrate one trajectory with a step size ``tau``; from several threads at once if wanted.

        The step as used is t_end / steps; a difference of 1 % or more is warned of. ``q0``, ``p0`` and ``parameters``
        by name take the place of the system's own: strings and fractions exact, floats as their binary value. Values
        outside what is allowed are refused before any work.
        """
        try:
            step = self._step_sizes.get((type(tau), tau))  # True equals 1.0
        except TypeError:  # a list or an array
            step = None
        if step is None:
            step = self._prepared_step(tau)
            warn_of_step(self, [step.tau_requested], [step.steps])
        slots = self._slots.setdefault(step.marks.size, [])
        try:
            slot = slots.pop()  # a call in another thread finds another slot, or makes one
        except IndexError:
            start, own = standard_start(self.system, self.plain), standard_parameters(self.system)
            batch = self.batch(
                step.moves.copy(), step.marks.copy(), np.zeros(1, np.int64), start[None, :].copy(),
                own[None, :].copy(), replace(self.numerics, width=1),
            )  # fmt: skip
            slot = _Slot(batch, step)
        if slot.step is not step:
            slot.batch.marks[:], slot.batch.moves[:] = step.marks, step.moves
            slot.step = step
        if q0 is not None or p0 is not None or parameters is not None:
            given = start_of(self, q0, p0, parameters)
            slot.batch.start[:], slot.batch.parameters[:] = given.state, given.parameters
            slot.given = given
        elif slot.given is not None:
            slot.batch.start[:] = standard_start(self.system, self.plain)
            slot.batch.parameters[:] = standard_parameters(self.system)
            slot.given = None
        slot.batch.run(step.steps)
        solution = Solution(self, step, slot.batch, slot.given)
        slots.append(slot)
        return solution

    def _prepared_step(self, tau: object) -> StepSize:
        steps = self.steps_of(tau)
        size, marks = self.end / steps, sample_marks(np.array([steps]), self.samples)
        step = StepSize(float(size), checked_tau(tau), steps, marks, self.moves([size]))
        if len(self._step_sizes) >= MOST_STEP_SIZES:
            self._step_sizes.clear()
        self._step_sizes[type(tau), tau] = step
        return step


#: The name at the top of the package.
problem = Problem


# --- A step as a function of numba, for programs that compose steps themselves.


def stepper(
    system: str | System,
    integrator: str | Tableau,
    *,
    summation: str = "plain",
    parameters: Mapping[str, Any] | None = None,
    first: str | None = None,
    precision: str = "double",
    split: str = KINETIC_POTENTIAL,
) -> Any:
    """Return a function of numba that advances a state by one step.

    Parameters
    ----------
    system, integrator
        As for :func:`nearharmonic.integrate`.
    summation : {"plain", "compensated"}
        Summation of the steps.
    parameters : mapping, optional
        Values of parameters by name in place of the system's own, as for :func:`nearharmonic.integrate`.
    first
        As for :func:`nearharmonic.integrate`.
    precision, split
        "double" and "kinetic_potential": a step has no others.

    Returns
    -------
    callable
        ``step(q, p, tau)``, or ``step(q, p, carry_q, carry_p, tau)`` for compensated sums, compiled by numba and to be
        called from functions of numba, in threads if wanted, or from Python. The C-contiguous float64 arrays (d,) are
        changed in place; if the system depends on time, they end with the time and its momentum. ``tau`` is a
        finite number of either sign and means its binary value. A call has the bits of a run of one step of
        :func:`nearharmonic.integrate`. Arrays of another length raise ValueError, and from Python other arguments
        SettingError.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> import numpy as np
    >>> q, p = np.array([1.0]), np.array([0.0])
    >>> nh.stepper("sho", "leapfrog")(q, p, 0.5)
    >>> print(q, p)
    [0.875] [-0.46875]
    """
    from nearharmonic.core import stepper as compiled

    problem = Setup(
        system, integrator, summation=summation, first=first, precision=precision, split=split, energy="none"
    )
    check_single_step(problem)
    return compiled.stepper(step_of(problem, parameters))


def step_of(problem: Setup, parameters: Mapping[str, Any] | None = None) -> Step:
    """Return the machine code and the coefficients of a step of ``problem``."""
    from nearharmonic.core.kernel import build_step, room
    from nearharmonic.core.stepper import Step

    system, tableau = problem.system, problem.tableau
    numerics = replace(problem.numerics, width=1)
    given = parameters_at_run_time(system, numerics, start_of(problem, parameters=parameters).parameters)
    table, flags, power = coefficients_of(tableau)
    physics = physics_of(system, **tableau.kernel_options)
    in_memory = physics.loops is not None or tableau.implicit
    if in_memory:
        function = kernel_of(system, numerics.compiled, **tableau.kernel_options).advance
    else:
        function = build_step(physics, compensated=numerics.compensated)
    return Step(
        name=system.name,
        address=function.address,
        signature=ADVANCE if in_memory else STEP,
        dimension=physics.dimension,
        room=room(physics, extended=False),
        stages=physics.stage_count,
        compensated=numerics.compensated,
        kick_first=tableau.first_same_as_last,
        table=table,
        flags=flags,
        power=power,
        parameters=given[0].copy(),
    )


def coefficients_of(tableau: Tableau) -> tuple[Floats, Floats, int]:
    """Return table, flags and power of the moves: see :func:`nearharmonic.core.stepper.fill`."""
    from nearharmonic.core.stepper import table_of

    rows, flags, power = tableau.moves(), np.zeros(tableau.moves_per_step + 2), 2
    if tableau.modified:
        power, flags = 3, np.ascontiguousarray(moves(tableau, [Fraction(1)], 1)[0, :, -1])
    else:
        rows = [(k, e, k * e) for k, e, _ in rows]
    return table_of(rows, (1, 1, power)), flags, power


def check_single_step(problem: Setup) -> None:
    """Raise an error for settings that a single step does not have."""
    system, tableau, numerics = problem.system, problem.tableau, problem.numerics
    if numerics.parts > 1:
        raise bad_setting("precision", numerics.precision, "the arrays of a step are doubles")
    if numerics.exact_oscillator:
        raise bad_setting("split", numerics.split, "the sines of a step size are computed before a run, in decimals")
    if system.regularisation is not None:
        raise bad_setting("system", system.name, "it is regularised, and its steps are in a fictitious time")
    if tableau.processed:
        what = "it is processed: each step by itself would begin and end with its processor"
        raise bad_setting("integrator", tableau.name, what)


# --- One trajectory, and sweeps over step sizes.


def integrate(
    system: str | System,
    integrator: str | Tableau,
    tau: float,
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    samples: int = 1000,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    t: object = None,
    energy: str = "every",
    energy_scale: float | str | None = None,
    start: xr.Dataset | Solution | None = None,
    split: str = KINETIC_POTENTIAL,
) -> xr.Dataset:
    """Integrate one trajectory over [0, t_end] in ``steps = max(1, round(|t_end| / tau))`` equal steps.

    Parameters
    ----------
    system, integrator : str, or System and Tableau
        Problem and method, or their names.
    tau : float
        Step size asked for, in the system's unit of time; the step as used is t_end / steps. A difference of 1 % or
        more is warned of.
    t_end : float or str, optional
        End of the interval; a decimal string is exact, and a negative one runs backwards. By default the system's own.
    precision : {"double", "extended"}
        "extended" computes in double-double (about 32 digits).
    summation : {"compensated", "plain"}
        Summation in double precision; double-double sums are compensated always.
    first : {"drift", "kick"}, optional
        Operator to which the row of s + 1 coefficients is given, in place of the tableau's own choice.
    samples : int
        Most samples, as evenly spaced as whole steps allow.
    q0, p0 : sequence of d numbers or strings, optional
        Initial values in place of the system's own: decimal strings and fractions are exact, floats mean their binary
        value. A single number does for one coordinate.
    parameters : mapping, optional
        Values of parameters by name in place of the system's own, as ``q0``. New values compile nothing.
    t : sequence of float or str, optional
        Output times in place of ``samples``, sorted, inside [0, t_end]. Those between two steps are reached by one
        shorter step of the method from the step before, which the run itself does not take.
    energy : {"every", "samples", "none"}
        Times of measurements of the energy: every step, the samples, or none. With samples, errors are over the samples
        and divergence is seen at a sample. With none, errors are NaN, a run diverges only if its state is not finite,
        and a last state off the energy surface gives a warning.
    energy_scale : float or str, optional
        Energy that errors are relative to, in the system's unit; by default ``|H0|``, or that unit where H0 = 0.
    start : xarray.Dataset or Solution, optional
        Continue from the last sample of this result, with its parameters and relative to its H0. ``t_end`` is then the
        length of the continuation. The result is bitwise identical to one long run. An edited last sample is taken as
        the new start. Maximum and mean of the errors are over the steps of the continuation alone, or, with energies at
        the samples, over its samples, which one long run has at other steps.
    split : {"kinetic_potential", "exact_oscillator"}
        What the two operators of the method solve: T by drifts and V by kicks; or, for a system that declares
        ``frequencies`` w, p.p/2 + sum w_i^2 q_i^2 / 2 by rotations in place of drifts, and the rest of V by kicks.

    Returns
    -------
    xarray.Dataset
        Over (sample, component): ``t``, ``q``, ``p``, ``energy_error`` = ``(H - H0)/|H0|`` at the samples, with
        ``q_low`` and ``p_low``, the digits below ``q`` and ``p``, unless the summation is plain; what the system
        records and conserves, with ``<invariant>_drift``; and the scalars ``tau``, ``max_energy_error`` and
        ``mean_energy_error`` of ``|H - H0|/|H0|`` over every step, ``steps``, ``evaluations`` of the force, ``status``,
        ``diverged_at``, ``initial_energy``; ``running``, from which ``start`` goes on with the same step size. A run
        that leaves its energy surface ends there: its status is "diverged", ``diverged_at`` its step, both errors
        infinite; later samples are left out. The attribute ``tau_requested`` is the step size asked for.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> run = nh.integrate("henon_heiles", "babps8o7h", 0.8)
    >>> print(f"{run.max_energy_error.item():.1e}")
    1.0e-06
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy=energy,
        energy_scale=energy_scale, split=split,
    )  # fmt: skip
    begin = start_of(problem, q0, p0, parameters, start.to_dataset() if isinstance(start, Solution) else start)
    (steps, asked_tau), kept = asked_steps(problem, tau), checked_samples(samples)
    arrays = begin.arrays(problem, steps)
    if t is None:
        paths = problem.run([steps], kept, **arrays)
        times = paths.marks * float(problem.end) / paths.steps[:, None] + begin.t if begin.t else None
    else:
        asked = description.checked_times(t, problem)
        paths = description.run_at(problem, [steps], asked, **arrays)
        times = np.array([float(time) for time in asked]) + begin.t
    _check_start(problem, paths)
    if problem.numerics.energy == "none" and not problem.system.time_dependent:
        _warn_of_plunge(problem, begin.state[0], paths, begin.constants)
    return description.trajectory_dataset(problem, paths, begin=begin, asked=asked_tau, times=times)


def sweep(
    system: str | System,
    integrator: str | Tableau,
    taus: Iterable[float] | None = None,
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
    q0: object = None,
    p0: object = None,
    parameters: Mapping[str, Any] | None = None,
    t: object = None,
    energy: str = "every",
    energy_scale: float | str | None = None,
    split: str = KINETIC_POTENTIAL,
    tau_per_stage: Iterable[float] | None = None,
) -> xr.Dataset:
    """Integrate one run per step size, side by side in SIMD lanes, for their energy errors.

    A run covers [0, t_end] in ``max(1, round(|t_end| / tau))`` equal steps.

    Parameters
    ----------
    system, integrator : str, or System and Tableau
        As for :func:`nearharmonic.integrate`.
    taus : iterable of float
        Step sizes asked for, in the system's unit of time; this or ``tau_per_stage``.
    t_end, precision, summation, first, q0, p0, parameters
        As for :func:`nearharmonic.integrate`.
    t : sequence of float or str, optional
        Times at which the states of each run are returned as well.
    energy, energy_scale, split
        As for :func:`nearharmonic.integrate`; with ``energy="samples"`` the energy is measured at the times ``t``, or
        at the end.
    tau_per_stage : iterable of float
        Step sizes over the stages of the method, in place of ``taus``: equal ones have equal cost for all methods.

    Returns
    -------
    xarray.Dataset
        Over ``tau``, the step as used, in the order asked for: ``tau_requested``, ``max_energy_error`` and
        ``mean_energy_error`` over every step, ``steps``, ``evaluations``, ``status`` and ``diverged_at``, each bit for
        bit what :func:`nearharmonic.integrate` finds for that step (the mean to rounding). With ``t`` also ``t``,
        ``q``, ``p`` and ``energy_error`` over (tau, sample, component).

    Raises
    ------
    NearharmonicError
        An unknown name, no step size, or a setting outside what is allowed, before any work.
    KeyboardInterrupt
        Ctrl-C, within a fraction of a second.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> found = nh.sweep("henon_heiles", "babps8o7h", [0.8, 0.4])
    >>> [f"{error:.1e}" for error in found.max_energy_error.values]
    ['1.0e-06', '1.2e-08']
    """
    problem = Setup(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, energy=energy,
        energy_scale=energy_scale, split=split,
    )  # fmt: skip
    if (taus is None) == (tau_per_stage is None):
        raise bad_setting("taus", taus, "a list of step sizes, or tau_per_stage in its place: exactly one of the two")
    key, given = ("taus", taus) if tau_per_stage is None else ("tau_per_stage", tau_per_stage)
    stages = 1 if tau_per_stage is None else problem.tableau.stages
    asked_taus = list_of(key, given, "a list of step sizes", MOST_TAUS)
    if not asked_taus:
        raise bad_setting(key, asked_taus, "at least one step size")
    requested = [stages * checked_tau(tau, f"{key}[{i}]") for i, tau in enumerate(asked_taus)]
    begin = start_of(problem, q0, p0, parameters)
    times = "" if tau_per_stage is None else f"{stages} * "
    steps = [problem.steps_of(tau, f"{times}{key}[{i}]") for i, tau in enumerate(requested)]
    warn_of_step(problem, requested, steps, f"{times}{key}")
    variables: Variables = {}
    if t is None:
        paths = problem.run(steps, least_samples(problem.tableau), start=begin.state, parameters=begin.parameters)
    else:
        asked = description.checked_times(t, problem)
        paths = description.run_at(
            problem, steps, asked, start=begin.state, parameters=begin.parameters, reference=begin.reference
        )
        variables = description.trajectory_variables(
            problem, paths, begin.constants, np.array([float(time) for time in asked])
        )
        variables |= description.invariant_variables(problem, paths, begin)
    _check_start(problem, paths)
    variables |= description.error_variables(paths, problem)
    one = description.over("tau", variables)
    unit = problem.system.units["t"]
    one["tau_requested"] = (("tau",), np.array(requested), described("step size asked for", unit))
    one["tau"] = ("tau",), problem.taus(paths.steps), described("step size", unit)
    notes = description.problem_attributes(problem) | begin.attributes()
    notes |= problem.floor(begin.state, begin.parameters, paths.energy[:1])
    return assembled(one, ["tau"], notes)


def _check_start(problem: Setup, paths: Trajectories) -> None:
    """Refuse a start at which the energy is no number: the run has ended at its first step."""
    H = float(paths.energy[0])
    if problem.numerics.energy != "none" and not isfinite(H):
        start = f"({paths.q[0, 0].tolist()}, {paths.p[0, 0].tolist()})"
        raise SettingError(f"(q0, p0) = {start} is not allowed: the energy of {problem.system.name} there is {H}")


def _warn_of_plunge(problem: Setup, start: Floats, paths: Trajectories, constants: Sequence[float]) -> None:
    """Warn of a run without energies that ends off its energy surface, by the energies of its two ends."""
    d, energy = paths.q.shape[-1], problem.system.energy
    with np.errstate(all="ignore"):
        try:
            H0 = float(energy(start[:d].tolist(), start[2 * d : 3 * d].tolist(), constants))
            change = abs(float(energy(paths.q[0, -1].tolist(), paths.p[0, -1].tolist(), constants)) - H0)
        except ArithmeticError:  # not even a number: the status says so, or the last state is at a pole
            return
    unit = problem.scale or abs(H0)
    if change > surface_limit(problem.system, problem.scale) * unit > 0:
        message = f"energy='none' checks nothing: at the end H is off by {change:.2g}, and H0 = {H0:.2g}"
        warn_caller(message)


def warm_up(system: str, precisions: Sequence[str] = ("double",)) -> dict[str, Any]:
    """Compile the kernels for sweeps of ``system`` into the cache, so that jobs side by side find them there."""
    for numerics in (replace(STANDARD, precision=precision) for precision in precisions):
        width = min(2 * WIDTH, most_lanes_of(systems[system], numerics))  # of more, a sweep lets some idle
        kernel_of(systems[system], replace(numerics, width=width))
    return {}
