"""Benchmark profile, as in Figures 1, 3 and 5: relative energy errors against tau/s."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.levels import LARGEST_ERROR, draw_floor, energy_error_label, energy_of, envelope
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

PANELS = (
    ("A", "max_energy_error", "maximum", r"\max"),
    ("B", "mean_energy_error", "mean", r"\mathrm{mean}"),
)
#: Dashes of a curve in extended precision.
DASHES = (0, (4, 2))
#: Number of columns of the legend. There is space above the panels for the rows of ten methods.
COLUMNS, ROWS = 4, 3
#: Height of a row of the legend relative to the height of the figure.
ROW = 0.0195


@dataclass(frozen=True, kw_only=True)
class Profile:
    """The energy errors of one method as functions of the step size per stage.

    Attributes
    ----------
    integrator : str
        Name of the method, which determines its style.
    tau_per_stage : array (n,)
        Step sizes per stage.
    errors : mapping
        Arrays (n,) with the names of :data:`PANELS` as keys. Infinite errors (diverged runs), NaN (not computed) and
        zeros leave gaps.
    turn : tuple of int
        Index of the method, and number of methods: their markers are at alternate points.
    look : mapping
        Changes of the style of the line.
    """

    integrator: str
    tau_per_stage: Any
    errors: Mapping[str, Any]
    turn: tuple[int, int]
    look: Mapping[str, Any]


@house_style
def draw_profile(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (top) and ``mean_energy_error`` (bottom) of every method of ``cube``.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally after ``precision`` with "double" (solid, marked)
    and "extended" (dashed). Infinite errors (diverged runs), NaN (not computed) and zeros leave gaps.
    """
    handles = method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    if "precision" in cube.dims and "extended" in cube["precision"].values:
        handles.append(Line2D([], [], color="#404040", linestyle=DASHES, label="extended precision"))
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    drawn = draw_profiles(list(_profiles(cube)), handles, unit, cube["max_energy_error"].attrs, [cube])
    right_title(drawn.axes[0], problem_of(cube, unit))
    return drawn


def problem_of(results: xr.Dataset, unit: str = "1") -> str:
    """Return system, interval and energy of runs, as far as attributes tell; ``unit`` is that of the time."""
    try:
        settings = json.loads(results.attrs["settings"])
        t_end = {**settings.get("settings", {}), **settings.get("sweep", {})}["t_end"]
    except (AttributeError, KeyError, TypeError, ValueError, RecursionError):
        t_end = None
    interval = "" if t_end is None else f"$t$ = {t_end}{'' if unit == '1' else f' {unit}'}"
    H0 = energy_of(results.attrs)
    return ", ".join(filter(None, (str(results.attrs.get("system_label", "")), interval, H0 and f"$H_0$ = {H0}")))


def _profiles(cube: xr.Dataset) -> Iterator[Profile]:
    names = [str(name) for name in cube["integrator"].values]
    for precision in [str(p) for p in cube["precision"].values] if "precision" in cube.dims else [""]:
        layer = cube.sel(precision=precision) if precision else cube
        for position, name in enumerate(names):
            runs = envelope(layer.sel(integrator=name), [variable for _, variable, _, _ in PANELS])
            yield Profile(
                integrator=name,
                tau_per_stage=runs["tau_per_stage"].values,
                errors={variable: runs[variable].values for _, variable, _, _ in PANELS},
                turn=(position, len(names)),
                look=dashed() if precision == "extended" else {},
            )


def dashed() -> dict[str, Any]:
    """Return the line style of extended precision."""
    return {"linestyle": DASHES, "marker": "none", "linewidth": 0.9, "zorder": 2}


@house_style
def draw_profiles(
    profiles: Sequence[Profile],
    handles: Sequence[Line2D],
    unit: str,
    attributes: Mapping[str, str],
    given: Sequence[xr.Dataset],
) -> Figure:
    """Draw the maximum (top) and the mean (bottom) energy errors of methods against the step size per stage.

    Parameters
    ----------
    profiles, handles
        Curves, in drawing order, and entries of the legend.
    unit : str
        Unit of the step sizes; "1" if they have none.
    attributes : mapping
        Attributes of the errors: the energy to which they are relative, and the range of the maximum.
    given : sequence of xarray.Dataset
        Datasets of the curves, which may have a floor of energy errors.
    """
    over = range_of(attributes)
    drawn = new_figure(7, 8.2)
    spare = ROW * max(0, ROWS - -(-len(handles) // COLUMNS))
    drawn.subplots_adjust(left=0.105, right=0.985, top=0.885 + spare, bottom=0.062, hspace=0.115)
    upper, lower = drawn.subplots(2, 1, sharex=True, sharey=True)
    for axes, (letter, variable, says, symbol) in zip((upper, lower), PANELS, strict=True):
        _draw(axes, variable, profiles)
        label = energy_error_label(attributes, rf"${symbol}\,|\Delta H|$", rf"${symbol}\,|\Delta H/H_0|$")
        axes.set_ylabel(label)
        panel_letter(axes, letter, f"{says} {over}")
    _scale(upper)
    for (_, variable, _, _), axes in zip(PANELS, (upper, lower), strict=True):
        if say_if_empty(axes, [one.errors[variable] for one in profiles]):
            taus = np.concatenate([one.tau_per_stage for one in profiles])
            axes.set_xlim(taus.min() / 2, taus.max() * 2)
        else:
            _slope_guide(axes)
            draw_floor(axes, given, variable)
    lower.set_xlabel(r"step size per stage, $\tau/s$" + ("" if unit == "1" else f"  ({unit})"))
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=COLUMNS, columnspacing=1.8)
    return drawn


def range_of(attributes: Mapping[str, str]) -> str:
    """Return the range of the maximum of energy errors with these attributes, in words."""
    return "over the samples" if "over the samples" in attributes.get("long_name", "") else "over all steps"


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


def _draw(axes: Axes, variable: str, profiles: Iterable[Profile]) -> None:
    for one in profiles:
        marks = mark_every(*one.turn, len(one.tau_per_stage))
        look = style_of(one.integrator).line(**{"zorder": 3, **one.look})
        axes.plot(one.tau_per_stage, one.errors[variable], markevery=marks, **look)


def _scale(axes: Axes) -> None:
    """Make the shared axes of both panels logarithmic, with a range that covers the curves of both."""
    axes.margins(x=0.02, y=0.03)
    log_scale(axes, "xy")
    if axes.get_ylim()[1] > LARGEST_ERROR:
        axes.set_ylim(top=LARGEST_ERROR)


def _slope_guide(axes: Axes) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, for comparison with curves."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    length = min(4.0, (right / left) ** 0.2)
    start_x, start_y = right / length**1.8, low * (high / low) ** 0.09
    for order in (4, 6):
        x, y = start_x * length, start_y * length**order
        axes.plot([start_x, x], [start_y, y], color="#8a8a8a", linewidth=1.0, scalex=False, scaley=False, zorder=1.5)
        write_beside(axes, f"order {order}", (x, y), (3, 0), color="#595959", va="center")
