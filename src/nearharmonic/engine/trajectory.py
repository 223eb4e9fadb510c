"""Integrate one trajectory, a sweep over step sizes, or a planned run, and describe the results in words and units."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.batch import STANDARD, Floats, Integers, Trajectories, integrate_batch, kernel_of
from nearharmonic.engine.grid import check_fit, steps_of
from nearharmonic.engine.invariants import invariant_variables
from nearharmonic.engine.settings import (
    Numerics,
    checked_first,
    checked_precision,
    checked_samples,
    checked_t_end,
    checked_tau,
    exact_decimal,
)
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Variables, assembled, described
from nearharmonic.systems import systems
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    import xarray as xr

STATUS = "ok, or diverged: the run left its energy surface"


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
) -> xr.Dataset:
    """Integrate one trajectory over [0, t_end] in ``steps = max(1, round(t_end / tau))`` equal steps.

    Parameters
    ----------
    system, integrator : str, or System and Tableau
        Problem and method, or their names.
    tau : float
        Step size asked for, in the system's unit of time; the step as used is t_end / steps.
    t_end : float or str, optional
        End of the interval; a decimal string is exact. By default the system's own.
    precision : {"double", "extended"}
        "extended" computes in double-double (about 32 digits) and adds ``q_low`` and ``p_low``, the digits below ``q``
        and ``p``.
    summation : {"compensated", "plain"}
        Summation in double precision; double-double sums are compensated always.
    first : {"drift", "kick"}, optional
        Operator to which the row of s + 1 coefficients is given, in place of the tableau's own choice.
    samples : int
        Most samples, as evenly spaced as whole steps allow.

    Returns
    -------
    xarray.Dataset
        Over (sample, component): ``t``, ``q``, ``p``, ``energy_error`` = (H - H0)/|H0| at the samples; and the scalars
        ``tau``, ``max_energy_error`` and ``mean_energy_error`` of |H - H0|/|H0| over every step, ``steps``,
        ``evaluations`` of the force, ``status``, ``diverged_at``. Each invariant that the system declares stands under
        its name, and the largest deviation from its value at the start under ``<name>_drift``.

        A run that leaves its energy surface ends there: its status is "diverged", ``diverged_at`` its step, both errors
        infinite; later samples are left out.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed, before any work.
    """
    problem = _Problem(system, integrator, t_end, precision, summation, first)
    paths = problem.batch([problem.steps(tau)], checked_samples(samples))
    variables = _trajectory_variables(problem, paths) | _error_variables(paths) | problem.tau_variable(paths)
    if problem.system.invariants:
        variables |= invariant_variables(problem.system, paths.q, paths.p, paths.left_at > 0)
    return assembled(_first_run(variables), ["t"], problem.attributes())


def sweep(
    system: str | System,
    integrator: str | Tableau,
    taus: Iterable[float],
    *,
    t_end: float | str | None = None,
    precision: str = "double",
    summation: str = "compensated",
    first: str | None = None,
) -> xr.Dataset:
    """Integrate one run per step size, eight at a time in SIMD lanes, for their energy errors.

    Parameters
    ----------
    taus : iterable of float
        Step sizes asked for.
    system, integrator, t_end, precision, summation, first
        As for :func:`integrate`.

    Returns
    -------
    xarray.Dataset
        Over ``tau``, the step as used, in the order asked for: ``tau_requested``, ``max_energy_error`` and
        ``mean_energy_error`` over every step, ``steps``, ``evaluations``, ``status`` and ``diverged_at``, each bit for
        bit what :func:`integrate` finds for that step (the mean to rounding).

    Raises
    ------
    NearharmonicError
        An unknown name, no step size, or a setting outside what is allowed, before any work.
    """
    problem = _Problem(system, integrator, t_end, precision, summation, first)
    if hasattr(taus, "__array__"):
        asked = np.asarray(taus).ravel().tolist()
    elif isinstance(taus, Iterable) and not isinstance(taus, str):
        asked = list(taus)
    else:
        raise bad_setting("taus", taus, "a list of step sizes")
    if not asked:
        raise bad_setting("taus", asked, "at least one step size")
    requested = [checked_tau(tau, f"taus[{i}]") for i, tau in enumerate(asked)]
    paths = problem.batch([problem.steps(tau) for tau in requested], samples=2)
    one: Variables = {name: (("tau",), values, notes) for name, (_, values, notes) in _error_variables(paths).items()}
    unit = problem.system.units["t"]
    one["tau_requested"] = (("tau",), np.array(requested), described("step size asked for", unit))
    one["tau"] = ("tau",), problem.taus(paths.steps), described("step size", unit)
    return assembled(one, ["tau"], problem.attributes())


def sampled(
    system: str | System,
    integrator: str | Tableau,
    steps: Sequence[int],
    *,
    t_end: str,
    precision: str,
    summation: str,
    first: str | None,
    samples: int,
) -> Variables:
    """Integrate one run for each of ``steps``, without loading xarray; settings as in :func:`integrate`.

    Returns
    -------
    Variables
        t, q, p, energy_error and the system's observables over (tau_per_stage, sample, component); the maximum, the
        mean and the number of the steps since the previous sample over (tau_per_stage, sample); tau, steps,
        evaluations, status and diverged_at over tau_per_stage, which has no coordinate.
    """
    problem = _Problem(system, integrator, t_end, precision, summation, first)
    paths = problem.batch(steps, samples)
    path = _trajectory_variables(problem, paths)
    # The order of variables is that of the files.
    leading = {name: path.pop(name) for name in ("t", "q", "p", "energy_error")}
    errors = {name: value for name, value in _error_variables(paths).items() if not name.endswith("energy_error")}
    return {**leading, **_block_variables(paths), **path, **errors, **problem.tau_variable(paths)}


def warm_up(system: str, precisions: Sequence[str] = ("double",)) -> dict[str, Any]:
    """Compile the kernels of ``system`` into the cache, so that jobs side by side find them there."""
    for precision in precisions:
        kernel_of(systems[system], replace(STANDARD, precision=checked_precision(precision)))
    return {}


class _Problem:
    """A system, a tableau and how to integrate, all checked."""

    def __init__(
        self,
        system: str | System,
        integrator: str | Tableau,
        t_end: float | str | None,
        precision: str,
        summation: str,
        first: str | None,
    ) -> None:
        self.system = system if isinstance(system, System) else systems[system]
        tableau = integrator if isinstance(integrator, Tableau) else integrators[integrator]
        self.tableau = tableau.role(checked_first(first))  # type: ignore[arg-type]
        check_fit(self.system, self.tableau)
        self.t_end = checked_t_end(self.system.t_end if t_end is None else t_end)
        self.end = exact_decimal(self.t_end)
        self.numerics = Numerics(precision=precision, summation=summation)

    def steps(self, tau: object) -> int:
        return steps_of(self.t_end, checked_tau(tau))

    def taus(self, steps: Integers) -> Floats:
        """The step sizes as used, rounded once."""
        return np.array([self.end.numerator / (self.end.denominator * n) for n in steps.tolist()])

    def batch(self, steps: Sequence[int], samples: int) -> Trajectories:
        """One run per entry of ``steps``; equal entries are computed once."""
        distinct = list(dict.fromkeys(steps))
        paths = integrate_batch(
            self.system, self.tableau, t_end=self.end, steps=distinct, samples=samples, numerics=self.numerics
        )
        if len(distinct) == len(steps):
            return paths
        where = {n: i for i, n in enumerate(distinct)}
        return paths.take(np.array([where[n] for n in steps]))

    def tau_variable(self, paths: Trajectories) -> Variables:
        notes = described("step size as used, t_end / steps", self.system.units["t"])
        return {"tau": (("tau_per_stage",), self.taus(paths.steps), notes)}

    def attributes(self) -> dict[str, str]:
        return {
            "system": self.system.name,
            "integrator": self.tableau.name,
            "first": self.tableau.first,
            "t_end": self.t_end,
            "precision": self.numerics.precision,
            "summation": self.numerics.summation,
        }


def _error_variables(paths: Trajectories) -> Variables:
    status = np.where(paths.left_at > 0, "diverged", "ok")
    return _over_runs({
        "max_energy_error": (paths.max_energy_error, "maximum of |H - H0|/|H0| over every step, inf if diverged", "1"),
        "mean_energy_error": (paths.mean_energy_error, "mean of |H - H0|/|H0| over every step, inf if diverged", "1"),
        "steps": (paths.steps, "steps that cover [0, t_end]", "1"),
        "evaluations": (paths.evaluations, "force evaluations made", "1"),
        "status": (status, STATUS, "1"),
        "diverged_at": (paths.left_at, "step at which the run left its energy surface, 0 if it did not", "1"),
    })  # fmt: skip


def _first_run(variables: Variables) -> Variables:
    """The variables of the first run alone, up to the last sample that it reached."""
    kept = int(np.isfinite(variables["q"][1][0, :, 0]).sum())
    return {
        name: (dimensions[1:], values[0, :kept] if "sample" in dimensions else values[0], attributes)
        for name, (dimensions, values, attributes) in variables.items()
    }


def _block_variables(paths: Trajectories) -> Variables:
    length = np.where(paths.marks >= 0, np.diff(paths.marks, axis=1, prepend=0), 0)
    return _over_runs({
        "block_steps": (length, "steps since the previous sample", "1"),
        "block_max_energy_error": (paths.block_max, "maximum of |H - H0|/|H0| since the previous sample", "1"),
        "block_mean_energy_error": (paths.block_mean, "mean of |H - H0|/|H0| since the previous sample", "1"),
    })  # fmt: skip


def _trajectory_variables(problem: _Problem, paths: Trajectories) -> Variables:
    """States at the samples, their energy errors, and the system's observables."""
    system = problem.system
    units = system.units
    t = np.where(paths.marks >= 0, paths.marks * float(problem.end) / paths.steps[:, None], np.nan)
    table = {
        "t": (t, "time", units["t"]),
        "q": (paths.q, "position", units["q"]),
        "p": (paths.p, "momentum", units["p"]),
        "energy_error": (paths.energy_error, "(H - H0)/|H0|", "1"),
    }
    if problem.numerics.precision == "extended":
        table["q_low"] = (paths.q_low, "position, digits below q", units["q"])
        table["p_low"] = (paths.p_low, "momentum, digits below p", units["p"])
    if system.observables:
        q, p = (tuple(np.moveaxis(state, -1, 0)) for state in (paths.q, paths.p))
        constants = system.constants(float)
        for name, observable in system.observables.items():
            table[name] = (observable.function(q, p, *constants), observable.meaning, observable.unit)
    return _over_runs(table)


def _over_runs(table: dict[str, tuple[Any, str, str]]) -> Variables:
    """Described variables from (values, meaning, unit), whose first dimension is that of the runs."""
    dimensions = ("tau_per_stage", "sample", "component")
    return {name: (dimensions[: v.ndim], v, described(text, unit)) for name, (v, text, unit) in table.items()}
