"""Figures of error against time: work precision, comparison with libraries, the regularised Kepler problem."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import ceil, isfinite
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from nearharmonic.integrators import BENCHMARKED
from nearharmonic.output.table import from_csv
from nearharmonic.plotting.style import house_style, log_scale, mark_every, new_figure, panel_letter, style_of
from nearharmonic.recommendation.measure import MEASURES, Part, for_good, of_kind, read_parts
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision.peers import PEERS
from nearharmonic_paper.experiments.work_precision.tables import COMPARED_MEASURES, STANDARD, Pair, pairs
from nearharmonic_paper.experiments.work_precision.tables import ERRORS as COMPARED_ERRORS
from nearharmonic_paper.tasks.provenance import measures_time

# --- Work-precision diagrams: error against wall time -----------------------------------------------------------------

YLABELS = {
    "max": r"$\max\,|\Delta H/H_0|$",
    "mean": r"$\mathrm{mean}\,|\Delta H/H_0|$",
    "position": r"position error",
}
#: Limits of errors: larger errors are meaningless, and smaller ones are rounding errors.
ERRORS = (1e-17, 10.0)

#: Content of each column of panels, and number of methods per row of its legend.
_COLUMNS = (("methods of the paper", 3), ("beyond the paper", 3), ("other libraries", 2))
#: Marks after the name of a curve without points, and what they say.
_MISSING = {"†": "not installed", "‡": "no run: see the table"}
_BEST, _LANES = "#f2d8a7", "#b08030"
_ENVELOPES: dict[str, dict[str, Any]] = {
    "trajectory": {"color": _BEST, "linewidth": 5, "solid_capstyle": "round"},
    "lanes": {"color": _LANES, "linewidth": 1.1, "linestyle": ":"},
}
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
    return [curve for curve in of_kind(curves, "splitting") if (curve["solver"].item() in BENCHMARKED) != bool(column)]


def points_of(curve: xr.Dataset, measure: str, mode: str = "trajectory") -> tuple[list[float], list[float]]:
    """Return milliseconds and errors of the successfully timed points."""
    x, y = 1e3 * curve[f"time_{mode}"].values, curve[MEASURES[measure]].values
    inside = np.isfinite(x) & (ERRORS[0] < y) & (y < ERRORS[1])
    return x[inside].tolist(), y[inside].tolist()


def _draw(axes: Axes, curves: Sequence[xr.Dataset], measure: str, mode: str = "trajectory", broad: str = "") -> None:
    """Draw curves, the curve of the solver ``broad`` as a broad line."""
    for position, curve in enumerate(curves):
        x, y = points_of(curve, measure, mode)
        every = mark_every(position, len(curves), y, marks=7)
        axes.plot(x, y, markevery=every, zorder=3, **line_of(curve, broad))


def line_of(curve: xr.Dataset, broad: str = "") -> dict[str, Any]:
    """Return the keywords of ``Axes.plot`` for a curve."""
    name = curve["solver"].item()
    if curve["kind"] == "splitting":
        return style_of(name).line(markersize=4.2)
    i = list(PEERS).index(name) % len(_PEER_COLOURS) if name in PEERS else 0
    look = {"color": _PEER_COLOURS[i], "marker": _PEER_MARKERS[i], "linestyle": (0, (4, 2)), "markersize": 6}
    return look | ({"linewidth": 2.2} if name == broad else {})


def _envelopes(axes: Axes, curves: Sequence[xr.Dataset], measure: str) -> None:
    """Draw the smallest error of all ``curves`` at each time, for one trajectory and in lanes."""
    for mode, look in _ENVELOPES.items():
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


def scale_axes(axes: Axes, ylabel: str) -> None:
    axes.margins(x=0.02, y=0.04)
    log_scale(axes, "xy")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, ERRORS[0]), min(high, ERRORS[1]))
    axes.set_ylabel(ylabel)


def _legend(figure: Figure, axes: Axes, curves: Sequence[xr.Dataset], per_row: int, *, envelopes: bool) -> None:
    """Draw the legend above the column of ``axes``; a missing curve has a mark."""
    handles, marks = [], set[str]()
    for curve in curves:
        mark = "" if curve.sizes["point"] else "†" if curve["status"] == "not installed" else "‡"
        marks.add(mark)
        handles.append(Line2D([], [], label=f"{curve['label'].item()} {mark}".rstrip(), **line_of(curve)))
    texts = [f"{mark} {words}" for mark, words in _MISSING.items() if mark in marks]
    handles += [Line2D([], [], linestyle="none", label=text) for text in texts]
    if envelopes:
        handles.append(Line2D([], [], color=_BEST, linewidth=5, label="best of these"))
        handles.append(Line2D([], [], color=_LANES, linestyle=":", label="the same, each of an ensemble"))
    box = axes.get_position()
    figure.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(box.x0 - 0.006, box.y1 + 0.26 / figure.get_figheight()),
        ncols=per_row, columnspacing=1.0, handlelength=2.2, borderaxespad=0, labelspacing=0.25, fontsize=7,
    )  # fmt: skip


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


# --- This package and other libraries: one trajectory, and ensembles, with a panel for each system --------------------

#: Number of panels per row, and their size and the left margin in inches.
_ACROSS, _WIDTH, _HEIGHT, _LEFT = 3, 4.6, 3.6, 0.75

_XLABELS = {
    "trajectory": "whole call for one trajectory  (ms)",
    "lanes": "whole call for an ensemble, per trajectory  (ms)",
}


@measures_time
def comparison_figures(names: Sequence[str], cube: str) -> dict[str, Figure]:
    """Draw what :func:`pairs` reads: error against the time of whole calls, for ``trajectory`` and ``lanes``."""
    compared, facts = pairs(cube, names)
    return {mode: comparison_figure(compared, mode, facts) for mode in _XLABELS}


@house_style
def comparison_figure(compared: Sequence[Pair], mode: str, facts: Mapping[str, object]) -> Figure:
    """Draw a panel for each system: the fastest methods at some error, and all other libraries.

    ``mode`` is "trajectory" or "lanes"; ``facts`` are properties of the machine, from
    :func:`nearharmonic.numerics.clock.machine`, and ``libraries``.
    """
    across = min(len(compared), _ACROSS)
    down = ceil(len(compared) / across)
    members = [
        [*leaders(pair, mode), *(curve for curve in pair.others if np.isfinite(curve[f"time_{mode}"]).any())]
        for pair in compared
    ]
    legend = 0.45 + 0.15 * ceil(max(map(len, members)) / 2)
    height = 1.0 + down * (_HEIGHT + legend)
    figure = new_figure(_LEFT + _WIDTH * across, height)
    figure.subplots_adjust(
        left=_LEFT / figure.get_figwidth(), right=0.99, top=1 - legend / height, bottom=1.0 / height, wspace=0.23,
        hspace=(legend + 0.5) / _HEIGHT,
    )  # fmt: skip
    grid = figure.subplots(down, across, squeeze=False)
    for i, (axes, pair, curves) in enumerate(zip(grid.flat, compared, members, strict=False)):
        _draw(axes, curves, "max", mode, broad=STANDARD)
        scale_axes(axes, YLABELS["max"])
        axes.legend(
            handles=[Line2D([], [], label=c["label"].item(), **line_of(c, STANDARD)) for c in curves], ncols=2,
            loc="lower left", bbox_to_anchor=(0, 1.07), borderaxespad=0, fontsize=6.5, columnspacing=1.0,
            handlelength=2.4, labelspacing=0.25, frameon=False,
        )  # fmt: skip
        panel_letter(axes, i, f"{pair.label}, t = {pair.t_end}")
        axes.set_xlabel(_XLABELS[mode])
    for axes in grid.flat[len(compared) :]:
        axes.remove()
    draw_facts(figure, facts, _LEFT, int(17.5 * _WIDTH * across))
    return figure


def leaders(pair: Pair, mode: str) -> list[xr.Dataset]:
    """Return the methods of this package that are the fastest at one of the compared errors, each once."""
    first = [order[0][0] for error in COMPARED_ERRORS if (order := pair.fastest(error, mode))]
    return list({curve["solver"].item(): curve for curve in first}.values())


# --- The regularised Kepler problem: beside its original equations and heyoka -----------------------------------------
#
# It compares two forms of the equations, each integrated by this package and by heyoka; the other figures compare
# programs on one form. It is drawn of the cube of times, and of the file of the tables of docs/results/regularised.md.

#: Size of a panel and left margin, space above the first row, for a title, below the panels, and for the machine, in
#: inches.
_WIDE, _HIGH, _MARGIN, _ABOVE, _TITLE, _BELOW, _MACHINE = 4.2, 2.9, 0.65, 1.2, 0.55, 0.48, 0.5
_DASHES = (0, (4, 2))
_REGULARISED_BEST: dict[str, Any] = {"linewidth": 6, "solid_capstyle": "round", "zorder": 2}
_ORIGINAL: dict[str, Any] = {"color": "#0072b2", "marker": "s", "markersize": 4.5, "linewidth": 1.4}
_REGULARISED: dict[str, Any] = {"color": "#d55e00", "marker": "o", "markersize": 4.5, "linewidth": 1.4}
_FAST: dict[str, Any] = {"linestyle": _DASHES, "markerfacecolor": "white"}
#: Curve -> its name, as in the tables of the page, and its look. Broad lines are the best method at each error.
CURVES: dict[str, tuple[str, dict[str, Any]]] = {
    "own": ("fastest method here, regularised", {"color": "#f6c3a2", **_REGULARISED_BEST}),
    "babps9o7h": ("BAB's9o7H, regularised", style_of("babps9o7h").line(markersize=4)),
    "abas11o6_8h": ("ABAs11o6,8H, regularised", style_of("abas11o6_8h").line(markersize=4.5)),
    "own_original": ("fastest method here, original equations", {"color": "#cccccc", **_REGULARISED_BEST}),
    STANDARD: ("heyoka (adaptive Taylor), original equations", _ORIGINAL),
    f"{STANDARD}_fast_math": ("heyoka, fast_math, original equations", _ORIGINAL | _FAST),
    f"{STANDARD}_regularised": ("heyoka, regularised equations", _REGULARISED),
    f"{STANDARD}_regularised_fast_math": ("heyoka, regularised, fast_math", _REGULARISED | _FAST),
}
_LABELS = YLABELS | {"position": "relative error of the position at the end"}


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Curves of one kind of error on one orbit: milliseconds and errors by the keys of :data:`CURVES`."""

    title: str
    measure: str
    curves: dict[str, tuple[list[float], list[float]]]


