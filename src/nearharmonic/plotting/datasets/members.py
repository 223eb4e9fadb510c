"""Energy errors of the members of ensembles, and indicators of chaos of one orbit or of members, over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.datasets.kinds import MEMBER
from nearharmonic.plotting.datasets.legend import LEGEND, in_brackets
from nearharmonic.plotting.energy_error import range_of, say_if_empty
from nearharmonic.plotting.floor import draw_floor
from nearharmonic.plotting.levels import energy_error_label
from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, style_of

if TYPE_CHECKING:
    import xarray as xr


def varying(given: Sequence[xr.Dataset]) -> str:
    """Return ``parameter_<name>`` if it is the only varied parameter of each ensemble, else :data:`MEMBER`."""
    found = {
        tuple(name for name in one.variables if str(name).startswith("parameter_") and np.ptp(one[name].values) > 0)
        for one in given
    }
    names = found.pop()
    return str(names[0]) if len(names) == 1 and not found else MEMBER


#: Indicators of chaos over time: name, label, and scale of the axis.
INDICATORS = (
    ("lyapunov_exponent", r"largest exponent, $\ln(|\delta|/|\delta_0|)/t$", "log"),
    ("megno", "MEGNO", "linear"),
    ("sali", "SALI", "log"),
)


@house_style
def draw_chaos(
    given: Sequence[xr.Dataset], handles: Sequence[Line2D], looks: Sequence[Mapping[str, Any]], unit: str
) -> Figure:
    """Draw the indicators of chaos of results of ``tangent`` over time, members in one colour each."""
    shown = [one for one in INDICATORS if all(one[0] in dataset for dataset in given)]
    drawn = new_figure(7, 0.9 + 2.3 * len(shown))
    drawn.subplots_adjust(left=0.125, right=0.985, top=1 - 0.55 / (0.9 + 2.3 * len(shown)), bottom=0.07, hspace=0.16)
    for number, (axes, (name, label, scale)) in enumerate(
        zip(drawn.subplots(len(shown), 1, sharex=True, squeeze=False).flat, shown, strict=True)
    ):
        for one, look in zip(given, looks, strict=True):
            rows = np.atleast_2d(one[name].values)
            style = style_of(str(one.attrs["integrator"])).line(**{**look, "marker": "none", "linewidth": 0.8})
            colours = colormaps["cividis"](np.linspace(0, 0.9, len(rows))) if len(rows) > 1 else [style["color"]]
            for row, colour in zip(rows, colours, strict=True):
                axes.plot(one["t"].values, row, **{**style, "color": colour})
        if scale == "log":
            log_scale(axes, "y")
        axes.set_ylabel(label + in_brackets(str(given[0][name].attrs.get("units", "1"))))
        panel_letter(axes, number, "one line for each member" if MEMBER in given[0].dims and not number else "")
    axes.set_xlabel(r"time $t$" + in_brackets(unit))
    drawn.legend(handles=handles, **LEGEND)
    return drawn


@house_style
def draw_members(
    given: Sequence[xr.Dataset], handles: Sequence[Line2D], looks: Sequence[Mapping[str, Any]], unit: str
) -> Figure:
    """Draw the maximum energy error of each member of ensembles as a point, and write the number of diverged members.

    ``looks`` are changes of the style of each ensemble. ``unit`` is that of the varied parameter, "1" if it has none.
    """
    against = varying(given)
    drawn = new_figure(7, 4.6)
    drawn.subplots_adjust(left=0.115, right=0.985, top=0.86, bottom=0.105)
    axes = drawn.subplots()
    for one, look in zip(given, looks, strict=True):
        errors = one["max_energy_error"].values
        x = np.arange(errors.size) if against == MEMBER else one[against].values
        style = style_of(str(one.attrs["integrator"])).line(**{**look, "linestyle": "none"})
        axes.plot(x, errors, **{**style, "markersize": 2.5 if errors.size > 100 else 5})
    log_scale(axes, "y")
    name = MEMBER if against == MEMBER else against.removeprefix("parameter_")
    axes.set_xlabel(name + ("" if unit == "1" else f"  ({unit})"))
    notes = given[0]["max_energy_error"].attrs
    axes.set_ylabel(energy_error_label(notes, r"$\max\,|\Delta H|$", r"$\max\,|\Delta H/H_0|$"))
    panel_letter(axes, "A", _says(given))
    say_if_empty(axes, [one["max_energy_error"].values for one in given])
    draw_floor(axes, given, "max_energy_error")
    drawn.legend(handles=handles, **LEGEND)
    return drawn


def _says(given: Sequence[xr.Dataset]) -> str:
    """Return a description of the points, and the number of members without a point."""
    over = range_of(given[0]["max_energy_error"].attrs)
    lost = sum(int((one["status"] == "diverged").sum()) for one in given)
    members = sum(one.sizes[MEMBER] for one in given)
    return f"maximum {over}, a point for each member" + (f"; {lost} of {members} diverged" if lost else "")
