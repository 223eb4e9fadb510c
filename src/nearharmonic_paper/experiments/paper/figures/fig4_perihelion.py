"""Figure 4: advance of Mercury's perihelion caused by the integrator, against force evaluations per orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.profile import problem_of
from nearharmonic.plotting.style import (
    house_style,
    log_scale,
    log_ticks,
    mark_every,
    method_handles,
    new_figure,
    right_title,
    style_of,
    write_beside,
)
from nearharmonic_paper.experiments.paper.figures.shown import (
    MERCURY_RELATIVISTIC_ADVANCE,
    Advances,
    advances,
    arcseconds_per_century,
)

if TYPE_CHECKING:
    import xarray as xr

#: Each point is a dot with a bar, 1.5 mm wide.
COLUMNS = 100


@house_style
def fig4_perihelion(cube: xr.Dataset) -> Figure:
    """Draw |perihelion_advance| of ``cube``, dimensions (precision, integrator, tau_per_stage), in rad per orbit.

    ``cube.attrs["orbital_period"]``, in h, converts it to arcseconds per century. Runs without a finite advance or
    interval are omitted.
    """
    drawn = new_figure(7, 6.4)
    drawn.subplots_adjust(left=0.105, right=0.895, top=0.865, bottom=0.08)
    axes = drawn.subplots()
    for one in advances(cube, COLUMNS):
        _draw_method(axes, one)
    axes.margins(x=0.03, y=0.04)
    log_scale(axes, "xy")
    axes.set_xlabel("force evaluations per orbit")
    right_title(axes, problem_of(cube, str(cube["tau_per_stage"].attrs.get("units", "1"))))
    axes.set_ylabel("|perihelion advance|  (rad per orbit)")
    _add_century_axis(axes, arcseconds_per_century(float(cube.attrs["orbital_period"])))
    handles = method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    handles.append(
        Line2D([], [], color="#404040", linestyle="none", marker="x", markersize=4, label="95 % interval includes 0")
    )
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_method(axes: Axes, one: Advances) -> None:
    style, x = style_of(one.line.integrator), one.evaluations
    known, bars = np.where(one.known, one.size, np.nan), np.where(one.known, one.interval, np.nan)
    axes.errorbar(x, known, yerr=bars, fmt="none", ecolor=style.colour, elinewidth=0.8)
    axes.plot(x, known, color=style.colour, linewidth=0.5, marker=".", markersize=3.2)
    axes.plot(x, known, markevery=mark_every(*one.line.turn, int(one.known.sum()), marks=8), **style.points())
    axes.plot(x, np.where(one.unknown, one.size, np.nan), **style.points(marker="x", markersize=4, alpha=0.5))


def _add_century_axis(axes: Axes, arcseconds: float) -> None:
    """Add a second axis, ``arcseconds`` per century for 1 rad/orbit, and a line for the relativistic advance."""
    functions: Any = (lambda y: y * arcseconds, lambda y: y / arcseconds)
    century = axes.secondary_yaxis("right", functions=functions)
    century.set_ylabel("|perihelion advance|  (arcseconds per century)")
    log_ticks(century.yaxis)
    axes.tick_params(axis="y", which="both", right=False)
    level = MERCURY_RELATIVISTIC_ADVANCE / arcseconds
    axes.axhline(level, color="#404040", linestyle=(0, (6, 3)), linewidth=0.9, zorder=1.5)
    text = f"general relativity: {MERCURY_RELATIVISTIC_ADVANCE}″ per century"
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
    among = {"xycoords": ("axes fraction", "data"), "ha": "right", "zorder": 5}
    write_beside(axes, text, (0.988, level), (0, 4), bbox=box, **among)
