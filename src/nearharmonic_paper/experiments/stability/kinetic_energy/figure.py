"""Figure of energy errors for a kinetic energy different from p^2/2, on the relativistic oscillator."""

from __future__ import annotations

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import (
    house_style,
    log_scale,
    mark_every,
    method_handles,
    new_figure,
    panel_letter,
    style_of,
)

#: Amplitudes of the panels A and B.
SMALL, RELATIVISTIC = 0.03, 1.0
_LARGEST_ERROR = 10.0


@house_style
def kinetic_energy(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (roles, amplitude, integrator, tau_per_stage) and ``relative_error`` of ``cube``."""
    drawn = new_figure(7, 7.4)
    drawn.subplots_adjust(left=0.105, right=0.985, top=0.865, bottom=0.065, hspace=0.3, wspace=0.25)
    upper, lower = drawn.subplots(2, 2, sharey="row")
    for axes, letter, amplitude in zip(upper, "AB", (SMALL, RELATIVISTIC), strict=True):
        errors = cube.max_energy_error.sel(roles="own").sel(amplitude=amplitude, method="nearest")
        _draw(axes, errors, "tau_per_stage")
        axes.set_xlabel(r"step size per stage, $\tau/s$")
        panel_letter(axes, letter, f"amplitude {errors.amplitude.item():g}")
    upper[0].set_ylabel(r"$\max\,|\Delta H/H_0|$")
    for axes in upper:
        axes.set_ylim(top=min(axes.get_ylim()[1], _LARGEST_ERROR))
    ratio = cube.relative_error
    says = {
        "own": rf"error / Ruth's at $\tau/s$ = {cube.attrs['compared_at']:g}",
        "exchanged": "the same, T and V exchanged",
    }
    for axes, letter, roles in zip(lower, "CD", says, strict=True):
        _draw(axes, ratio.sel(roles=roles), "amplitude")
        axes.set_xlabel("amplitude $A$")
        panel_letter(axes, letter, says[roles])
    lower[0].set_ylabel("error / Ruth's")
    labels = map(str, cube.label.values)
    handles: list[Line2D] = method_handles(map(str, cube.integrator.values), labels)
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw(axes: Axes, values: xr.DataArray, along: str) -> None:
    names = [str(name) for name in values.integrator.values]
    for position, name in enumerate(names):
        curve = values.sel(integrator=name)
        every = mark_every(position, len(names), curve.size)
        axes.plot(curve[along].values, curve.values, markevery=every, **style_of(name).line(markersize=4.5))
    log_scale(axes, "xy")
