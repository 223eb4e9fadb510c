"""Figure 4: advance of Mercury's perihelion caused by the integrator, against force evaluations per orbit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.output.dataset import double_runs
from nearharmonic.plotting.energy_error import problem_of
from nearharmonic.plotting.levels import MERCURY_RELATIVISTIC_ADVANCE, arcseconds_per_century, envelope
from nearharmonic.plotting.style import (
    log_scale,
    log_ticks,
    mark_every,
    method_handles,
    new_figure,
    right_title,
    style_of,
    write_beside,
)
from nearharmonic_paper.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr

#: Each point is a dot with a bar, 1.5 mm wide.
COLUMNS = 100


@figure(
    cube="kepler",
    target="fig4",
    caption=(
        "Spurious advance of Mercury's perihelion: absolute rate of rotation of the Laplace-Runge-Lenz vector, by "
        "linear regression over the orbits of ten years, in radians per orbit (left) and arcseconds per century "
        "(right), against force evaluations per orbit. A dot is a run, every few of them carry the method's marker; "
        "bars show the 95 % interval of the fit where it exceeds the dot. Crosses are runs whose interval includes "
        "zero. The dashed line is the advance that general relativity explains, 42.98 arcseconds per century: a run "
        "above it errs by more than that."
    ),
)
def fig4_perihelion(cube: xr.Dataset) -> Figure:
    """Draw |perihelion_advance| of ``cube``, dimensions (precision, integrator, tau_per_stage), in rad per orbit.

    ``cube.attrs["orbital_period"]``, in h, converts it to arcseconds per century. Runs without a finite advance or
    interval are omitted.
    """
    drawn = new_figure(7, 6.4)
    drawn.subplots_adjust(left=0.105, right=0.895, top=0.865, bottom=0.08)
    axes = drawn.subplots()
    names = [str(name) for name in cube["integrator"].values]
    runs = double_runs(cube)
    for position, name in enumerate(names):
        _draw_method(axes, runs.sel(integrator=name), name, position, len(names))
    axes.margins(x=0.03, y=0.04)
    log_scale(axes, "xy")
    axes.set_xlabel("force evaluations per orbit")
    right_title(axes, problem_of(cube, str(cube["tau_per_stage"].attrs.get("units", "1"))))
    axes.set_ylabel("|perihelion advance|  (rad per orbit)")
    _add_century_axis(axes, arcseconds_per_century(float(cube.attrs["orbital_period"])))
    handles = method_handles(names, map(str, cube["label"].values))
    handles.append(
        Line2D([], [], color="#404040", linestyle="none", marker="x", markersize=4, label="95 % interval includes 0")
    )
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_method(axes: Axes, runs: xr.Dataset, name: str, position: int, methods: int) -> None:
    style = style_of(name)
    runs = envelope(runs, ["perihelion_advance"], COLUMNS)
    evaluations = runs["evaluations_per_orbit"].values
    advance, interval = abs(runs["perihelion_advance"]), runs["perihelion_advance_interval"]
    known = advance.where(interval < advance)
    unknown = advance.where(interval >= advance)
    bars = interval.where(interval < advance).values
    axes.errorbar(evaluations, known.values, yerr=bars, fmt="none", ecolor=style.colour, elinewidth=0.8)
    axes.plot(evaluations, known.values, color=style.colour, linewidth=0.5, marker=".", markersize=3.2)
    axes.plot(
        evaluations,
        known.values,
        markevery=mark_every(position, methods, int(known.count()), marks=8),
        **style.points(),
    )
    axes.plot(evaluations, unknown.values, **style.points(marker="x", markersize=4, alpha=0.5))


def _add_century_axis(axes: Axes, arcseconds: float) -> None:
    """Add a second axis, ``arcseconds`` per century for 1 rad/orbit, and a line for the relativistic advance."""
    functions: Any = (lambda y: y * arcseconds, lambda y: y / arcseconds)
    century = axes.secondary_yaxis("right", functions=functions)
    century.set_ylabel("|perihelion advance|  (arcseconds per century)")
    log_ticks(century.yaxis)
    axes.tick_params(axis="y", which="both", right=False)
    level = MERCURY_RELATIVISTIC_ADVANCE / arcseconds
    axes.axhline(level, color="#404040", linestyle=(0, (6, 3)), linewidth=0.9, zorder=1.5)
    text = f"general relativity: {MERCURY_RELATIVISTIC_ADVANCE}″ per century"
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
    among = {"xycoords": ("axes fraction", "data"), "ha": "right", "zorder": 5}
    write_beside(axes, text, (0.988, level), (0, 4), bbox=box, **among)
