"""Reductions of the long runs over the problems of each system.

The dataset has what :mod:`nearharmonic_studies.trained.run` computes, over (system,
integrator).
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import student_975
from nearharmonic.output.dataset import described
from nearharmonic.output.store import read
from nearharmonic.output.table import Table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.trained.proof_settings import ProofSettings

reduction = Reductions()


@reduction("max_energy_error", over="problem")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Largest error over every step of all problems."""
    largest: xr.DataArray = runs.max_energy_error.max("problem", skipna=False)
    return largest.assign_attrs(runs.max_energy_error.attrs)


@reduction("energy_error", "step", over="problem")
def trends(runs: xr.Dataset) -> xr.Dataset:
    """Trend of (H - H0)/|H0| over the whole run with the half width of its 95 % interval.

    The trend is the mean over the problems of the slopes of least-squares lines; the interval assumes independent
    problems. NaN if a run diverged.
    """
    time, count = runs.step / runs.step[-1] - 0.5, runs.problem.size
    slopes = (runs.energy_error * time).sum("sample", skipna=False) / (time * time).sum("sample")
    width = student_975(count - 1) * slopes.std("problem", ddof=1, skipna=False) / sqrt(count)
    trend = slopes.mean("problem", skipna=False)
    return xr.Dataset({
        "trend": trend.assign_attrs(described("trend of (H - H0)/|H0| over the whole run")),
        "trend_half_width": width.assign_attrs(described("half width of the 95 % interval of the trend")),
    })  # fmt: skip


@reduction("q", "q_low", "p", "p_low", over="problem")
def way_back(runs: xr.Dataset) -> xr.DataArray:
    """Median distance from the start after the run and the run back with all its digits."""
    errors = []
    for name in "qp":
        start, back = (runs[name].sel(end=end, drop=True) for end in ("start", "back"))
        scale = abs(runs[name].sel(end=["start", "there"])).max(["problem", "end", "component"])
        errors.append(abs(back - start + runs[f"{name}_low"].sel(end="back", drop=True)).max("component") / scale)
    distance = xr.concat(errors, "kind").max("kind", skipna=False).median("problem", skipna=False)
    return distance.assign_attrs(described("median distance from the start, relative to the largest coordinate"))


@reduction("fine_energy_error", over="problem")
def rounding(runs: xr.Dataset) -> xr.DataArray:
    """Median over the problems and the second half of the samples of the energy error by rounding."""
    exact = runs.fine_energy_error.sel(arithmetic="extended", drop=True)
    rounded = runs.fine_energy_error.sel(arithmetic=runs.summation.values).rename(arithmetic="summation")
    median: xr.DataArray = xr.apply_ufunc(
        _late_median, abs(rounded - exact), input_core_dims=[["problem", "fine_sample"]], vectorize=True
    )
    return median.assign_attrs(described("median energy error by rounding alone"))


def _late_median(errors: Any) -> float:
    known = errors[:, ~np.isnan(errors).all(axis=0)]
    return float(np.median(known[:, known.shape[1] // 2 :]))


CAPTION = (
    "Runs from starts on the energy surfaces of the proof. Largest error at any step; trend of (H - H0)/|H0| over the "
    "whole run with the half width of its 95 % interval over the starts; distance from the start after a hundredth of "
    "the steps and as many back, median over the starts, relative to the largest coordinate and momentum; and the "
    "energy error by rounding alone, against double-double with the same coefficients, after equally many evaluations "
    "with a fifth of the step, median over the starts and the second half of the run, and with plain sums over that "
    "of the first method."
)


def reduce(methods: Sequence[str], beside: str, settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``table`` of long runs; the names and ``settings`` are stored in the files."""
    return {"table": long_table(read(run))}


def long_table(runs: xr.Dataset) -> Table:
    """Return a row for each system and method of ``runs``, with their reductions."""
    reduced, steps, tau = reduction.of(runs, over="problem"), int(runs.step[-1]), float(runs.tau_per_stage)
    sums, rows = runs.summation.values.tolist(), []
    for system in map(str, runs.system.values):
        known = float(reduced.rounding.sel(system=system, summation="plain")[0])
        for name in map(str, runs.integrator.values):
            one, method = reduced.sel(system=system, integrator=name), integrators[name]
            total = sum(abs(float(c)) for row in (method.kick, method.drift) for c in row)
            largest, slope, width = (float(one[key]) for key in ("max_energy_error", "trend", "trend_half_width"))
            drift = "no" if abs(slope) <= width else "yes" if abs(slope) > width else "lost"
            numbers = [float(values.sel(summation=each)) for values in (one.way_back, one.rounding) for each in sums]
            rows.append([system, name, steps, tau, total, largest, slope, width, drift, *numbers, numbers[-1] / known])
    header = ["system", "method", "steps", "tau_per_stage", "sum of coefficients", "max_energy_error", "trend"]
    header += ["trend_half_width", "drift", *(f"{what}_{each}" for what in ("return", "rounding") for each in sums)]
    return Table(header=[*header, "rounding_ratio"], rows=rows, caption=CAPTION)
