"""Integrate one trajectory, a sweep over step sizes, or a planned run, and say in words what each number is."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.batch import Trajectories, integrate_batch, kernel_of
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.plan import (
    Run,
    check_fit,
    checked_first,
    checked_precision,
    checked_samples,
    checked_summation,
    checked_t_end,
    checked_tau,
    steps_of,
)
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

#: name -> (dimensions, values, attributes): what xarray.Dataset takes, without loading xarray.
Variables = dict[str, tuple[tuple[str, ...], Any, dict[str, str]]]

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
    """One trajectory of ``system`` over [0, t_end] in ``steps = max(1, round(t_end / tau))`` equal steps.

    Returns a Dataset over (sample, component): t, q, p, energy_error = (H - H0)/|H0| at up to ``samples`` evenly spaced
    steps, and the scalars tau (as used), max_energy_error and mean_energy_error of |H - H0|/|H0| over every step,
    steps, evaluations (of the force), status and diverged_at. A run that leaves its energy surface ends there: status
    "diverged", diverged_at its step, both errors infinite, and only the samples before it.

    ``precision`` "extended" computes in double-double (about 32 digits) and adds q_low and p_low, the digits below q
    and p; double-double addition is compensated by itself, so ``summation`` matters in "double" only. ``first`` gives
    the row of s + 1 coefficients to "drift" or "kick" instead of the operator the tableau names.

    Raises:
        NearharmonicError: an unknown name, or a setting outside what is allowed, before any work.
    """
    import xarray as xr

    problem = _Problem(system, integrator, t_end, precision, summation, first)
    paths = problem.batch([problem.steps(tau)], checked_samples(samples))
    described = _trajectory_variables(problem, paths) | _error_variables(paths) | problem.tau_variable(paths)
    kept = int(np.isfinite(paths.q[0, :, 0]).sum())
    one: Variables = {}
    for name, (dimensions, values, attributes) in described.items():
        if name.startswith("block_"):
            continue
        cut = values[0, :kept] if "sample" in dimensions else values[0]
        one[name] = (dimensions[1:], cut, attributes)
    dataset = xr.Dataset(one, attrs=problem.attributes())
    return dataset.set_coords("t")


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
    """The energy errors of one run per step size, eight runs at a time in SIMD lanes.

    Returns a Dataset over ``tau`` (the step as used, t_end / steps, in the order asked for; ``tau_requested`` beside
    it) with max_energy_error and mean_energy_error over every step, steps, evaluations, status and diverged_at, each
    bit for bit what :func:`integrate` finds for that step (the mean to rounding). Settings as there.

    Raises:
        NearharmonicError: an unknown name, no step size, or a setting outside what is allowed, before any work.
    """
    import xarray as xr

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
    described = _error_variables(paths)
    one: Variables = {name: (("tau",), values, notes) for name, (_, values, notes) in described.items()}
    unit = problem.system.units["t"]
    one["tau_requested"] = (("tau",), np.array(requested), {"units": unit, "long_name": "step size asked for"})
    tau = ("tau",), problem.taus(paths.steps), {"units": unit, "long_name": "step size"}
    return xr.Dataset(one, coords={"tau": tau}, attrs=problem.attributes())


def integrate_run(run: Run) -> Variables:
    """What a planned run stores: trajectories over (tau_per_stage, sample, component), blocks, errors' ingredients.

    ``block_max_energy_error`` and ``block_mean_energy_error`` cover the ``block_steps`` steps since the sample before,
    so the maximum and mean over every step follow from the file exactly.
    """
    problem = _Problem(run.system, run.integrator, run.t_end, run.precision, run.summation, run.first)
    paths = problem.batch(run.steps, run.samples)
    unit = problem.system.units["t"]
    grid = (("tau_per_stage",), np.array(run.tau_per_stage), {"units": unit, "long_name": "step size per stage"})
    errors = {name: value for name, value in _error_variables(paths).items() if not name.endswith("energy_error")}
    return {"tau_per_stage": grid, **_trajectory_variables(problem, paths), **errors, **problem.tau_variable(paths)}


def warm_up(system: str, precisions: Sequence[str] = ("double",)) -> None:
    """Compile the kernels of ``system`` into the cache, so that jobs side by side find them there."""
    for precision in precisions:
        kernel_of(systems[system], checked_precision(precision), "compensated")


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
        self.precision, self.summation = checked_precision(precision), checked_summation(summation)

    def steps(self, tau: object) -> int:
        return steps_of(self.t_end, checked_tau(tau))

    def taus(self, steps: Any) -> Any:
        return np.array([float(Fraction(self.t_end) / int(n)) for n in steps])

    def batch(self, steps: Sequence[int], samples: int) -> Trajectories:
        """One run per entry of ``steps``; equal entries are computed once."""
        distinct, where = np.unique(np.asarray(steps, dtype=np.int64), return_inverse=True)
        paths = integrate_batch(
            self.system,
            self.tableau,
            t_end=Fraction(self.t_end),
            steps=distinct,
            samples=samples,
            precision=self.precision,
            summation=self.summation,
        )
        return paths.take(where)

    def tau_variable(self, paths: Trajectories) -> Variables:
        notes = {"units": self.system.units["t"], "long_name": "step size as used, t_end / steps"}
        return {"tau": (("tau_per_stage",), self.taus(paths.steps), notes)}

    def attributes(self) -> dict[str, str]:
        return {
            "system": self.system.name,
            "integrator": self.tableau.name,
            "first": self.tableau.first,
            "t_end": self.t_end,
            "precision": self.precision,
            "summation": self.summation,
        }


def _error_variables(paths: Trajectories) -> Variables:
    status = np.where(paths.left_at > 0, "diverged", "ok")
    table = {
        "max_energy_error": (paths.max_energy_error, "1", "maximum of |H - H0|/|H0| over every step, inf if diverged"),
        "mean_energy_error": (paths.mean_energy_error, "1", "mean of |H - H0|/|H0| over every step, inf if diverged"),
        "steps": (paths.steps, "1", "steps that cover [0, t_end]"),
        "evaluations": (paths.evaluations, "1", "force evaluations made"),
        "status": (status, "1", STATUS),
        "diverged_at": (paths.left_at, "1", "step at which the run left its energy surface, 0 if it did not"),
    }
    return {k: (("tau_per_stage",), v, {"units": unit, "long_name": text}) for k, (v, unit, text) in table.items()}


def _trajectory_variables(problem: _Problem, paths: Trajectories) -> Variables:
    system = problem.system
    units = system.units
    end = float(Fraction(problem.t_end))
    t = np.where(paths.marks >= 0, paths.marks * end / paths.steps[:, None], np.nan)
    length = np.where(paths.marks >= 0, np.diff(paths.marks, axis=1, prepend=0), 0)
    table = {
        "t": (t, units["t"], "time"),
        "q": (paths.q, units["q"], "position"),
        "p": (paths.p, units["p"], "momentum"),
        "energy_error": (paths.energy_error, "1", "(H - H0)/|H0|"),
        "block_steps": (length, "1", "steps since the previous sample"),
        "block_max_energy_error": (paths.block_max, "1", "maximum of |H - H0|/|H0| since the previous sample"),
        "block_mean_energy_error": (paths.block_mean, "1", "mean of |H - H0|/|H0| since the previous sample"),
    }
    if problem.precision == "extended":
        table["q_low"] = (paths.q_low, units["q"], "position, digits below q")
        table["p_low"] = (paths.p_low, units["p"], "momentum, digits below p")
    parameters = [float(Fraction(p.value)) for p in system.parameters.values()]
    q, p = (tuple(np.moveaxis(state, -1, 0)) for state in (paths.q, paths.p))
    for name, observable in system.observables.items():
        table[name] = (observable.function(q, p, *parameters), observable.unit, observable.meaning)
    dimensions = ("tau_per_stage", "sample", "component")
    return {k: (dimensions[: v.ndim], v, {"units": unit, "long_name": text}) for k, (v, unit, text) in table.items()}
