"""The benchmark profile of Figures 1, 3, 5 and of every other system: relative energy errors against tau/s."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.experiments.paper.figures.levels import LARGEST_ERROR
from nearharmonic.output.declarations import figure
from nearharmonic.output.style import (
    house_style,
    log_scale,
    mark_every,
    method_handles,
    new_figure,
    panel_letter,
    style_of,
)

if TYPE_CHECKING:
    import xarray as xr

PANELS = (
    ("A", "max_energy_error", "maximum over all steps", r"$\max\,|\Delta H/H_0|$"),
    ("B", "mean_energy_error", "mean over all steps", r"$\mathrm{mean}\,|\Delta H/H_0|$"),
)


@figure(
    cube="{system}",
    profile=True,
    caption=(
        "Benchmark profile: largest (A) and mean (B) relative energy error over every step of a run, against step "
        "size per stage tau/s; each point is a whole run. Dashed lines, if any, are in extended precision. A curve "
        "ends where runs leave their energy surface. Filled markers are the methods of Nielsen (2015)."
    ),
)
def energy_error(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of any system."""
    return draw_profile(cube)


@house_style
def draw_profile(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (top) and ``mean_energy_error`` (bottom) of every method of ``cube``.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally led by ``precision`` with "double" (solid, marked)
    and "extended" (dashed). Infinite errors (diverged runs), NaN (not computed) and zeros leave gaps.
    """
    drawn = new_figure(7, 8.2)
    drawn.subplots_adjust(left=0.105, right=0.985, top=0.885, bottom=0.062, hspace=0.115)
    upper, lower = drawn.subplots(2, 1, sharex=True, sharey=True)
    precisions = [str(p) for p in cube["precision"].values] if "precision" in cube.dims else ["double"]
    for axes, (letter, variable, says, ylabel) in zip((upper, lower), PANELS, strict=True):
        for precision in precisions:
            errors = cube[variable].sel(precision=precision) if "precision" in cube.dims else cube[variable]
            _draw_methods(axes, errors, dashed=precision == "extended")
        axes.set_ylabel(ylabel)
        panel_letter(axes, letter, says)
    _scale(upper)
    for axes in (upper, lower):
        _slope_guide(axes)
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    lower.set_xlabel(r"step size per stage, $\tau/s$" + ("" if unit == "1" else f"  ({unit})"))
    handles = method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    if "extended" in precisions:
        handles.append(Line2D([], [], color="#404040", linestyle=(0, (4, 2)), label="extended precision"))
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_methods(axes: Axes, errors: xr.DataArray, *, dashed: bool) -> None:
    tau_per_stage = errors["tau_per_stage"].values
    names = [str(name) for name in errors["integrator"].values]
    for position, name in enumerate(names):
        changes = {"linestyle": (0, (4, 2)), "marker": "none", "linewidth": 0.9} if dashed else {}
        axes.plot(
            tau_per_stage,
            errors.sel(integrator=name).values,
            markevery=mark_every(position, len(names), len(tau_per_stage)),
            zorder=2 if dashed else 3,
            **style_of(name).line(**changes),
        )


def _scale(axes: Axes) -> None:
    """Make the axes, shared by both panels, logarithmic and wide enough for all that was drawn in either."""
    axes.margins(x=0.02, y=0.03)
    log_scale(axes, "xy")
    if axes.get_ylim()[1] > LARGEST_ERROR:
        axes.set_ylim(top=LARGEST_ERROR)


def _slope_guide(axes: Axes) -> None:
    """Two short lines of slope 4 and 6 in the empty lower right corner: the order that a curve's slope reads."""
    start_x = axes.get_xlim()[1] / 12
    start_y = axes.get_ylim()[0] * 30
    for order in (4, 6):
        x, y = start_x * 4, start_y * 4.0**order
        axes.plot([start_x, x], [start_y, y], color="#8a8a8a", linewidth=1.0, scalex=False, scaley=False, zorder=1.5)
        axes.annotate(
            f"order {order}",
            (x, y),
            xytext=(3, 0),
            textcoords="offset points",
            color="#595959",
            fontsize=8,
            va="center",
        )
