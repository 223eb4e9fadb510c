"""Tables of the proof: gains by ensemble and step size, and where each trained method is ahead of published ones."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.numerics.types import Floats
from nearharmonic.output.table import Table

if TYPE_CHECKING:
    import xarray as xr

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
    for e, t in _points(values):
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
    """Return the ends of the widest stretch of neighbouring step sizes at which a gain is above 0; NaN for none.

    Parameters
    ----------
    taus, gain : (T,) array of float
        Step sizes in any order that is monotonic, and gains.
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


def _points(values: Any) -> Iterator[tuple[int, int]]:
    for e, t in np.argwhere(np.isfinite(values["tau_per_stage"])):
        yield int(e), int(t)


def _error(values: Any, ensemble: int, point: int, name: str) -> float:
    """The mean logarithm of the error of a method; NaN for none."""
    which = values["integrator"] == name
    return float(values["mean_log_error"][ensemble, which, point][0]) if which.any() else float("nan")
