"""Work-precision diagrams: error against wall time, for the methods of the paper, those beyond it, and peers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, isfinite
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.curve import MEASURES, Curve, Part, for_good
from nearharmonic.integrators import BENCHMARKED
from nearharmonic.render.style import house_style, log_scale, mark_every, new_figure, panel_letter, style_of

CAPTION = (
    "Timings. Error against the wall time of one trajectory on one core: largest and mean relative energy error, and "
    "error of the position at the end against the exact orbit. Left, the paper's methods; right, methods beyond the "
    "paper (solid) and other libraries as their users use them (dashed, grey). The broad pale line is the best of the "
    "paper's methods at each time, the dotted one the same with eight trajectories in SIMD lanes, per trajectory. "
    "Times are the least of several repeats that took turns; they depend on the machine, which is named below."
)

YLABELS = {
    "max": r"$\max\,|\Delta H/H_0|$",
    "mean": r"$\mathrm{mean}\,|\Delta H/H_0|$",
    "position": r"position error",
}
#: Beyond these nothing is a trajectory any more, or all is rounding.
_ERRORS = (1e-17, 10.0)

_LEGEND_COLUMNS = 6
_PEER_COLOURS = ("#303030", "#6e6e6e", "#8c6d46", "#3e6b6b", "#7a5a86", "#a06060", "#5f7d3a", "#4f5f8f")
_PEER_MARKERS = ("x", "+", "*", "1", "2", "3", "4", "|")


@house_style
def work_precision_figure(label: str, parts: Sequence[Part], facts: Mapping[str, object]) -> Figure:
    """A row of panels for each measure of each of ``parts`` (t_end, measures, curves), and the machine in ``facts``."""
    rows = [(t_end, measure, curves) for t_end, measures, curves in parts for measure in measures]
    legend = 0.35 + 0.155 * ceil((len(rows[0][2]) + 2) / _LEGEND_COLUMNS)
    figure = new_figure(10.2, 0.85 + legend + 2.7 * len(rows))
    height = figure.get_figheight()
    figure.subplots_adjust(
        left=0.075, right=0.99, top=1 - legend / height, bottom=0.82 / height, hspace=0.27, wspace=0.05
    )
    grid = figure.subplots(len(rows), 2, sharey="row", sharex="row", squeeze=False)
    for row, (t_end, measure, curves) in enumerate(rows):
        for column, axes in enumerate(grid[row]):
            shown = [c for c in curves if (c.method in BENCHMARKED) != bool(column)]
            _envelopes(axes, [c for c in curves if c.method in BENCHMARKED], measure)
            _draw(axes, shown, measure)
            says = ("methods of the paper", "beyond the paper, and peers")[column]
            panel_letter(axes, "ABCDEFGH"[2 * row + column], f"{says}, t = {t_end}")
        _scale(grid[row, 0], YLABELS[measure])
    for axes in grid[-1]:
        axes.set_xlabel("wall time of one trajectory  (ms)")
    _legend(figure, parts[0][2])
    figure.text(0.075, 0.1 / height, _machine(label, facts), fontsize=7.5, color="#404040", va="bottom")
    return figure


def _xy(curve: Curve, measure: str, mode: str = "trajectory") -> tuple[list[float], list[float]]:
    """Milliseconds and errors of the points that were timed and did not fail."""
    pairs = [
        (1e3 * min(point.times[mode]), getattr(point, MEASURES[measure]))
        for point in curve.points
        if point.times.get(mode) and isfinite(getattr(point, MEASURES[measure]))
    ]
    inside = [(x, y) for x, y in pairs if _ERRORS[0] < y < _ERRORS[1]]
    return [x for x, _ in inside], [y for _, y in inside]


def _draw(axes: Axes, curves: Sequence[Curve], measure: str) -> None:
    for position, curve in enumerate(curves):
        x, y = _xy(curve, measure)
        axes.plot(x, y, markevery=mark_every(position, len(curves), len(x), marks=7), zorder=3, **_line(curve))


def _line(curve: Curve) -> dict[str, Any]:
    if curve.kind == "splitting":
        return style_of(curve.method).line(markersize=4.2)
    from nearharmonic.peers import PEERS

    i = list(PEERS).index(curve.method) % len(_PEER_COLOURS) if curve.method in PEERS else 0
    return {"color": _PEER_COLOURS[i], "marker": _PEER_MARKERS[i], "linestyle": (0, (4, 2)), "markersize": 6}


def _envelopes(axes: Axes, curves: Sequence[Curve], measure: str) -> None:
    """The least error that any of ``curves`` has reached by each time: of one trajectory, and in lanes."""
    for mode, look in (
        ("trajectory", {"color": "#f2d8a7", "linewidth": 5, "solid_capstyle": "round"}),
        ("lanes", {"color": "#b08030", "linewidth": 1.1, "linestyle": ":"}),
    ):
        points = sorted(pair for curve in curves for pair in _settled(*_xy(curve, measure, mode)))
        if points:
            x, y = np.array(points).T
            axes.plot(x, np.minimum.accumulate(y), zorder=1.5, **look)  # type: ignore[arg-type]


def _settled(times: Sequence[float], errors: Sequence[float]) -> list[tuple[float, float]]:
    """The points of one curve without lucky ones: a coarser step that no finer one bears out is worth nothing."""
    return list(zip(times, for_good(errors), strict=False))


def _scale(axes: Axes, ylabel: str) -> None:
    axes.margins(x=0.02, y=0.04)
    log_scale(axes, "xy")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, _ERRORS[0]), min(high, _ERRORS[1]))
    axes.set_ylabel(ylabel)


def _legend(figure: Figure, curves: Sequence[Curve]) -> None:
    handles = [
        Line2D([], [], label=curve.label + ("" if curve.points else f" ({curve.status.split(':')[0]})"), **_line(curve))
        for curve in curves
    ]
    handles.append(Line2D([], [], color="#f2d8a7", linewidth=5, label="best of the paper's methods"))
    handles.append(Line2D([], [], color="#b08030", linestyle=":", label="the same, eight in lanes"))
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.53, 0.998),
        ncols=_LEGEND_COLUMNS,
        columnspacing=1.2,
        fontsize=7,
    )


def _machine(label: str, facts: Mapping[str, object]) -> str:
    return (
        f"{label}. Drawn from timings, not reproducible bit for bit: measured {facts['measured']} on {facts['cpu']},\n"
        f"core {facts['pinned_core']}, one thread, least of interleaved repeats; load average {facts['load_average']}."
    )
