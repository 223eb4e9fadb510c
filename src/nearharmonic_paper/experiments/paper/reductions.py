"""Reductions of runs: an ``xarray.Dataset`` of the runs of one method on one system in, numbers for the cube out.

A reduction is a function below ``@reduction(...)``, which names the variables that it needs: those of a run file, over
(tau_per_stage, sample, component). Attributes of the dataset name ``system`` and ``integrator``. With
``over="tau_per_stage"`` a reduction takes the whole curves of the cube instead. No integration depends on this module.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf

import xarray as xr

from nearharmonic.engine import invariants
from nearharmonic.engine.description import SINCE
from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import linear_trend, trend_linearity
from nearharmonic.numerics.portable import observed_order as order_of_curve
from nearharmonic.output.dataset import described
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.tasks.reduction import Reductions, exact_sum

reduction = Reductions()


@reduction("block_max_energy_error", "status")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Maximum over every step of |H - H0|/|H0|; infinite for a run that left its energy surface."""
    return _over_every_step(runs, runs.block_max_energy_error, runs.block_max_energy_error.max("sample"))


@reduction("block_mean_energy_error", "block_steps", "steps", "status")
def mean_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Mean over every step of |H - H0|/|H0|; infinite for a run that left its energy surface."""
    blocks = (runs.block_mean_energy_error * runs.block_steps).where(runs.status == "ok")
    return _over_every_step(runs, runs.block_mean_energy_error, exact_sum(blocks, "sample") / runs.steps)


def _over_every_step(runs: xr.Dataset, blocks: xr.DataArray, values: xr.DataArray) -> xr.DataArray:
    text = blocks.attrs["long_name"].replace(SINCE, "over every step, inf if diverged")
    return values.where(runs.status != "diverged", inf).assign_attrs(described(text, blocks.attrs["units"]))


@reduction("t", "perihelion_angle", "status")
def perihelion_advance(runs: xr.Dataset) -> xr.Dataset:
    """Advance of the perihelion per orbit, signed, and the half width of its 95 % interval, by regression."""
    period = orbital_period(systems[runs.attrs["system"]])
    slope, width = (value * period for value in _over_samples(linear_trend, runs))
    interval = "half width of the 95 % interval of the perihelion advance per orbit"
    return xr.Dataset({
        "perihelion_advance": slope.assign_attrs(described("perihelion advance per orbit", "rad")),
        "perihelion_advance_interval": width.assign_attrs(described(interval, "rad")),
    })  # fmt: skip


@reduction("t", "perihelion_angle", "status")
def perihelion_linearity(runs: xr.Dataset) -> xr.Dataset:
    """Coefficient of determination of the regression for the perihelion advance, and the ratio of its two halves."""
    determination, halves = _over_samples(trend_linearity, runs)
    line = "coefficient of determination R^2 of the perihelion angle as a linear function of time"
    ratio = "perihelion advance in the second half of the samples over that in the first"
    return xr.Dataset({
        "perihelion_advance_linearity": determination.assign_attrs(described(line)),
        "perihelion_advance_halves": halves.assign_attrs(described(ratio)),
    })  # fmt: skip


def _over_samples(fit: Callable[..., tuple[float, float]], runs: xr.Dataset) -> Iterator[xr.DataArray]:
    """The two numbers of a ``fit`` to times and perihelion angles of each run, NaN for a run that diverged."""
    found = xr.apply_ufunc(
        fit, runs.t, runs.perihelion_angle, input_core_dims=[["sample"], ["sample"]], output_core_dims=[[], []],
        vectorize=True,
    )  # fmt: skip
    return (value.where(runs.status == "ok") for value in found)


@reduction("tau", "perihelion_angle")
def evaluations_per_orbit(runs: xr.Dataset) -> xr.DataArray:
    """Force evaluations in one period of the exact orbit."""
    period, stages = orbital_period(systems[runs.attrs["system"]]), integrators[runs.attrs["integrator"]].stages
    evaluations: xr.DataArray = period / runs.tau * stages
    return evaluations.assign_attrs(described("force evaluations per orbit"))


@reduction("q", "p", "status")
def invariant_drifts(runs: xr.Dataset) -> xr.Dataset:
    """Largest change of each invariant that the system declares, ``<invariant>_drift``."""
    system = systems[runs.attrs["system"]]
    diverged = (runs.status == "diverged").values
    found = invariants.invariant_variables(system, runs.q.values, runs.p.values, diverged)
    return xr.Dataset({name: value for name, value in found.items() if value[0] == ("tau_per_stage",)})


@reduction("tau", "max_energy_error", over="tau_per_stage")
def observed_order(curves: xr.Dataset) -> xr.DataArray:
    """Slope of the maximum energy error against the step size, above round-off."""
    return order_of_curve(curves.tau, curves.max_energy_error)


def orbital_period(system: System) -> float:
    """Return the period of the exact orbit from the initial values of ``system``, in its unit of time; NaN if none."""
    if system.period is None:
        return float("nan")
    return system.period(*system.start(float), *system.constants(float))
