"""Line of the energy error below which errors are the rounding of a potential in double precision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

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
