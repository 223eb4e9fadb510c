"""Legends and labels of plots of Datasets: names and dashes that tell them apart."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from matplotlib.lines import Line2D

from nearharmonic.integrators import integrators
from nearharmonic.plotting.energy_error import dashed
from nearharmonic.plotting.palette import SPARE_COLOURS, style_of

if TYPE_CHECKING:
    import xarray as xr

#: Attributes that distinguish Datasets of one integrator, in the order of the legend.
TOLD = ("system", "precision", "summation", "first", "t_end", "split")
#: Dashes of the second, third, ... Dataset of one integrator; extended precision has the dashes of the figures.
DASHES = ("solid", (0, (6, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
#: Place of a legend above the panels.
LEGEND: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.545, 0.995), "ncols": 4, "columnspacing": 1.8}


def in_brackets(unit: str) -> str:
    """Return a unit in brackets, for the label of an axis; 1e6 is a power of ten."""
    shown = re.sub(r"1e(-?[0-9]+)", r"$10^{\1}$", unit)
    return "" if unit in ("1", "unknown") else f"  ({shown})"


def labels_of(given: Sequence[xr.Dataset]) -> list[str]:
    """A legend entry for each Dataset: its integrator, and the attributes that distinguish it from others."""
    varied = [key for key in TOLD if len({one.attrs.get(key) for one in given}) > 1]
    found = []
    for one in given:
        name = str(one.attrs["integrator"])
        label = one.attrs.get("label") or (integrators[name].label if name in integrators else name)
        same = [other for other in given if other.attrs["integrator"] == name]
        more = [key for key in varied if key == "system" or len({other.attrs.get(key) for other in same}) > 1]
        if (
            "tau" in one
            and not one["tau"].ndim
            and len({float(other["tau"]) for other in same if not other["tau"].ndim}) > 1
        ):
            more.append("tau")
        found.append(", ".join([label, *(_told(one, key) for key in more)]))
    return found


def _told(dataset: xr.Dataset, key: str) -> str:
    if key == "tau":
        return f"τ = {float(dataset['tau']):.4g}"
    value = str(dataset.attrs.get(key, ""))
    return {"precision": f"{value} precision", "summation": f"{value} sums", "first": f"{value} first"}.get(key) or (
        f"t = {value}" if key == "t_end" else value.replace("_", " ")
    )


def looks_of(given: Sequence[xr.Dataset]) -> list[dict[str, Any]]:
    """Return the line style of each Dataset: integrators differ in colours, runs of one in dashes."""
    seen: dict[str, int] = {}
    looks = []
    colours: dict[str, str] = {}
    for one in given:
        name = str(one.attrs["integrator"])
        if name not in colours:
            free = [c for c in (style_of(name).colour, *SPARE_COLOURS) if c not in colours.values()]
            colours[name] = free[0] if free else style_of(name).colour
        turn = seen[name] = seen.get(name, -1) + 1
        extended = one.attrs.get("precision") == "extended" and turn > 0
        look = dashed() if extended else {"linestyle": DASHES[turn % len(DASHES)]} if turn else {}
        if colours[name] != style_of(name).colour:
            face = colours[name] if style_of(name).filled else "white"
            look |= {"color": colours[name], "markerfacecolor": face}
        looks.append(look)
    return looks


def handles_of(given: Sequence[xr.Dataset], looks: Sequence[Mapping[str, Any]], **changes: Any) -> list[Line2D]:
    return [
        Line2D([], [], label=label, **style_of(str(one.attrs["integrator"])).line(**{**look, **changes}))
        for one, label, look in zip(given, labels_of(given), looks, strict=True)
    ]
