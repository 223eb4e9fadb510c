"""Levels in printed and interactive figures, separate from matplotlib, which is slow to load.

Line of the energy error below which errors are the rounding of a potential in double precision.

Envelopes: of a curve of many points, those that a drawing can show, with every extreme.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.numerics.portable import Floats

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


#: Upper end of the axis: an error of ten times the energy belongs to a diverged run.
LARGEST_ERROR = 10.0

#: An error term below this level is zero to the digits of the coefficients; terms of fewer digits are exactly 0.
SATISFIED_BELOW = 1e-30

#: Arcseconds per century, from general relativity: Nobili & Will (1986), doi:10.1038/320039a0.
MERCURY_RELATIVISTIC_ADVANCE = 42.98

_ARCSECONDS_PER_RADIAN = 180 * 3600 / pi
_HOURS_PER_CENTURY = 36525 * 24


def energy_error_label(attributes: Mapping[str, str], absolute: str, relative: str) -> str:
    """Return the label of an axis of energy errors, relative to |H0| unless their attributes say otherwise.

    Parameters
    ----------
    attributes : mapping
        ``long_name`` and ``units`` of the errors; without these attributes errors are relative to |H0|.
    absolute, relative : str
        Symbols of |H - H0| and of |H - H0|/|H0|.
    """
    meaning = attributes.get("long_name", "|H - H0|/|H0|")
    if "p_t" in meaning:
        absolute, relative = f"{absolute} of $T + V + p_t$", f"{relative} of $T + V + p_t$"
    scale = re.search(r"\|H - H0\|/\((\S+) (.*?)\)(?: over|, |$)", meaning)
    if scale:
        return f"{absolute} relative to energy_scale {scale[1]}" + ("" if scale[2] == "1" else f", in {scale[2]}")
    if "|H - H0|/|H0|" not in meaning:
        return f"{absolute} ({attributes.get('units', '1')})"
    return f"{relative}, or {absolute} where H0 = 0" if "where H0 = 0" in meaning else relative


def energy_of(attributes: Mapping[str, Any]) -> str:
    """Return the energy at the start with its unit, "" if the attributes of a cube have none."""
    if "energy_at_start" not in attributes:
        return ""
    unit = attributes.get("energy_unit", "1")
    return f"{float(attributes['energy_at_start']):.6g}" + ("" if unit == "1" else f" {unit}")


def arcseconds_per_century(orbital_period: float) -> float:
    """Return 1 rad per orbit in arcseconds per century, for a period in hours."""
    return _ARCSECONDS_PER_RADIAN * _HOURS_PER_CENTURY / orbital_period


#: The line is drawn if an error is at most this multiple of the floor; otherwise it would only extend the axis.
SHOWN = 100.0


def floor_near(given: Sequence[xr.Dataset], variable: str) -> float:
    """Return the highest attribute ``energy_floor`` of results, or 0 if no error ``variable`` is near it."""
    floor = max(float(one.attrs.get("energy_floor", 0)) for one in given)
    errors = np.concatenate([np.abs(np.ravel(one[variable].values)) for one in given])
    return floor if np.any((errors > 0) & (errors <= SHOWN * floor)) else 0.0


def floor_name(floor: float) -> str:
    """Return the label of the line."""
    return f"rounding of V, {floor:.0e}"


def draw_floor(axes: Axes, given: Sequence[xr.Dataset], variable: str) -> None:
    """Draw :func:`floor_near`, unless it is 0, on axes with logarithmic energy errors."""
    floor = floor_near(given, variable)
    if not floor:
        return
    axes.axhline(floor, color="#595959", linewidth=0.7, linestyle=(0, (1, 1.5)), zorder=1.5)
    axes.annotate(
        floor_name(floor), (0.99, floor), xycoords=axes.get_yaxis_transform(), xytext=(0, 2),
        textcoords="offset points", ha="right", color="#595959", fontsize=8,
    )  # fmt: skip


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
