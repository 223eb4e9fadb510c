"""Figures of this package and other libraries: one trajectory, and ensembles, with a panel for each system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, mark_every, new_figure, panel_letter
from nearharmonic_paper.experiments.work_precision.comparison import ERRORS, STANDARD, Pair, pairs
from nearharmonic_paper.experiments.work_precision.figures.times import (
    YLABELS,
    draw_facts,
    draw_legend,
    line_of,
    points_of,
    scale_axes,
)
from nearharmonic_paper.tasks.receipts import measures_time

#: Number of panels per row, and their size and the left margin in inches.
_ACROSS, _WIDTH, _HEIGHT, _LEFT = 3, 4.6, 3.6, 0.75
_XLABELS = {
    "trajectory": "whole call for one trajectory  (ms)",
    "lanes": "whole call for an ensemble, per trajectory  (ms)",
}


@measures_time
def comparison_figures(names: Sequence[str], cube: str) -> dict[str, Figure]:
    """Draw what :func:`pairs` reads: error against the time of whole calls, for ``trajectory`` and ``lanes``."""
    found, facts = pairs(cube, names)
    return {mode: comparison_figure(found, mode, facts) for mode in _XLABELS}


@house_style
def comparison_figure(found: Sequence[Pair], mode: str, facts: Mapping[str, object]) -> Figure:
    """Draw a panel for each system: the fastest methods at some error, and all other libraries.

    ``mode`` is "trajectory" or "lanes"; ``facts`` are properties of the machine, from
    :func:`nearharmonic.numerics.clock.machine`, and ``libraries``.
    """
    across = min(len(found), _ACROSS)
    down = ceil(len(found) / across)
    members = [
        [*leaders(pair, mode), *(one for one in pair.others if np.isfinite(one[f"time_{mode}"]).any())]
        for pair in found
    ]
    legend = 0.45 + 0.15 * ceil(max(map(len, members)) / 2)
    height = 1.0 + down * (_HEIGHT + legend)
    figure = new_figure(_LEFT + _WIDTH * across, height)
    figure.subplots_adjust(
        left=_LEFT / figure.get_figwidth(), right=0.99, top=1 - legend / height, bottom=1.0 / height, wspace=0.23,
        hspace=(legend + 0.5) / _HEIGHT,
    )  # fmt: skip
    grid = figure.subplots(down, across, squeeze=False)
    for i, (axes, pair, curves) in enumerate(zip(grid.flat, found, members, strict=False)):
        _draw_panel(axes, curves, mode)
        panel_letter(axes, i, f"{pair.label}, t = {pair.t_end}")
        axes.set_xlabel(_XLABELS[mode])
    for axes in grid.flat[len(found) :]:
        axes.remove()
    draw_facts(figure, facts, _LEFT, int(17.5 * _WIDTH * across))
    return figure


def leaders(pair: Pair, mode: str) -> list[xr.Dataset]:
    """Return the methods of this package that are the fastest at one of the compared errors, each once."""
    first = [found[0][0] for error in ERRORS if (found := pair.fastest(error, mode))]
    return list({curve["solver"].item(): curve for curve in first}.values())


def _draw_panel(axes: Axes, curves: Sequence[xr.Dataset], mode: str) -> None:
    """Draw the curves (solid for this package, broad for the reference) and the legend above them."""
    handles = []
    for position, curve in enumerate(curves):
        x, y = points_of(curve, "max", mode)
        look = line_of(curve) | ({"linewidth": 2.2} if curve["solver"] == STANDARD else {})
        axes.plot(x, y, markevery=mark_every(position, len(curves), len(x), marks=7), zorder=3, **look)
        handles.append(Line2D([], [], label=curve["label"].item(), **look))
    scale_axes(axes, YLABELS["max"])
    draw_legend(axes, handles, handlelength=2.4)
