"""Orbits, phase space and Poincare sections: two quantities of states against each other."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes

from nearharmonic.engine.kernels import formulas_digest
from nearharmonic.errors import bad_setting
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems import systems
from nearharmonic.systems.formulas import with_parameters

if TYPE_CHECKING:
    import xarray as xr

#: Points of a smooth curve between neighbouring samples, and angle in radians at a sample from which lines are coarse.
POINTS, COARSE = 16, 0.05
#: Angle from which samples are no curve, 20 a period; and the shortest lines whose angle is seen, over the frame.
APART, SEEN = 2 * pi / 20, 0.005
#: Largest distance of a smooth curve from the next sample, over the extent of the samples.
MISSED = 0.01

#: A variable, and its component from 0, or None for a variable without components.
Quantity = tuple[str, int | None]
Pair = tuple[Quantity, Quantity]


def pair_of(dataset: xr.Dataset, kind: str, asked: object = None) -> Pair:
    """Return the quantities of both axes: the pair ``asked``, or the default of the kind.

    Names are those such as "q1" and "p2", counted from 1, and of variables over the samples. The default of an orbit is
    its first two coordinates; otherwise coordinate and momentum, in a section those that are not on the surface.
    A SettingError says that ``asked`` is no such pair.
    """
    d = dataset["q"].sizes["component"]
    if asked is not None:
        known: dict[str, Quantity] = {f"{name}{i + 1}": (name, i) for name in "qp" for i in range(d)}
        for name, one in dataset.variables.items():
            if name != "sample" and one.dims == dataset["q"].dims[:-1] and one.dtype.kind in "fi":
                known[str(name)] = str(name), None
        names = known | {"q": ("q", 0), "p": ("p", 0)} | {f"{n}_{i + 1}": (n, i) for n in "qp" for i in range(d)}
        pair = (
            [names.get(name) if isinstance(name, str) else None for name in asked]
            if isinstance(asked, list | tuple)
            else []
        )
        if len(pair) != 2 or pair[0] is None or pair[1] is None:
            raise bad_setting("axes", asked, f"two of {', '.join(known)}")
        return pair[0], pair[1]
    if kind == "orbit" and d > 1:
        return ("q", 0), ("q", 1)
    free = int(kind == "section" and d > 1 and dataset.attrs.get("surface_name") == "q_1")
    return ("q", free), ("p", free)


def name_of(quantity: Quantity, dataset: xr.Dataset) -> str:
    """Return the name of a quantity in a label: $q_1$, $q$ of a system of one coordinate, or a variable in words."""
    name, index = quantity
    if index is None:
        return "time $t$" if name == "t" else str(dataset[name].attrs.get("long_name", name))
    return f"${name}_{index + 1}$" if dataset["q"].sizes["component"] > 1 else f"${name}$"


def column(one: xr.Dataset, quantity: Quantity) -> Floats:
    """Return the values of a quantity over the samples, or over members and crossings."""
    name, index = quantity
    values: Floats = one[name].values
    return values if index is None else values[..., index]


def draw_curve(axes: Axes, one: xr.Dataset, pair: Pair, line: Mapping[str, Any]) -> None:
    """Draw a trajectory with a dot at its start.

    Between coarse samples the curve is smooth. Where its formulas are unknown, they are points.
    """
    x, y = columns = [column(one, quantity) for quantity in pair]
    turn = _largest_turn(x, y)
    smooth = _smooth(one, pair) if turn > COARSE else None
    if smooth is None and turn > APART and ("t", None) not in pair:
        line = {**line, "linestyle": "none", "marker": ".", "markersize": 3, "markeredgewidth": 0}
        line["markerfacecolor"] = line["color"]
    axes.plot(*(columns if smooth is None else smooth), **line)
    axes.plot(x[:1], y[:1], marker="o", markersize=5, color="#404040", linestyle="none", zorder=4)


def draw_points(axes: Axes, one: xr.Dataset, pair: Pair) -> None:
    """Draw the crossings of a section as points, in one colour for each member."""
    members = one.sizes["member"]
    colours = colormaps["cividis"](np.linspace(0, 0.9, members))  # as dark as can be told from paper
    for member, colour in enumerate(colours):
        x, y = (column(one, quantity)[member] for quantity in pair)
        axes.plot(x, y, ".", markersize=3 if x.size < 300 else 1.5, markeredgewidth=0, color=colour)


def _largest_turn(x: Floats, y: Floats) -> float:
    """Return the largest angle between neighbouring lines that can be seen, 0 if there is none."""
    spans = [float(np.ptp(z[np.isfinite(z)])) or 1.0 for z in (x, y) if np.isfinite(z).any()]
    if len(spans) < 2 or x.size < 3:
        return 0.0
    with np.errstate(all="ignore"):
        lines = np.diff(x) / spans[0] + 1j * np.diff(y) / spans[1]
        seen = np.minimum(abs(lines[:-1]), abs(lines[1:])) > SEEN
        return float(abs(np.angle(lines[1:] / lines[:-1]))[seen].max(initial=0.0))


def _smooth(one: xr.Dataset, pair: Pair) -> tuple[Floats, Floats] | None:
    """Return points of the exact orbits from each sample to the next, by Runge and Kutta's method of order four.

    None if the formulas are unknown, a quantity is no part of the state, or an orbit misses the next sample visibly.
    """
    rates = _rates_of(one)
    if rates is None or any(index is None and name != "t" for name, index in pair):
        return None
    t, d = one["t"].values, one["q"].sizes["component"]
    samples = np.array([*one["q"].values.T, *one["p"].values.T, t], float)
    h, points = np.diff(t) / POINTS, [samples[:, :-1]]
    with np.errstate(all="ignore"):
        for _ in range(POINTS):
            a = rates(x := points[-1])
            b = rates(x + h / 2 * a)
            c = rates(x + h / 2 * b)
            points.append(x + h / 6 * (a + 2 * b + 2 * c + rates(x + h * c)))
    found = []
    for name, index in pair:
        row = -1 if index is None else index + d * (name == "p")
        if not np.nanmax(abs(points[-1][row] - samples[row, 1:])) <= MISSED * np.ptp(samples[row]):
            return None
        found.append(np.append(np.array([x[row] for x in points[:-1]]).T.ravel(), samples[row, -1]))
    return found[0], found[1]


def _rates_of(one: xr.Dataset) -> Callable[[Floats], Floats] | None:
    """Return dx/dt of states x = (q, p, t), None unless the formulas of a result are those of a registered system.

    The name alone does not tell: a user's system may have it too.
    """
    name = str(one.attrs.get("system"))
    if name not in systems.registered or systems[name].regularisation is not None:
        return None
    system = systems[name]
    if formulas_digest(system) != one.attrs.get("formulas"):
        return None
    try:
        told = json.loads(one.attrs.get("parameters", "{}"))
        constants = [float(Fraction(told.get(name, given.value))) for name, given in system.parameters.items()]
    except (ValueError, TypeError, AttributeError):
        return None
    grad_T, d = with_parameters(system.grad_T, len(constants)), system.dimension

    def rates(x: Floats) -> Floats:
        force = system.grad_V(tuple(x[:d]), *constants)
        return np.array([*grad_T(tuple(x[d:-1]), *constants), *(-f for f in force), np.ones(x.shape[1])])

    return rates
