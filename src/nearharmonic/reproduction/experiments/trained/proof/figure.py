"""Figures of the proof: errors of the best methods on each ensemble, and by how much trained ones are ahead."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from nearharmonic.plotting.style import log_scale, new_figure, panel_letter, style_of
from nearharmonic.reproduction.tasks.declarations import figure

#: Every published method, and the best of them.
FAINT, BEST = "#cfcfcf", "#0b3c8c"
#: Colours of the best trained methods, and of the curves of a panel of gains.
AHEAD = "#c1121f"
CURVES = ("#4a90e2", "#e8871a", "#2e8b57", "#8e3fb5", "#8b4513", "#111111")
MARKERS = ("o", "s", "^", "D", "v", "P")
COLUMNS = 4
#: Largest error that is shown, and the step sizes that are labelled.
HIGHEST, TICKS = 0.02, (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
#: Factor between errors that are labelled.
LABELLED = 1000


@figure(
    cube="trained",
    category="Beyond the paper",
    caption=(
        "Energy error against the step size per evaluation of the force, in radians of the fastest small oscillation, "
        "on problems that no method was trained on: means over the problems of an ensemble of the largest error at "
        "any step. Grey: every published method of the registry. Blue: the best of them at each step size. Thin "
        "lines: each trained method; thick red: the best of them. Where blue lies below red, trained methods lose."
    ),
)
def trained_error(cube: xr.Dataset) -> Figure:
    """Draw ``mean_log_error`` of ``cube`` against the step size, a panel for each ensemble."""
    count = cube["ensemble"].size
    rows = -(-(count + 1) // COLUMNS)
    drawn = new_figure(9.2, 0.6 + 2.15 * rows)
    grid = drawn.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
    height = drawn.get_figheight()
    drawn.subplots_adjust(left=0.07, right=0.99, top=1 - 0.3 / height, bottom=0.5 / height, wspace=0.22, hspace=0.28)
    for i, axes in enumerate(grid[:count]):
        _errors(axes, cube.isel(ensemble=i))
        panel_letter(axes, i, str(cube["ensemble"].values[i]))
        if i % COLUMNS == 0:
            axes.set_ylabel(r"$\max\,|\Delta H/H_0|$", labelpad=2)
        if i + COLUMNS >= count:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel(r"$\tau/s$ (rad)", labelpad=1)
    for axes in grid[count:]:
        axes.set_axis_off()
    grid[-1].legend(handles=_legend(cube), loc="center left", bbox_to_anchor=(-0.12, 0.5), fontsize=8, labelspacing=0.3)
    return drawn


def _errors(axes: Axes, one: xr.Dataset) -> None:
    tau, errors = one["tau_per_stage"].values, 10 ** one["mean_log_error"].values
    kinds, names = one["kind"].values, one["integrator"].values
    published, trained = errors[kinds == "published"], errors[kinds == "trained"]
    axes.plot(tau, published.T, color=FAINT, linewidth=0.6, zorder=1)
    if len(published):
        axes.plot(tau, published.min(axis=0), color=BEST, linewidth=1.6, marker="o", markersize=3, zorder=4)
        low = np.nanmin(errors) if np.isfinite(errors).any() else 1e-16
        axes.set_ylim(low / 4, HIGHEST)
    if len(trained):
        axes.plot(tau, trained.min(axis=0), color=AHEAD, linewidth=2.6, alpha=0.55, zorder=3)
    for name, row in zip(names[kinds == "trained"], trained, strict=True):
        axes.plot(tau, row, **style_of(str(name)).line(markersize=2.6, linewidth=0.7, zorder=5))
    log_scale(axes, "y")
    # Every decade has its tick, every third its label: more would run into the panel on the left.
    axes.yaxis.set_major_locator(LogLocator(base=LABELLED, numticks=12))
    axes.yaxis.set_minor_locator(LogLocator(base=10, numticks=20))
    step_axis(axes)


def step_axis(axes: Axes) -> None:
    """Make the x axis one of step sizes: logarithmic, with its own labels in what is less than two decades."""
    log_scale(axes, "x")
    low, high = axes.get_xlim()
    axes.set_xticks([x for x in TICKS if low <= x <= high] or [low, high])
    axes.xaxis.set_major_formatter("{x:g}")


def _legend(cube: xr.Dataset) -> list[Line2D]:
    handles = [
        Line2D([], [], color=FAINT, label="published"),
        Line2D([], [], color=BEST, linewidth=1.6, marker="o", markersize=3, label="best published"),
    ]
    trained = cube.isel(integrator=np.flatnonzero(cube["kind"].values == "trained"))
    if trained["integrator"].size:
        handles.append(Line2D([], [], color=AHEAD, linewidth=2.6, alpha=0.55, label="best trained"))
    for name, label in zip(trained["integrator"].values, trained["label"].values, strict=True):
        handles.append(Line2D([], [], label=label, **style_of(str(name)).line(markersize=3, linewidth=0.7)))
    return handles


@figure(
    cube="trained",
    category="Beyond the paper",
    caption=(
        "Gain of the best trained over the best published method, in decades of the mean energy error at equal cost, "
        "against the step size per evaluation of the force in radians of the fastest small oscillation. Bands are 95 % "
        "intervals by resampling the problems, with the best of each chosen anew. Below 0 a published method is ahead."
    ),
)
def trained_gain(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` and ``gain_interval`` of ``cube`` against the step size, ensembles of a kind in one panel."""
    panels = list(dict.fromkeys(map(str, cube["panel"].values)))
    drawn = new_figure(max(3.4, 0.5 + 2.3 * len(panels)), 3.9)
    width = drawn.get_figwidth()
    grid = drawn.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    drawn.subplots_adjust(left=0.62 / width, right=1 - 0.1 / width, top=0.92, bottom=0.36, wspace=0.07)
    for i, (axes, panel) in enumerate(zip(grid, panels, strict=True)):
        inside = cube.isel(ensemble=np.flatnonzero(cube["panel"].values == panel))
        handles = _gains(axes, inside)
        panel_letter(axes, i, panel)
        axes.legend(
            handles=handles, title="strength" if panel.startswith("random") else None, loc="upper center",
            bbox_to_anchor=(0.5, -0.17), fontsize=8, title_fontsize=8, labelspacing=0.3,
        )  # fmt: skip
    grid[0].set_ylabel("gain (decades)")
    return drawn


def _gains(axes: Axes, inside: xr.Dataset) -> list[Any]:
    handles = []
    axes.axhline(0, color="#404040", linewidth=0.9)
    for k in range(inside["ensemble"].size):
        one = inside.isel(ensemble=k)
        look: dict[str, Any] = {
            "color": CURVES[k % len(CURVES)],
            "marker": MARKERS[k % len(MARKERS)],
            "markersize": 3.6,
        }
        tau, bounds = one["tau_per_stage"].values, one["gain_interval"].values
        axes.fill_between(tau, *bounds.T, color=look["color"], alpha=0.2, linewidth=0)
        (line,) = axes.plot(tau, one["gain"].values, **look, label=_band(str(one["ensemble"].values)))
        handles.append(line)
    step_axis(axes)
    axes.set_xlabel(r"$\tau/s$ (rad)", labelpad=1)
    return handles


def _band(name: str) -> str:
    """Return the label of a curve in a panel that names the number of coordinates."""
    return name.partition(", ")[2] if name.startswith("d = ") else name
