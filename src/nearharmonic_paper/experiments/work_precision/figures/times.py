"""Work-precision diagrams: error against wall time, for methods of the paper, further methods, and peers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from math import ceil
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.plotting.style import house_style, log_scale, mark_every, new_figure, panel_letter, style_of
from nearharmonic.recommendation.measure import MEASURES, Part, for_good, of_kind, read_parts
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.tasks.receipts import measures_time

YLABELS = {
    "max": r"$\max\,|\Delta H/H_0|$",
    "mean": r"$\mathrm{mean}\,|\Delta H/H_0|$",
    "position": r"position error",
}
#: Limits of errors: larger errors are meaningless, and smaller ones are rounding errors.
ERRORS = (1e-17, 10.0)

#: Content of each column of panels, and number of methods per row of its legend.
_COLUMNS = (("methods of the paper", 3), ("beyond the paper", 3), ("other libraries", 2))
#: Marks after the name of a curve without points, and what they say: library not installed, or another reason.
_MISSING = {True: ("†", "not installed"), False: ("‡", "no run: see the table")}
_BEST, _LANES = "#f2d8a7", "#b08030"
_PEER_COLOURS = (
    "#8c6d46", "#6e6e6e", "#202020", "#3e6b6b", "#7a5a86", "#a06060", "#5f7d3a", "#4f5f8f", "#c07830", "#b0a030",
    "#50a0c0", "#c080b0", "#d04040", "#1f4e9c", "#6a9bd8",
)  # fmt: skip
_PEER_MARKERS = ("x", "+", "*", "1", "2", "3", "4", "|", "_", "v", "<", ">", "d", "p", "h")


@measures_time
def work_precision(system: str, cube: str) -> dict[str, Figure]:
    """Draw what was measured on the system of this name, as ``figure``, from the path of the ``cube`` of times."""
    return {"figure": work_precision_figure(systems[system].label, *read_parts(cube, system))}


@house_style
def work_precision_figure(label: str, parts: Sequence[Part], facts: Mapping[str, object]) -> Figure:
    """Draw a row of panels for each measure of each part, and the machine below.

    ``facts`` are properties of the machine, from :func:`nearharmonic.numerics.clock.machine`.
    """
    rows = [(t_end, measure, curves) for t_end, measures, curves in parts for measure in measures]
    legend = 0.5 + 0.145 * max(ceil(len(_column(rows[0][2], i)) / per_row) for i, (_, per_row) in enumerate(_COLUMNS))
    figure = new_figure(13, 0.85 + legend + 2.7 * len(rows))
    height = figure.get_figheight()
    figure.subplots_adjust(
        left=0.06, right=0.992, top=1 - legend / height, bottom=0.82 / height, hspace=0.27, wspace=0.05
    )
    grid = figure.subplots(len(rows), len(_COLUMNS), sharey="row", sharex="row", squeeze=False)
    for row, (t_end, measure, curves) in enumerate(rows):
        for i, (says, _) in enumerate(_COLUMNS):
            _envelopes(grid[row, i], _column(curves, 0), measure)
            _draw(grid[row, i], _column(curves, i), measure)
            panel_letter(grid[row, i], len(_COLUMNS) * row + i, f"{says}, t = {t_end}")
        scale_axes(grid[row, 0], YLABELS[measure])
    for i, (_, per_row) in enumerate(_COLUMNS):
        grid[-1, i].set_xlabel("wall time of one trajectory  (ms)")
        _legend(figure, grid[0, i], _column(rows[0][2], i), per_row, envelopes=i == 0)
    figure.text(0.06, 0.1 / height, f"{label}. {machine_text(facts)}", fontsize=8, color="#404040", va="bottom")
    return figure


def _column(curves: Sequence[xr.Dataset], column: int) -> list[xr.Dataset]:
    """Return the curves of one column of panels: methods of the paper, further methods, or peers."""
    if column == 2:
        return of_kind(curves, "peer")
    return [one for one in of_kind(curves, "splitting") if (one["solver"].item() in BENCHMARKED) != bool(column)]


def points_of(curve: xr.Dataset, measure: str, mode: str = "trajectory") -> tuple[list[float], list[float]]:
    """Return milliseconds and errors of the successfully timed points."""
    x, y = 1e3 * curve[f"time_{mode}"].values, curve[MEASURES[measure]].values
    inside = np.isfinite(x) & (ERRORS[0] < y) & (y < ERRORS[1])
    return x[inside].tolist(), y[inside].tolist()


def _draw(axes: Axes, curves: Sequence[xr.Dataset], measure: str) -> None:
    for position, curve in enumerate(curves):
        x, y = points_of(curve, measure)
        axes.plot(x, y, markevery=mark_every(position, len(curves), len(x), marks=7), zorder=3, **line_of(curve))


def line_of(curve: xr.Dataset) -> dict[str, Any]:
    name = curve["solver"].item()
    if curve["kind"] == "splitting":
        return style_of(name).line(markersize=4.2)
    i = list(PEERS).index(name) % len(_PEER_COLOURS) if name in PEERS else 0
    return {"color": _PEER_COLOURS[i], "marker": _PEER_MARKERS[i], "linestyle": (0, (4, 2)), "markersize": 6}


def _envelopes(axes: Axes, curves: Sequence[xr.Dataset], measure: str) -> None:
    """Draw the smallest error of all ``curves`` at each time, for one trajectory and in lanes."""
    looks: dict[str, dict[str, Any]] = {
        "trajectory": {"color": _BEST, "linewidth": 5, "solid_capstyle": "round"},
        "lanes": {"color": _LANES, "linewidth": 1.1, "linestyle": ":"},
    }
    for mode, look in looks.items():
        x, y = best_of(curves, measure, mode)
        if x:
            axes.plot(x, y, zorder=1.5, **look)


def best_of(curves: Sequence[xr.Dataset], measure: str, mode: str = "trajectory") -> tuple[list[float], list[float]]:
    """Return milliseconds and the least error that any of ``curves`` has reached by then, without lucky points.

    A coarser step that no finer one bears out is worth nothing.
    """
    timed = [points_of(curve, measure, mode) for curve in curves]
    points = sorted(point for times, errors in timed for point in zip(times, for_good(errors), strict=False))
    return [x for x, _ in points], list(accumulate((y for _, y in points), min))


def draw_legend(axes: Axes, handles: Sequence[Line2D], handlelength: float) -> None:
    """Draw a legend of two columns above ``axes``, of lines as long as given."""
    axes.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0, 1.07), ncols=2, borderaxespad=0, fontsize=6.5,
        columnspacing=1.0, handlelength=handlelength, labelspacing=0.25, frameon=False,
    )  # fmt: skip


def scale_axes(axes: Axes, ylabel: str) -> None:
    axes.margins(x=0.02, y=0.04)
    log_scale(axes, "xy")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, ERRORS[0]), min(high, ERRORS[1]))
    axes.set_ylabel(ylabel)


def _legend(figure: Figure, axes: Axes, curves: Sequence[xr.Dataset], per_row: int, *, envelopes: bool) -> None:
    """Draw the legend above the column of ``axes``; a missing curve has a mark."""
    handles, missing = [], set()
    for curve in curves:
        mark = ""
        if not curve.sizes["point"]:
            missing.add(absent := curve["status"].item() == "not installed")
            mark = f" {_MISSING[absent][0]}"
        handles.append(Line2D([], [], label=curve["label"].item() + mark, **line_of(curve)))
    for absent, says in _MISSING.items():
        if absent in missing:
            handles.append(Line2D([], [], linestyle="none", label=" ".join(says)))
    if envelopes:
        handles.append(Line2D([], [], color=_BEST, linewidth=5, label="best of these"))
        handles.append(Line2D([], [], color=_LANES, linestyle=":", label="the same, each of an ensemble"))
    box = axes.get_position()
    figure.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(box.x0 - 0.006, box.y1 + 0.26 / figure.get_figheight()),
        ncols=per_row,
        columnspacing=1.0,
        handlelength=2.2,
        borderaxespad=0,
        labelspacing=0.25,
        fontsize=7,
    )


def draw_facts(figure: Figure, facts: Mapping[str, object], left: float, characters: int) -> None:
    """Write machine and libraries below the panels, ``left`` inches from the edge, in lines of so many characters."""
    said = f"{machine_text(facts)} Versions: {facts['libraries']}."
    width, height = figure.get_size_inches()
    figure.text(left / width, 0.08 / height, fill(said, characters), fontsize=7.5)


def machine_text(facts: Mapping[str, object]) -> str:
    """Return date and machine of the timing, in two lines."""
    return (
        f"Drawn from timings, not reproducible bit for bit: measured {facts['measured']} on {facts['cpu']},\n"
        f"core {facts['pinned_core']}, one thread, least of interleaved repeats; load average {facts['load_average']}."
    )