@measures_time
def regularised_figures(names: Sequence[str], cube: str) -> dict[str, Figure]:
    """Draw error against the time of one trajectory, on regularised and on original equations, as ``figure``.

    Of what :func:`pairs` reads, it shows the regularised systems whose original equations are among them too.
    """
    rows, facts = [], dict[str, object]()
    for measure in COMPARED_MEASURES:
        compared, facts = pairs(cube, names, measure=measure)
        rows.append([_panel(pair) for pair in compared if pair.original])
    figure = draw_panels(rows, _BELOW + _MACHINE)
    draw_facts(figure, facts, _MARGIN, int(17.5 * _WIDE * len(rows[0])))
    return {"figure": figure}


def _panel(pair: Pair) -> Panel:
    named = {curve["solver"].item(): curve for curve in (*pair.own, *pair.others)}
    single = {name: points_of(named[name], pair.measure) for name in CURVES if name in named}
    best = {"own": best_of(pair.own, pair.measure), "own_original": best_of(pair.own_original, pair.measure)}
    unit = systems[pair.system].units["t"]
    return Panel(title=f"{pair.label}, $t$ = {pair.t_end} {unit}", measure=pair.measure, curves=single | best)


def figure_of_file(times: str) -> dict[str, Figure]:
    """Draw the file of the times of docs/results/regularised.md as ``figure``: a panel for each of its tables."""
    panels: dict[tuple[str, ...], Panel] = {}
    for row in from_csv(Path(times).read_text(encoding="utf-8")).records():
        title = f"Sun-Mercury orbit, e = {row['e']}, $t$ = {row['t_end']} h"
        panel = panels.setdefault((row["measure"], row["e"]), Panel(title=title, measure=row["measure"], curves={}))
        if isfinite(float(row["ms"])):
            x, y = panel.curves.setdefault(row["curve"], ([], []))
            x.append(float(row["ms"]))
            y.append(float(row["error"]))
    shown = list(panels.values())
    return {"figure": draw_panels([shown[i : i + 2] for i in range(0, len(shown), 2)])}


