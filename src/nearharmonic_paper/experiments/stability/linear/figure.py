"""Figure of linear stability: half the trace of the oscillator's step matrix against tau/s, one panel per method."""

from __future__ import annotations

from math import ceil

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from nearharmonic.plotting.style import Style, house_style, new_figure, style_of

COLUMNS = 2
#: Limit of the axis: the trace is unbounded, but only its crossings of +-1 matter.
SHOWN = 1.6
GAP = "#d62728"


@house_style
def linear_stability(cube: xr.Dataset) -> Figure:
    """Draw ``half_trace`` (integrator, tau_per_stage) of ``cube`` and its gaps, from ``start`` to ``end``."""
    names = [str(name) for name in cube.integrator.values]
    rows = ceil(len(names) / COLUMNS)
    height = 0.6 + 1.45 * rows
    drawn = new_figure(7, height)
    drawn.subplots_adjust(left=0.085, right=0.985, top=1 - 0.25 / height, bottom=0.42 / height, hspace=0.32, wspace=0.1)
    panels = drawn.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
    for axes, name in zip(panels.flat, names, strict=False):
        _draw(axes, cube.sel(integrator=name), style_of(name))
    for axes in panels.flat[len(names) :]:
        axes.remove()
    for axes in panels[-1]:
        axes.set_xlabel(r"step size per stage, $\tau/s$")
    for axes in panels[:, 0]:
        axes.set_ylabel(r"$\frac{1}{2}\,\mathrm{tr}\,K$")
    return drawn


def _draw(axes: Axes, method: xr.Dataset, style: Style) -> None:
    tau, stages = method.tau_per_stage.values, int(method.stages)
    axes.axhspan(-1, 1, color="#f2f2f2", zorder=0)
    axes.plot(tau, np.cos(tau * stages), color="#b0b0b0", linewidth=0.6)
    for start, end in zip(method.start.values, method.end.values, strict=True):
        if np.isfinite(start):
            axes.axvspan(start / stages, min(end / stages, tau[-1]), color=GAP, alpha=0.16, linewidth=0)
            axes.plot([start / stages], [SHOWN], marker="v", color=GAP, markersize=4, clip_on=False, zorder=5)
    axes.plot(tau, np.where(np.abs(method.half_trace) <= 2 * SHOWN, method.half_trace, np.nan), color=style.colour)
    axes.set(xlim=(0, tau[-1]), ylim=(-SHOWN, SHOWN))
    axes.yaxis.set_major_locator(MultipleLocator(1))
    first, growth = float(method.start[0]), float(method.growth_per_step[0])
    says = rf"$\tau^*$ = {first:.6f}, " + (f"growth {growth:.1e}" if np.isfinite(growth) else "for good")
    axes.set_title(f"{method.label.item()}:  {says}", loc="left", fontsize=8.5, pad=5)
