"""Figure of the regularised Kepler problem: error against time, compared with its original equations and heyoka.

It compares two forms of the equations, each integrated by this package and by heyoka; the other figures compare
programs on one form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, mark_every, new_figure, panel_letter
from nearharmonic.recommendation.curve import Curve
from nearharmonic.reproduction.experiments.work_precision.comparison import COMPARED_MEASURES, STANDARD, Pair, pairs
from nearharmonic.reproduction.experiments.work_precision.figures.comparison import leaders
from nearharmonic.reproduction.experiments.work_precision.figures.times import (
    YLABELS,
    draw_envelope,
    draw_facts,
    draw_legend,
    line_of,
    points_of,
    scale_axes,
)
from nearharmonic.reproduction.tasks.receipts import measures_time

#: Size of a panel, left margin, space above each row with and without a legend, and lower margin, in inches.
_WIDTH, _HEIGHT, _LEFT, _LEGEND, _TITLE, _BELOW = 4.8, 3.3, 0.75, 1.25, 0.65, 1.0
#: heyoka on the original and on the regularised equations: one colour each, dashed with ``fast_math``.
_LIBRARY: dict[str, dict[str, Any]] = {
    STANDARD: {"color": "#9c2f1f", "linewidth": 2.2, "marker": "s", "markersize": 4},
    f"{STANDARD}_fast_math": {"color": "#9c2f1f", "linestyle": (0, (4, 2)), "marker": "s", "markersize": 4},
    f"{STANDARD}_regularised": {"color": "#202020", "linewidth": 2.2, "marker": "D", "markersize": 4},
    f"{STANDARD}_regularised_fast_math": {
        "color": "#202020", "linestyle": (0, (4, 2)), "marker": "D", "markersize": 4,
    },
}  # fmt: skip
_EVERY: dict[str, Any] = {"color": "#c9c9c9", "linewidth": 0.8}
_ORIGINAL: dict[str, Any] = {"color": "#f2d8a7", "linewidth": 5.0, "solid_capstyle": "round"}


@measures_time
def regularised_figures(names: Sequence[str], cube: str) -> dict[str, Figure]:
    """Draw error against the time of one trajectory, on regularised and on original equations, as ``figure``.

    Of what :func:`pairs` reads, it shows the regularised systems whose original equations are among them too.
    """
    rows, facts = [], dict[str, object]()
    for measure in COMPARED_MEASURES:
        found, facts = pairs(cube, names, measure=measure)
        rows.append([pair for pair in found if pair.original])
    return {"figure": regularised_figure(rows, facts)}


@house_style
def regularised_figure(rows: Sequence[Sequence[Pair]], facts: Mapping[str, object]) -> Figure:
    """Draw a row of panels for each kind of error, a column for each regularised system; ``facts`` tell the machine."""
    across, down = len(rows[0]), len(rows)
    width, height = _LEFT + _WIDTH * across, _BELOW + _LEGEND + _HEIGHT * down + _TITLE * (down - 1)
    figure = new_figure(width, height)
    figure.subplots_adjust(
        left=_LEFT / width, right=0.99, top=1 - _LEGEND / height, bottom=_BELOW / height, wspace=0.12,
        hspace=_TITLE / _HEIGHT,
    )  # fmt: skip
    grid = figure.subplots(down, across, squeeze=False, sharex="col", sharey="row")
    chosen = [list({c.method: c for row in rows for c in leaders(row[i], "trajectory")}) for i in range(across)]
    for j, row in enumerate(rows):
        for i, pair in enumerate(row):
            axes = grid[j, i]
            _draw(axes, pair, chosen[i])
            scale_axes(axes, "" if i else YLABELS[pair.measure])
            panel_letter(axes, across * j + i, f"{pair.label}, t = {pair.t_end}")
    for i, pair in enumerate(rows[0]):
        grid[-1, i].set_xlabel("whole call for one trajectory  (ms)")
        _legend(grid[0, i], pair, chosen[i])
    draw_facts(figure, facts, _LEFT, int(17.5 * _WIDTH * across))
    return figure


def _draw(axes: Axes, pair: Pair, chosen: Sequence[str]) -> None:
    """Draw the best methods on the original equations, all methods on the regularised ones, and heyoka."""
    draw_envelope(axes, pair.own_original, pair.measure, "trajectory", _ORIGINAL)
    for curve in pair.own:
        axes.plot(*points_of(curve, pair.measure), zorder=2, **_EVERY)
    shown = _shown(pair, chosen)
    for position, (curve, look) in enumerate(shown):
        x, y = points_of(curve, pair.measure)
        axes.plot(x, y, markevery=mark_every(position, len(shown), len(x), marks=7), zorder=3, **look)


def _shown(pair: Pair, chosen: Sequence[str]) -> list[tuple[Curve, dict[str, Any]]]:
    """Return the curves with a name in the legend, with their styles."""
    own = [(curve, line_of(curve)) for curve in pair.own if curve.method in chosen]
    return own + [(curve, _LIBRARY[curve.method]) for curve in pair.others if curve.method in _LIBRARY]


def _legend(axes: Axes, pair: Pair, chosen: Sequence[str]) -> None:
    handles = [Line2D([], [], label=curve.label, **look) for curve, look in _shown(pair, chosen)]
    handles.append(Line2D([], [], label="every other method here, regularised", **_EVERY))
    handles.append(Line2D([], [], label="best method here, original equations", **_ORIGINAL))
    draw_legend(axes, handles, handlelength=2.8)
