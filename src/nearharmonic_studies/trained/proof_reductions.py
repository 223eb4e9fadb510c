"""Reductions over the problems of each ensemble: mean errors, and the gains of trained methods over published ones.

The dataset has ``log_error`` over (ensemble, integrator, point, problem), ``anharmonicity`` over (ensemble, problem),
the coordinate ``kind`` of each integrator, and the attribute ``seed``, which chooses the resamples.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import described, read
from nearharmonic.output.table import Table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.trained.proof_settings import ProofSettings
from nearharmonic_studies.trained.resampling import (
    CONFIDENCE,
    RESAMPLES,
    anharmonicity_quantiles,
    interval,
    resampled_means,
)

reduction = Reductions()


@reduction("log_error", over="problem")
def mean_log_error(runs: xr.Dataset) -> xr.DataArray:
    """Mean over the problems of the logarithm of the energy error."""
    text = "mean over the problems of log10 of the largest |H - H0|/|H0| over every step"
    mean: xr.DataArray = runs.log_error.mean("problem", skipna=False)
    return mean.assign_attrs(described(text))


@reduction("anharmonicity", over="problem")
def anharmonicity(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the problems of their anharmonicity."""
    return anharmonicity_quantiles(runs, "problems")


@reduction("log_error", "kind", over="problem")
def gains(runs: xr.Dataset, resamples: int = RESAMPLES) -> xr.Dataset:
    """Best method of each kind, and the gain of the trained one with its interval, at each step size.

    A gain is the mean logarithm of the error of the best published method minus that of the best trained one. Each
    resample has its own best methods. Without a method of a kind its best is "" and the gain is NaN.
    """
    errors, seed = runs.log_error.reset_coords(drop=True).assign_coords(kind=runs.kind), runs.attrs["seed"]
    parts = [_gains_on(errors.sel(ensemble=name), seed, resamples) for name in runs.ensemble.values]
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


def _gains_on(errors: xr.DataArray, seed: int, resamples: int) -> xr.Dataset:
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


GAINS = (
    "Best published and best trained method on each ensemble at each cost of a step, by the mean of log10 max "
    "|dH/H0|; the gain in decades with its 95 % interval over the problems. Ahead and behind: the interval is above or "
    "below 0. Nothing was trained on these problems."
)
METHODS = (
    "Each trained method on each ensemble: the widest stretch of neighbouring step sizes at which it errs less than "
    "every published method, its largest gain and its largest loss in decades, and where."
)


def gain_table(cube: xr.Dataset) -> Table:
    """Return a row for each ensemble and step size."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["ensemble", "tau_per_stage", "best published", "log10_error", "best trained", "log10_error_trained"]
    header += ["gain", "gain_low", "gain_high", "verdict"]
    rows: list[list[Any]] = []
    for e, t in np.argwhere(np.isfinite(values["tau_per_stage"])):
        names = [str(values[key][e, t]) for key in ("best_published", "best_trained")]
        errors = [_error(values, e, t, name) for name in names]
        numbers = [float(values["gain"][e, t]), *map(float, values["gain_interval"][e, t])]
        rows.append([
            str(values["ensemble"][e]), float(values["tau_per_stage"][e, t]), names[0] or "none", errors[0],
            names[1] or "none", errors[1], *numbers, verdict(*numbers[1:]),
        ])  # fmt: skip
    return Table(header=header, rows=rows, caption=GAINS)


def verdict(low: float, high: float) -> str:
    """Return what an interval of a gain says."""
    if np.isnan(low):
        return "none trained"
    return "ahead" if low > 0 else "behind" if high < 0 else "even"


def method_table(cube: xr.Dataset) -> Table:
    """Return a row for each trained method and ensemble."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["method", "ensemble", "ahead_from", "ahead_to", "ratio"]
    header += ["largest_gain", "gain_at", "largest_loss", "loss_at"]
    rows = []
    for m in np.flatnonzero(values["kind"] == "trained").tolist():
        for e, ensemble in enumerate(values["ensemble"].tolist()):
            taus = values["tau_per_stage"][e]
            there = np.flatnonzero(np.isfinite(taus))
            gain = gains_of(values, e, m)[there]
            low, high = stretch(taus[there], gain)
            most, least = there[gain.argmax()], there[gain.argmin()]
            ends = [float(gain.max()), float(taus[most]), float(-gain.min()), float(taus[least])]
            rows.append([str(values["integrator"][m]), ensemble, low, high, high / low, *ends])
    return Table(header=header, rows=rows or [["none", *[""] * (len(header) - 1)]], caption=METHODS)


def gains_of(values: Any, ensemble: int, method: int) -> Floats:
    """Return the gains (T,) of one method over the best published one at each step size, from arrays of the cube."""
    errors = values["mean_log_error"][ensemble]
    best = errors[values["kind"] == "published"].min(axis=0)
    found: Floats = best - errors[method]
    return found


def stretch(taus: Floats, gain: Floats) -> tuple[float, float]:
    """Return the ends of the widest range of neighbouring step sizes with a gain above 0; NaN without a gain.

    ``taus``, ``gain`` (T,): step sizes in monotonic order, and gains.
    """
    best, start = (np.nan, np.nan), None
    for i, ahead in enumerate([*(gain > 0), False]):
        if ahead and start is None:
            start = i
        if not ahead and start is not None:
            low, high = sorted((float(taus[start]), float(taus[i - 1])))
            if not high / low <= best[1] / best[0]:
                best = low, high
            start = None
    return best


def _error(values: Any, ensemble: int, point: int, name: str) -> float:
    """Return the mean logarithm of the error of a method; NaN without a method."""
    which = values["integrator"] == name
    return float(values["mean_log_error"][ensemble, which, point][0]) if which.any() else float("nan")


def reduce(methods: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of mean errors and gains, the tables of ``gains`` and of trained ``methods``, from ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    runs = read(run).assign_attrs(seed=settings.seed)
    cube = runs.drop_dims("problem").assign(reduction.of(runs, over="problem"))
    cube.attrs = {}
    return {"cube": cube, "gains": gain_table(cube), "methods": method_table(cube)}
