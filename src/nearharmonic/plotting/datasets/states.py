"""Orbits, phase space and Poincare sections: two coordinates or momenta of states against each other."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from nearharmonic.errors import NearharmonicError, bad_setting
from nearharmonic.numerics.types import Floats
from nearharmonic.systems import systems
from nearharmonic.systems.definition.extended import with_parameters

if TYPE_CHECKING:
    import xarray as xr

#: Points of a smooth curve between neighbouring samples, and angle in radians at a sample from which lines are coarse.
POINTS, COARSE = 16, 0.05

Pair = tuple[tuple[str, int], tuple[str, int]]


def pair_of(dataset: xr.Dataset, kind: str, asked: object = None) -> Pair:
    """Return the quantities of both axes, each "q" or "p" with the number of its component from 0.

    Parameters
    ----------
    dataset : xarray.Dataset
        States over ``component``.
    kind : {"orbit", "phase", "section"}
        Default of the pair: the first two coordinates, or coordinate and momentum: the first ones in phase space, and
        those that are not on the surface in a section.
    asked : pair of str, optional
        Names such as "q1" and "p2", counted from 1, in place of the default.

    Raises
    ------
    SettingError
        ``asked`` is no such pair.
    """
    d = dataset["q"].sizes["component"]
    if asked is not None:
        found = [re.fullmatch(r"([qp])_?(\d*)", name) for name in asked] if _is_pair(asked) else []  # type: ignore[attr-defined]
        pairs = [(one[1], int(one[2] or 1) - 1) for one in found if one is not None]
        if len(pairs) != 2 or not all(0 <= index < d for _, index in pairs):
            what = f"two of {', '.join(f'{name}{i + 1}' for name in 'qp' for i in range(d))}"
            raise bad_setting("axes", asked, what)
        return pairs[0], pairs[1]
    if kind == "orbit" and d > 1:
        return ("q", 0), ("q", 1)
    free = 0
    if kind == "section" and d > 1 and dataset.attrs.get("surface_name") == "q_1":
        free = 1
    return ("q", free), ("p", free)


def _is_pair(asked: object) -> bool:
    return isinstance(asked, list | tuple) and len(asked) == 2 and all(isinstance(name, str) for name in asked)


def name_of(quantity: tuple[str, int], dataset: xr.Dataset) -> str:
    """Return the name of a quantity in a label: $q_1$, or $q$ of a system of one coordinate."""
    name, index = quantity
    return f"${name}_{index + 1}$" if dataset["q"].sizes["component"] > 1 else f"${name}$"


def draw_curve(axes: Axes, one: xr.Dataset, pair: Pair, line: Mapping[str, Any]) -> None:
    """Draw a trajectory with a dot at its start: smooth curves between its samples if these are coarse."""
    columns = [one[name].values[:, index] for name, index in pair]
    smooth = _smooth(one, pair) if _is_coarse(*columns) else None
    axes.plot(*(columns if smooth is None else smooth), **line)
    axes.plot(columns[0][:1], columns[1][:1], marker="o", markersize=5, color="#404040", linestyle="none", zorder=4)


def draw_points(axes: Axes, one: xr.Dataset, pair: Pair) -> None:
    """Draw the crossings of a section as points, in one colour for each member."""
    members = one.sizes["member"]
    colours = colormaps["cividis"](np.linspace(0, 0.9, members))  # as dark as can be told from paper
    for member, colour in enumerate(colours):
        x, y = (one[name].values[member, :, index] for name, index in pair)
        axes.plot(x, y, ".", markersize=3 if x.size < 300 else 1.5, markeredgewidth=0, color=colour)


def _is_coarse(x: Floats, y: Floats) -> bool:
    """Return True if the angle between neighbouring lines is visible at most samples."""
    spans = [float(np.ptp(z[np.isfinite(z)])) or 1.0 for z in (x, y) if np.isfinite(z).any()]
    if len(spans) < 2 or x.size < 3:
        return False
    with np.errstate(all="ignore"):
        along = np.angle(np.diff(x) / spans[0] + 1j * np.diff(y) / spans[1])
        turns = abs(np.angle(np.exp(1j * np.diff(along))))
    return bool(np.nanmedian(turns) > COARSE) if np.isfinite(turns).any() else False


def _smooth(one: xr.Dataset, pair: Pair) -> tuple[Floats, Floats] | None:
    """Return points of the cubic Hermite curve through the samples; None if the rates of change are unknown."""
    rates = _rates(one)
    if rates is None:
        return None
    t, share = one["t"].values, np.linspace(0.0, 1.0, POINTS, endpoint=False)[None, :]
    step = np.diff(t)[:, None]
    found = []
    for name, index in pair:
        z, rate = one[name].values[:, index], rates[name][:, index]
        a, b, v, w = z[:-1, None], z[1:, None], rate[:-1, None] * step, rate[1:, None] * step
        cubic = a + share * (v + share * (3 * (b - a) - 2 * v - w + share * (2 * (a - b) + v + w)))
        found.append(np.append(cubic.ravel(), z[-1]))
    return found[0], found[1]


def _rates(one: xr.Dataset) -> dict[str, Floats] | None:
    """Return dq/dt and dp/dt at the samples of a registered system, else None."""
    try:
        system = systems[str(one.attrs["system"])]
        told = json.loads(one.attrs.get("parameters", "{}"))
        constants = [float(Fraction(told.get(name, given.value))) for name, given in system.parameters.items()]
    except (NearharmonicError, ValueError, TypeError):
        return None
    if system.time_dependent or system.regularisation is not None:
        return None
    q, p = one["q"].values, one["p"].values
    grad_T = with_parameters(system.grad_T, len(constants))
    velocity = [grad_T(tuple(row), *constants) for row in p.tolist()]
    force = [system.grad_V(tuple(row), *constants) for row in q.tolist()]
    return {"q": np.array(velocity, float), "p": -np.array(force, float)}