@house_style
def draw_panels(rows: Sequence[Sequence[Panel]], below: float = _BELOW) -> Figure:
    """Draw rows of panels with the names of all curves above them; ``below`` is the lower margin in inches."""
    across, down = len(rows[0]), len(rows)
    width, height = _MARGIN + _WIDE * across, below + _ABOVE + _HIGH * down + _TITLE * (down - 1)
    figure = new_figure(width, height)
    figure.subplots_adjust(
        left=_MARGIN / width, right=0.99, top=1 - _ABOVE / height, bottom=below / height, wspace=0.1,
        hspace=_TITLE / _HIGH,
    )  # fmt: skip
    grid = figure.subplots(down, across, squeeze=False, sharex="col", sharey="row")
    for j, row in enumerate(rows):
        for i, panel in enumerate(row):
            for key in [key for key in CURVES if key in panel.curves]:
                grid[j, i].plot(*panel.curves[key], **{"zorder": 3, **CURVES[key][1]})
            scale_axes(grid[j, i], "" if i else _LABELS[panel.measure])
            panel_letter(grid[j, i], across * j + i, panel.title)
    for axes in grid[-1]:
        axes.set_xlabel("whole call for one trajectory  (ms)")
        axes.xaxis.set_major_locator(LogLocator(base=10, subs=(1, 2, 5), numticks=20))
        axes.xaxis.set_major_formatter("{x:g}")
    shown = {key for row in rows for panel in row for key in panel.curves}
    handles = [Line2D([], [], label=label, **look) for key, (label, look) in CURVES.items() if key in shown]
    figure.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.53, 1 - 0.05 / height), ncols=min(2, across),
        handlelength=3.2, columnspacing=1.6, labelspacing=0.35,
    )  # fmt: skip
    return figure
