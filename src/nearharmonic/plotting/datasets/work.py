"""Work against error: sweeps against evaluations of the force, and recommendations against evaluations and time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor, inf, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.datasets.legend import LEGEND
from nearharmonic.plotting.energy_error import range_of, say_if_empty
from nearharmonic.plotting.levels import energy_error_label
from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, style_of

if TYPE_CHECKING:
    import xarray as xr

#: Methods of a recommendation that are named beside their points: the fastest ones.
NAMED = 8


@house_style
def draw_work(given: Sequence[xr.Dataset], handles: Sequence[Line2D], looks: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the maximum energy errors of sweeps against the evaluations of the force."""
    drawn = new_figure(7, 4.6)
    drawn.subplots_adjust(left=0.115, right=0.985, top=0.86, bottom=0.115)
    axes = drawn.subplots()
    for one, look in zip(given, looks, strict=True):
        ascending = one.sortby("evaluations")
        axes.plot(
            ascending["evaluations"],
            ascending["max_energy_error"],
            **style_of(str(one.attrs["integrator"])).line(**look),
        )
    log_scale(axes, "xy")
    axes.set_xlabel("evaluations of the force")
    notes = given[0]["max_energy_error"].attrs
    axes.set_ylabel(energy_error_label(notes, r"$\max\,|\Delta H|$", r"$\max\,|\Delta H/H_0|$"))
    panel_letter(axes, "A", f"maximum {range_of(notes)}")
    say_if_empty(axes, [one["max_energy_error"].values for one in given])
    drawn.legend(handles=handles, **LEGEND)
    return drawn


@house_style
def draw_ranking(found: xr.Dataset) -> Figure:
    """Draw the error of each method of a recommendation against its evaluations and against its time."""
    measure = "position_error" if "position_error" in found else f"{found.attrs['measure']}_energy_error"
    drawn = new_figure(7, 4.6)
    drawn.subplots_adjust(left=0.115, right=0.985, top=0.86, bottom=0.115, wspace=0.08)
    left, right = drawn.subplots(1, 2, sharey=True)
    handles = []
    for axes, x in ((left, found["evaluations"].values), (right, 1e3 * found["time"].values)):
        for rank, (a, b) in enumerate(zip(x, found[measure].values, strict=True)):
            style = style_of(str(found["integrator"].values[rank])).line(linestyle="none")
            look = style if rank < NAMED else {"marker": ".", "color": "#9a9a9a", "linestyle": "none"}
            (point,) = axes.plot([a], [b], **look)
            if axes is left and rank < NAMED:
                point.set_label(f"{rank + 1}. {found['label'].values[rank]}")
                handles.append(point)
        axes.axhline(bound := float(found.attrs["error"]), color="#595959", linewidth=0.8, linestyle=(0, (6, 3)))
        log_scale(axes, "xy")
        axes.set(xlim=_between_labels(x), ylim=_between_labels([*found[measure].values, bound]))
    left.set_xlabel("evaluations of the force")
    right.set_xlabel("time (ms)")
    notes = found[measure].attrs
    left.set_ylabel(
        "position error"
        if measure == "position_error"
        else energy_error_label(notes, r"$|\Delta H|$", r"$|\Delta H/H_0|$")
    )
    panel_letter(left, "A", "error and evaluations")
    panel_letter(right, "B", "error and time")
    drawn.legend(handles=handles, **LEGEND)
    return drawn


def _between_labels(values: Iterable[float]) -> tuple[float, float] | None:
    """Return the range of an axis from a labelled tick below all positive values to one above, both inside."""
    positive = [float(value) for value in values if 0 < value < inf]
    if not positive:
        return None
    powers = range(floor(log10(min(positive))) - 1, ceil(log10(max(positive))) + 2)
    labels = [float(f"{digit}e{power}") for power in powers for digit in (1, 2, 5)]
    low = max(label for label in labels if label <= min(positive))
    return low / 1.15, min(label for label in labels if label >= max(positive) and label > low) * 1.15


def stages_of(dataset: xr.Dataset) -> int:
    """Evaluations of the force per step, without the evaluation that starts the first step."""
    done = np.where(dataset["diverged_at"] > 0, dataset["diverged_at"], dataset["steps"])
    return int((int(dataset["evaluations"][0]) - (dataset.attrs["first"] == "kick")) // done[0])
