"""Envelopes: of a curve of many points, those that a drawing can show, with every extreme."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.numerics.types import Floats

if TYPE_CHECKING:
    import xarray as xr

#: Columns of a figure: 0.3 mm each in a figure 7 inches wide.
COLUMNS = 500


def envelope(curve: xr.Dataset, names: Iterable[str], columns: int = COLUMNS) -> xr.Dataset:
    """Return the points of a curve that determine its drawing against a logarithmic step size.

    Of each column they are, for each variable, the first, last, lowest and highest number, and the first and last point
    without a number. A curve of fewer than four points a column is returned as it is.

    Parameters
    ----------
    curve : xarray.Dataset
        Variables over tau_per_stage, which increases.
    names : iterable of str
        Names of the variables that are drawn.
    columns : int
        Number of columns, of equal width in the logarithm.
    """
    if curve.sizes["tau_per_stage"] <= 4 * columns:
        return curve
    place = np.log(curve["tau_per_stage"].values)
    edges = np.searchsorted(place, np.linspace(place[0], place[-1], columns + 1)[1:-1])
    kept = {index for name in names for index in _extremes(curve[name].values, [0, *edges.tolist(), place.size])}
    return curve.isel(tau_per_stage=sorted(kept))


def _extremes(values: Floats, edges: list[int]) -> Iterator[int]:
    """Yield the indices of first, last, lowest and highest number and of first and last gap in each column."""
    drawable = np.isfinite(values)
    for begin, end in pairwise(edges):
        for among in (drawable[begin:end], ~drawable[begin:end]):
            there: Any = begin + np.flatnonzero(among)
            if there.size:
                yield from (int(there[0]), int(there[-1]))
        there = begin + np.flatnonzero(drawable[begin:end])
        if there.size:
            yield from (int(there[values[there].argmin()]), int(there[values[there].argmax()]))
