"""Reductions of the long runs over the problems of each system.

The dataset has what :mod:`nearharmonic.reproduction.experiments.trained.long_runs.run` computes, over (system,
integrator). No integration depends on this module.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.numerics.statistics import student_975
from nearharmonic.output.dataset import described
from nearharmonic.reproduction.tasks.reduction import Reductions

reduction = Reductions()


@reduction("max_energy_error", over="problem")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Largest error over every step of all problems."""
    largest: xr.DataArray = runs.max_energy_error.max("problem", skipna=False)
    return largest.assign_attrs(runs.max_energy_error.attrs)


@reduction("energy_error", "step", over="problem")
def trends(runs: xr.Dataset) -> xr.Dataset:
    """Trend of (H - H0)/|H0| over the whole run with the half width of its 95 % interval.

    The trend is the mean over the problems of least squares through the samples of each; the interval takes the
    problems as independent. NaN if a run left its energy surface.
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
