"""Figures of the experiment on samplers: Gaussians, other targets, and what training gains."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, panel_letter, style_of

#: Methods whose curves are drawn, at most eight.
DRAWN = (
    "leapfrog", "bcss_s3", "bcss_s4", "predescu_s3", "abas5o6h", "babs7o7h", "trained_light", "searched_s4",
)  # fmt: skip
#: Colours of methods that were trained for one strength, and colours and markers of those trained for all.
ALONE, ALL = ("#9ecae1", "#5a9bd4", "#2f6fb0", "#0b3c8c"), (("#e86a10", "o"), ("#8b0000", "s"), ("#00785a", "^"))


@house_style
def samplers_gaussian(cube: xr.Dataset) -> Figure:
    """Draw ``gaussian_gradients`` and ``gaussian_gain`` of ``cube``."""
    names = _drawn(cube)
    drawn = new_figure(8.2, 4.3)
    panels = drawn.subplots(1, 2)
    drawn.subplots_adjust(left=0.085, right=0.985, top=0.92, bottom=0.28, wspace=0.2)
    texts = (("gradients", "gradients / squared jump"), ("gain", "gain over leapfrog"))
    for k, (axes, (what, says)) in enumerate(zip(panels, texts, strict=True)):
        for name in names:
            axes.plot(
                cube["dimension"], cube[f"gaussian_{what}"].sel(integrator=name), **style_of(name).line(markersize=4)
            )
        log_scale(axes, "xy")
        _plain(axes.yaxis, 1, 2, 5)
        axes.set(xlabel="dimension", ylabel=says)
        panel_letter(axes, k, ("cost", "gain")[k])
    handles = method_handles(names, cube["label"].sel(integrator=names).values)
    drawn.legend(handles=handles, loc="lower center", ncols=4, columnspacing=1.4)
    return drawn


@house_style
def samplers_targets(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` of ``cube`` with its interval, a panel for each target."""
    names = list(map(str, cube["integrator"].values))[::-1]
    count = cube.sizes["target"]
    columns = min(3, count)
    rows = -(-count // columns)
    height = (0.21 * len(names) + 0.85) * rows + 0.2
    drawn = new_figure(3.0 * columns + 1.7, height)
    grid = drawn.subplots(rows, columns, squeeze=False, sharey=True)
    left, top, bottom = 1.6 / (3.0 * columns + 1.7), 1 - 0.3 / height, 0.55 / height
    drawn.subplots_adjust(left=left, right=0.985, top=top, bottom=bottom, hspace=0.3, wspace=0.07)
    for axes in grid.flat[count:]:
        axes.set_axis_off()
    for k, target in enumerate(cube["target"].values):
        axes = grid.flat[k]
        one = cube.sel(target=target, integrator=names)
        for place, name in enumerate(names):
            middle, low, high = (float(one[f"gain{end}"][place]) for end in ("", "_low", "_high"))
            _point(axes, middle, low, high, place, style_of(name).colour, style_of(name).marker)
        axes.axvline(1, color="#404040", linewidth=0.8)
        axes.set_yticks(range(len(names)), one["label"].values)
        axes.set_ylim(-0.7, len(names) - 0.3)
        log_scale(axes, "x")
        _plain(axes.xaxis, 1, 1.5, 2, 3, 5, 7)
        panel_letter(axes, k, str(cube["target_label"].values[k]))
        if k % columns == 0:
            axes.set_ylabel("method")
        if k + columns >= count:
            axes.set_xlabel("gain over leapfrog")
    return drawn


@house_style
def samplers_trained(cube: xr.Dataset) -> Figure:
    """Draw ``special_gain`` and ``over_best`` of ``cube``."""
    drawn = new_figure(9.4, 4.4)
    left, right = drawn.subplots(1, 2)
    drawn.subplots_adjust(left=0.075, right=0.985, top=0.92, bottom=0.31, wspace=0.72)
    names = list(map(str, cube["trained_for"].values))
    shared = [name for name in names if name in cube["integrator"].values]
    alone = [name for name in names if name not in shared]
    looks = dict(zip(alone, ((one, "D") for one in ALONE), strict=False)) | dict(zip(shared, ALL, strict=False))
    strengths, handles = np.arange(cube.sizes["strength"]), []
    for (name, (colour, marker)), shift in zip(looks.items(), np.linspace(-0.15, 0.15, len(looks)), strict=True):
        values, half = (cube[one].sel(trained_for=name) for one in ("special_gain", "special_half"))
        look: Any = {
            "color": colour, "marker": marker, "markersize": 4, "linestyle": "--" if name in alone else "-",
            "markerfacecolor": "white" if name in alone else colour,
        }  # fmt: skip
        left.errorbar(strengths + shift, values, half, **look, linewidth=1, capsize=2)
        handles.append(Line2D([], [], label=str(values["trained_label"].item()), **look))
    for axes in (left, right):
        (axes.axhline if axes is left else axes.axvline)(1, color="#404040", linewidth=0.8)
    left.set_xticks(strengths, [f"{one:g}" for one in cube["strength"].values])
    left.set(xlabel="strength of the quartic term, b", ylabel="gain over the best of the others")
    panel_letter(left, 0, "quartic oscillators")
    for name in shared:
        for k, target in enumerate(cube["target"].values):
            one = cube.sel(target=target, integrator=name)
            middle, low, high = (float(one[f"over_best{end}"]) for end in ("", "_low", "_high"))
            place = k + 0.2 * (shared.index(name) - (len(shared) - 1) / 2)
            _point(right, middle, low, high, place, *looks[name])
    right.set_yticks(range(cube.sizes["target"]), cube["target_label"].values, fontsize=8)
    right.set_ylim(cube.sizes["target"] - 0.5, -0.5)
    right.set_xlabel("gain over the best of the others")
    panel_letter(right, 1, "chains")
    drawn.legend(handles=handles, loc="lower center", ncols=3, columnspacing=1.4)
    return drawn


def _drawn(cube: xr.Dataset) -> list[str]:
    every = list(map(str, cube["integrator"].values))
    return every if len(every) <= len(DRAWN) else [name for name in DRAWN if name in every] or every[: len(DRAWN)]


def _point(axes: Axes, middle: float, low: float, high: float, place: float, colour: str, marker: str) -> None:
    axes.plot([low, high], [place, place], color=colour, linewidth=1.4)
    axes.plot([middle], [place], color=colour, marker=marker, markersize=4.5, linestyle="none")


def _plain(axis: Axis, *digits: float) -> None:
    """Label a logarithmic axis of one or two decades at these first digits, without powers."""
    axis.set_major_locator(LogLocator(base=10, subs=digits))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
