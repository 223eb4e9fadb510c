"""Energy errors of panel D of Figure 6 from starts outside its plane, until the paths diverge."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, write_beside

if TYPE_CHECKING:
    import xarray as xr

#: Black for the plane itself, then from near to far: at least 3:1 contrast with white, and 13 CIELAB units between any
#: two, with deuteranopia, protanopia and tritanopia as well.
_COLOURS = ("#000000", "#0072b2", "#a03070", "#009e73", "#d55e00")
_LEFT: dict[str, Any] = {"marker": "X", "markersize": 7, "markeredgecolor": "white", "markeredgewidth": 0.6}


@house_style
def fig6_displaced(cube: xr.Dataset) -> Figure:
    """Draw ``block_max_energy_error`` of ``cube``, dimensions (displacement, summation, iteration), and ``left_at``."""
    drawn = new_figure(7, 6.2)
    drawn.subplots_adjust(left=0.1, right=0.985, top=0.875, bottom=0.08, hspace=0.14)
    panels = drawn.subplots(2, 1, sharex=True, sharey=True)
    for axes, letter, summation in zip(panels, "AB", map(str, cube["summation"].values), strict=True):
        _draw(axes, cube.sel(summation=summation), float(cube.attrs["surface_limit"]))
        panel_letter(axes, letter, f"{cube.attrs['label']}, {cube.attrs['system_label']}, {summation} sums")
        axes.set_ylabel(r"$|\Delta H/H_0|$")
    panels[-1].set_xlabel("iteration")
    handles = [
        Line2D([], [], color=colour, label=rf"$q_x$ = {_power(float(each))} at the start", **_look(i))
        for i, (each, colour) in enumerate(zip(cube["displacement"].values, _COLOURS, strict=False))
    ]
    handles.append(Line2D([], [], color="#404040", linestyle="none", label="leaves its energy surface", **_LEFT))
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.54, 0.998), ncols=3, columnspacing=2.0)
    return drawn


def _draw(axes: Axes, runs: xr.Dataset, limit: float) -> None:
    iteration = runs["iteration"].values
    axes.axhline(limit, color="#404040", linestyle=(0, (6, 3)), linewidth=0.9, zorder=1.5)
    text = rf"surface left beyond $|\Delta H/H_0|$ = {limit:g}"
    write_beside(axes, text, (0.012, limit), (0, -4), xycoords=("axes fraction", "data"), va="top")
    for i, colour in enumerate(_COLOURS[: runs.sizes["displacement"]]):
        run = runs.isel(displacement=i)
        error, left_at = run["block_max_energy_error"].values, int(run["left_at"])
        kept = np.isfinite(error)
        x, y = iteration[kept], error[kept]
        if left_at:
            x, y = np.append(x, left_at), np.append(y, limit)
            axes.plot([left_at], [limit], color=colour, linestyle="none", zorder=4, **_LEFT)
        axes.plot(x, y, color=colour, **_look(i))
    axes.margins(x=0.02)
    log_scale(axes, "xy")


def _look(place: int) -> dict[str, Any]:
    """Look of a line: broad for the plane itself, which comes first."""
    return {"linewidth": 1.2 if place else 2.0}


def _power(number: float) -> str:
    """Return the text of a power of ten, or zero."""
    return f"$10^{{{np.log10(number):.0f}}}$" if number else "0"
