"""Figure of the regularised Kepler problem: error against time, compared with its original equations and heyoka.

It compares two forms of the equations, each integrated by this package and by heyoka; the other figures compare
programs on one form. It is drawn of the cube of times, and of the file of the tables of docs/results/regularised.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from nearharmonic.output.table import from_csv
from nearharmonic.plotting.style import house_style, new_figure, panel_letter, style_of
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.work_precision.comparison import COMPARED_MEASURES, STANDARD, Pair, pairs
from nearharmonic_paper.experiments.work_precision.figures.times import (
    YLABELS,
    best_of,
    draw_facts,
    points_of,
    scale_axes,
)
from nearharmonic_paper.tasks.receipts import measures_time

#: Size of a panel, left margin, space above the first row, space for a title, lower margin, and space below it for the
#: machine, in inches.
_WIDTH, _HEIGHT, _LEFT, _LEGEND, _TITLE, _BELOW, _MACHINE = 4.2, 2.9, 0.65, 1.2, 0.55, 0.48, 0.5
_DASHES = (0, (4, 2))
_BEST: dict[str, Any] = {"linewidth": 6, "solid_capstyle": "round", "zorder": 2}
_ORIGINAL: dict[str, Any] = {"color": "#0072b2", "marker": "s", "markersize": 4.5, "linewidth": 1.4}
_REGULARISED: dict[str, Any] = {"color": "#d55e00", "marker": "o", "markersize": 4.5, "linewidth": 1.4}
_FAST: dict[str, Any] = {"linestyle": _DASHES, "markerfacecolor": "white"}
#: Curve -> its name, as in the tables of the page, and its look. Broad lines are the best method at each error.
CURVES: dict[str, tuple[str, dict[str, Any]]] = {
    "own": ("fastest method here, regularised", {"color": "#f6c3a2", **_BEST}),
    "babps9o7h": ("BAB's9o7H, regularised", style_of("babps9o7h").line(markersize=4)),
    "abas11o6_8h": ("ABAs11o6,8H, regularised", style_of("abas11o6_8h").line(markersize=4.5)),
    "own_original": ("fastest method here, original equations", {"color": "#cccccc", **_BEST}),
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
        found, facts = pairs(cube, names, measure=measure)
        rows.append([_panel(pair) for pair in found if pair.original])
    figure = draw_panels(rows, _BELOW + _MACHINE)
    draw_facts(figure, facts, _LEFT, int(17.5 * _WIDTH * len(rows[0])))
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
            both = panel.curves.setdefault(row["curve"], ([], []))
            for values, column in zip(both, ("ms", "error"), strict=True):
                values.append(float(row[column]))
    found = list(panels.values())
    return {"figure": draw_panels([found[i : i + 2] for i in range(0, len(found), 2)])}


@house_style
def draw_panels(rows: Sequence[Sequence[Panel]], below: float = _BELOW) -> Figure:
    """Draw rows of panels with the names of all curves above them; ``below`` is the lower margin in inches."""
    across, down = len(rows[0]), len(rows)
    width, height = _LEFT + _WIDTH * across, below + _LEGEND + _HEIGHT * down + _TITLE * (down - 1)
    figure = new_figure(width, height)
    figure.subplots_adjust(
        left=_LEFT / width, right=0.99, top=1 - _LEGEND / height, bottom=below / height, wspace=0.1,
        hspace=_TITLE / _HEIGHT,
    )  # fmt: skip
    grid = figure.subplots(down, across, squeeze=False, sharex="col", sharey="row")
    for j, row in enumerate(rows):
        for i, panel in enumerate(row):
            _draw(grid[j, i], panel)
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


def _draw(axes: Axes, panel: Panel) -> None:
    for key, (_, look) in CURVES.items():
        if key in panel.curves:
            axes.plot(*panel.curves[key], **{"zorder": 3, **look})
