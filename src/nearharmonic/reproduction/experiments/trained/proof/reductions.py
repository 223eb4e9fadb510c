"""Reductions over the problems of each ensemble: mean errors, and the gains of trained methods over published ones.

The dataset has ``log_error`` over (ensemble, integrator, point, problem), ``anharmonicity`` over (ensemble, problem),
the coordinate ``kind`` of each integrator, and the attribute ``seed``, which chooses the resamples. No integration
depends on this module.
"""

from __future__ import annotations

import xarray as xr

from nearharmonic.output.dataset import coordinate, described
from nearharmonic.reproduction.experiments.trained.comparison.resampling import (
    CONFIDENCE,
    RESAMPLES,
    interval,
    resampled_means,
)
from nearharmonic.reproduction.tasks.reduction import Reductions

reduction = Reductions()

#: Of the anharmonicities of the problems of an ensemble.
QUANTILES = (0.05, 0.5, 0.95)


@reduction("log_error", over="problem")
def mean_log_error(runs: xr.Dataset) -> xr.DataArray:
    """Mean over the problems of the logarithm of the energy error."""
    text = "mean over the problems of log10 of the largest |H - H0|/|H0| over every step"
    mean: xr.DataArray = runs.log_error.mean("problem", skipna=False)
    return mean.assign_attrs(described(text))


@reduction("anharmonicity", over="problem")
def anharmonicity(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the problems of their anharmonicity."""
    fractions = coordinate("quantile", list(QUANTILES), "fraction of the problems that are less anharmonic")
    found: xr.DataArray = runs.anharmonicity.quantile(QUANTILES, "problem", skipna=False).transpose(
        "ensemble", "quantile"
    )
    return found.assign_coords(fractions).assign_attrs(runs.anharmonicity.attrs)


@reduction("log_error", "kind", over="problem")
def gains(runs: xr.Dataset, resamples: int = RESAMPLES) -> xr.Dataset:
    """Best method of each kind, and the gain of the trained one with its interval, at each step size.

    A gain is the mean logarithm of the error of the best published method, less that of the best trained one. The best
    of each are chosen anew in each resample. Without a method of a kind its best is "" and the gain is NaN.
    """
    errors, seed = runs.log_error.reset_coords(drop=True).assign_coords(kind=runs.kind), runs.attrs["seed"]
    parts = [_gains(errors.sel(ensemble=name), seed, resamples) for name in runs.ensemble.values]
    found = xr.concat(parts, "ensemble", coords="minimal", compat="override").assign_coords(ensemble=runs.ensemble)
    chosen = f"its {CONFIDENCE:.0%} interval by resampling the problems, the best of each chosen anew"
    for name, text, unit in (
        ("best_published", "published method with the least mean error", "1"),
        ("best_trained", "trained method with the least mean error", "1"),
        ("gain", "gain of best_trained", "decades"),
        ("gain_interval", chosen, "decades"),
    ):
        found[name] = found[name].assign_attrs(described(text, unit))
    return found


def _gains(errors: xr.DataArray, seed: int, resamples: int) -> xr.Dataset:
    """Gains of one ensemble."""
    means = errors.mean("problem", skipna=False)
    return xr.Dataset({
        "best_published": _of(means, "published").idxmin("integrator", fill_value=""),
        "best_trained": _of(means, "trained").idxmin("integrator", fill_value=""),
        "gain": _gain(means),
        "gain_interval": interval(_gain(resampled_means(errors, seed, resamples))),
    })  # fmt: skip


def _of(means: xr.DataArray, kind: str) -> xr.DataArray:
    return means.where(means.kind == kind)


def _gain(means: xr.DataArray) -> xr.DataArray:
    return _of(means, "published").min("integrator") - _of(means, "trained").min("integrator")
