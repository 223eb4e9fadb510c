"""Integrate one trajectory, a sweep over step sizes, or a planned run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.description import (
    checked_times,
    error_variables,
    invariant_variables,
    over,
    problem_attributes,
    run_at,
    trajectory_dataset,
    trajectory_variables,
)
from nearharmonic.engine.execution import Trajectories, least_samples, surface_limit
from nearharmonic.engine.kernels import STANDARD, kernel_of
from nearharmonic.engine.numbers import list_of
from nearharmonic.engine.settings import KINETIC_POTENTIAL, MOST_TAUS, checked_samples, checked_tau
from nearharmonic.engine.setup import Setup, asked_steps, start_of, warn_of_step
from nearharmonic.engine.solution import Solution
from nearharmonic.errors import SettingError, bad_setting, warn_caller
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import Variables, assembled, described
from nearharmonic.systems import systems
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr


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
        When the energy is measured: at every step; at the samples, so that errors are over the samples and a run counts
        as diverged at the first sample that says so; never: errors are NaN, and only what is not finite has diverged;
        a warning says so if the last state is off the energy surface.
    energy_scale : float or str, optional
        Energy that errors are relative to, in the system's unit; by default ``|H0|``, or that unit where H0 = 0.
    start : xarray.Dataset or Solution, optional
        Continue from the last sample of this result, with its parameters and relative to its H0. ``t_end`` is then the
        length of the continuation. The bits are those of one long run, unless the last sample has been edited: the run
        then goes on from what it says. Maximum and mean of the errors are over the steps of the continuation alone; or,
        with energies at the samples, over its samples, which one long run has at other steps.
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
        asked = checked_times(t, problem)
        paths = run_at(problem, [steps], asked, **arrays)
        times = np.array([float(time) for time in asked]) + begin.t
    _check_start(problem, paths)
    if problem.numerics.energy == "none" and not problem.system.time_dependent:
        _warn_of_plunge(problem, begin.state[0], paths, begin.constants)
    return trajectory_dataset(problem, paths, begin=begin, asked=asked_tau, times=times)


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
    requested = [stages * tau for tau in _checked_taus(key, given)]
    begin = start_of(problem, q0, p0, parameters)
    times = "" if tau_per_stage is None else f"{stages} * "
    steps = [problem.steps_of(tau, f"{times}{key}[{i}]") for i, tau in enumerate(requested)]
    warn_of_step(problem, requested, steps, f"{times}{key}")
    variables: Variables = {}
    if t is None:
        paths = problem.run(steps, least_samples(problem.tableau), start=begin.state, parameters=begin.parameters)
    else:
        asked = checked_times(t, problem)
        paths = run_at(problem, steps, asked, start=begin.state, parameters=begin.parameters, reference=begin.reference)
        variables = trajectory_variables(problem, paths, begin.constants, np.array([float(time) for time in asked]))
        variables |= invariant_variables(problem, paths, begin.state, begin.constants)
    _check_start(problem, paths)
    variables |= error_variables(paths, problem)
    one = over("tau", variables)
    unit = problem.system.units["t"]
    one["tau_requested"] = (("tau",), np.array(requested), described("step size asked for", unit))
    one["tau"] = ("tau",), problem.taus(paths.steps), described("step size", unit)
    notes = problem_attributes(problem) | begin.attributes()
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


def _checked_taus(key: str, taus: object) -> list[float]:
    asked = list_of(key, taus, "a list of step sizes", MOST_TAUS)
    if not asked:
        raise bad_setting(key, asked, "at least one step size")
    return [checked_tau(tau, f"{key}[{i}]") for i, tau in enumerate(asked)]


def warm_up(system: str, precisions: Sequence[str] = ("double",)) -> dict[str, Any]:
    """Compile the kernels of ``system`` into the cache, so that jobs side by side find them there."""
    for precision in precisions:
        kernel_of(systems[system], replace(STANDARD, precision=precision))
    return {}
