"""Benchmark profile, as in Figures 1, 3 and 5: relative energy errors against tau/s."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.profile import (
    LARGEST_ERROR,
    PANELS,
    Line,
    energy_error_label,
    floor_name,
    floor_near,
    lines,
    problem_of,
    range_of,
)
from nearharmonic.plotting.style import (
    house_style,
    log_scale,
    mark_every,
    method_handles,
    new_figure,
    panel_letter,
    right_title,
    style_of,
    write_beside,
)

if TYPE_CHECKING:
    import xarray as xr

#: Dashes of a curve in extended precision.
DASHED: dict[str, Any] = {"linestyle": (0, (4, 2)), "marker": "none", "linewidth": 0.9, "zorder": 2}
#: Number of columns of the legend. There is space above the panels for the rows of ten methods.
COLUMNS, ROWS = 4, 3
#: Height of a row of the legend relative to the height of the figure.
ROW = 0.0195


@house_style
def draw_profile(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (top) and ``mean_energy_error`` (bottom) of every method of ``cube``.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally after ``precision`` with "double" (solid, marked)
    and "extended" (dashed). Infinite errors (diverged runs), NaN (not computed) and zeros leave gaps.
    """
    curves = lines(cube)
    handles = method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    if any(line.extended for line in curves):
        handles.append(Line2D([], [], color="#404040", linestyle=DASHED["linestyle"], label="extended precision"))
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    drawn = draw_profiles(curves, [DASHED if line.extended else {} for line in curves], handles, unit, [cube])
    right_title(drawn.axes[0], problem_of(cube, unit))
    return drawn


@house_style
def draw_profiles(
    curves: Sequence[Line],
    looks: Sequence[Mapping[str, Any]],
    handles: Sequence[Line2D],
    unit: str,
    given: Sequence[xr.Dataset],
) -> Figure:
    """Draw the maximum (top) and the mean (bottom) energy errors of methods against the step size per stage.

    ``looks`` are changes of the style of each curve, ``handles`` the entries of the legend. Of the Datasets ``given``
    the first has the attributes of the errors, and any may have a floor.
    """
    attributes = given[0]["max_energy_error"].attrs
    drawn = new_figure(7, 8.2)
    spare = ROW * max(0, ROWS - -(-len(handles) // COLUMNS))
    drawn.subplots_adjust(left=0.105, right=0.985, top=0.885 + spare, bottom=0.062, hspace=0.115)
    panels = dict(zip(PANELS, drawn.subplots(len(PANELS), 1, sharex=True, sharey=True), strict=True))
    for number, (variable, statistic) in enumerate(PANELS.items()):
        axes = panels[variable]
        for line, look in zip(curves, looks, strict=True):
            marks = mark_every(*line.turn, line.runs["tau_per_stage"].size)
            style = style_of(line.integrator).line(**{"zorder": 3, **look})
            axes.plot(line.runs["tau_per_stage"].values, line.runs[variable].values, markevery=marks, **style)
        axes.set_ylabel(error_label(attributes, r"\max\," if statistic == "maximum" else rf"\mathrm{{{statistic}}}\,"))
        panel_letter(axes, number, f"{statistic} {range_of(attributes)}")
    upper, *_, lower = panels.values()
    upper.margins(x=0.02, y=0.03)
    log_scale(upper, "xy")
    if upper.get_ylim()[1] > LARGEST_ERROR:
        upper.set_ylim(top=LARGEST_ERROR)
    for variable, axes in panels.items():
        if say_if_empty(axes, [line.runs[variable].values for line in curves]):
            taus = np.concatenate([line.runs["tau_per_stage"].values for line in curves])
            axes.set_xlim(taus.min() / 2, taus.max() * 2)
        else:
            _slope_guide(axes)
            draw_floor(axes, given, variable)
    lower.set_xlabel(r"step size per stage, $\tau/s$" + ("" if unit == "1" else f"  ({unit})"))
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=COLUMNS, columnspacing=1.8)
    return drawn


def error_label(attributes: Mapping[str, str], statistic: str = "") -> str:
    """Return the label of an axis of energy errors with these attributes, in the notation of matplotlib."""
    return energy_error_label(attributes, rf"${statistic}|\Delta H|$", rf"${statistic}|\Delta H/H_0|$")


def say_if_empty(axes: Axes, errors: Iterable[Any]) -> bool:
    """Write the reason into the middle of ``axes`` if no error can be drawn; return True in that case."""
    values = np.concatenate([np.ravel(one) for one in errors])
    if np.any(np.isfinite(values) & (values > 0)):
        return False
    if np.isinf(values).any():
        text = "every run diverged: it left its energy surface"
    else:
        text = "every energy error is 0" if np.any(values == 0) else "no energy errors"
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#595959")
    return True


def draw_floor(axes: Axes, given: Sequence[xr.Dataset], variable: str) -> None:
    """Draw :func:`floor_near`, unless it is 0, on axes with logarithmic energy errors."""
    floor = floor_near(given, variable)
    if not floor:
        return
    axes.axhline(floor, color="#595959", linewidth=0.7, linestyle=(0, (1, 1.5)), zorder=1.5)
    axes.annotate(
        floor_name(floor), (0.99, floor), xycoords=axes.get_yaxis_transform(), xytext=(0, 2),
        textcoords="offset points", ha="right", color="#595959", fontsize=8,
    )  # fmt: skip


def _slope_guide(axes: Axes) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, for comparison with curves."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    length = min(4.0, (right / left) ** 0.2)
    start_x, start_y = right / length**1.8, low * (high / low) ** 0.09
    for order in (4, 6):
        x, y = start_x * length, start_y * length**order
        axes.plot([start_x, x], [start_y, y], color="#8a8a8a", linewidth=1.0, scalex=False, scaley=False, zorder=1.5)
        write_beside(axes, f"order {order}", (x, y), (3, 0), color="#595959", va="center")
