"""Plots of the results of ``integrate``, ``sweep`` and ``ensemble``, and of cubes, in the style of the figures."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.plotting.energy_error import PANELS, Profile, dashed, draw_profile, draw_profiles
from nearharmonic.plotting.floor import draw_floor
from nearharmonic.plotting.levels import energy_error_label
from nearharmonic.plotting.members import MEMBER, check_measured, draw_members, varying
from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter, style_of

if TYPE_CHECKING:
    import xarray as xr

ALLOWED = (
    "a Dataset of nearharmonic.integrate, nearharmonic.sweep or nearharmonic.ensemble, or a list of those of one of "
    "them, or the cube of a system"
)
#: Attributes that distinguish Datasets of one integrator, in the order of the legend.
TOLD = ("system", "precision", "summation", "first", "t_end", "split")
#: Dashes of the second, third, ... Dataset of one integrator; extended precision has the dashes of the figures.
DASHES = ("solid", (0, (6, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
#: Contents of the plot, by kind of Dataset.
PROFILE, TRAJECTORY, CUBE, ENSEMBLE = "energy errors over tau", "a trajectory", "a cube", "an ensemble"


def plot(datasets: xr.Dataset | Iterable[xr.Dataset]) -> Figure:
    """Draw a result in the style of the figures.

    - A Dataset of ``sweep``: maximum and mean energy error against step size per stage.
    - One of ``integrate``: the energy error over time, and the orbit: (q, p) of a system of one coordinate, the first
      two coordinates of other systems. Without energy errors (``energy="none"``) only the orbit is drawn.
    - One of ``ensemble``: the maximum energy error of each member, against the varied parameter if there is exactly
      one, otherwise against the number of the member.
    - The cube of a system, as ``xarray.open_dataset`` returns it: its energy-error figure.

    Parameters
    ----------
    datasets : xarray.Dataset, or list of them
        One or several results of ``integrate``, of ``sweep`` or of ``ensemble``, each with an entry in the legend; or
        one cube.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows it; ``savefig`` writes it to a file.

    Raises
    ------
    SettingError
        The argument is not such an object or is empty, Datasets have different kinds or different units of step sizes
        or times, or energy errors are relative to different energies.
    """
    given: list[Any] = list(datasets) if isinstance(datasets, list | tuple) else [datasets]
    kinds = {_kind(one) for one in given}
    if len(kinds) != 1 or kinds == {""} or (kinds == {CUBE} and len(given) > 1):
        several = [CUBE] * len(given) if kinds == {CUBE} else sorted(filter(None, kinds))
        shown = " and ".join(several) or type(datasets).__name__
        raise bad_setting("datasets", shown, ALLOWED)
    if kinds == {CUBE}:
        return draw_profile(given[0])
    if kinds == {TRAJECTORY}:
        return _trajectories(given)
    check_measured(given)
    _common_meaning(given, "max_energy_error")
    return _profiles(given) if kinds == {PROFILE} else _members(given)


def _kind(dataset: Any) -> str:
    """Return the kind of a Dataset, "" for a Dataset of another origin."""
    dims, attributes, variables = (getattr(dataset, name, ()) for name in ("dims", "attrs", "variables"))
    if not hasattr(dataset, "data_vars"):
        return ""
    if "max_energy_error" in variables:
        if {"integrator", "tau_per_stage"} <= set(dims):
            return CUBE
        for dimension, kind in (("tau", PROFILE), (MEMBER, ENSEMBLE)):
            if "integrator" in attributes and dimension in dims:
                return kind
    return TRAJECTORY if "integrator" in attributes and {"t", "q", "p", "energy_error"} <= set(variables) else ""


def _common_unit(given: Sequence[xr.Dataset], name: str) -> str:
    units = sorted({str(one[name].attrs.get("units", "1")) for one in given})
    if len(units) > 1:
        raise bad_setting("datasets", f"units of {name}: {', '.join(units)}", "Datasets whose units are the same")
    return units[0]


def _common_meaning(given: Sequence[xr.Dataset], name: str) -> None:
    """Refuse energy errors that cannot share an axis: relative to different energies, or in different units."""
    found = [one[name].attrs for one in given]
    meanings = sorted({f"{notes.get('long_name', name)}, in {notes.get('units', '1')}" for notes in found})
    if len(meanings) > 1:
        raise bad_setting("datasets", " | ".join(meanings), "Datasets whose energy errors mean the same")


def _members(given: Sequence[xr.Dataset]) -> Figure:
    against, looks = varying(given), _looks(given)
    unit = "1" if against == MEMBER else _common_unit(given, against)
    return draw_members(given, _handles(given, looks, linestyle="none"), looks, unit)


def _in_brackets(unit: str) -> str:
    """Return a unit in brackets, for the label of an axis; 1e6 is a power of ten."""
    shown = re.sub(r"1e(-?[0-9]+)", r"$10^{\1}$", unit)
    return "" if unit == "1" else f"  ({shown})"


def _labels(given: Sequence[xr.Dataset]) -> list[str]:
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


def _looks(given: Sequence[xr.Dataset]) -> list[dict[str, Any]]:
    """Return the line style of each Dataset: Datasets of one integrator have different dashes."""
    seen: dict[str, int] = {}
    looks = []
    for one in given:
        name = str(one.attrs["integrator"])
        turn = seen[name] = seen.get(name, -1) + 1
        extended = one.attrs.get("precision") == "extended" and turn > 0
        looks.append(dashed() if extended else {"linestyle": DASHES[turn % len(DASHES)]} if turn else {})
    return looks


def _handles(given: Sequence[xr.Dataset], looks: Sequence[Mapping[str, Any]], **changes: Any) -> list[Line2D]:
    return [
        Line2D([], [], label=label, **style_of(str(one.attrs["integrator"])).line(**{**look, **changes}))
        for one, label, look in zip(given, _labels(given), looks, strict=True)
    ]


@house_style
def _profiles(given: Sequence[xr.Dataset]) -> Figure:
    unit, looks = _common_unit(given, "tau"), _looks(given)
    profiles = []
    for position, (one, look) in enumerate(zip(given, looks, strict=True)):
        ascending = one.sortby("tau")
        profiles.append(
            Profile(
                integrator=str(one.attrs["integrator"]),
                tau_per_stage=ascending["tau"].values / _stages(one),
                errors={variable: ascending[variable].values for _, variable, _, _ in PANELS},
                turn=(position, len(given)),
                look=look,
            )
        )
    return draw_profiles(profiles, _handles(given, looks), unit, given[0]["max_energy_error"].attrs, given)


def _stages(dataset: xr.Dataset) -> int:
    """Evaluations of the force per step, without the evaluation that starts the first step."""
    done = np.where(dataset["diverged_at"] > 0, dataset["diverged_at"], dataset["steps"])
    return int((int(dataset["evaluations"][0]) - (dataset.attrs["first"] == "kick")) // done[0])


@house_style
def _trajectories(given: Sequence[xr.Dataset]) -> Figure:
    unit, looks = _common_unit(given, "t"), _looks(given)
    measured = [(one, look) for one, look in zip(given, looks, strict=True) if one.attrs.get("energy") != "none"]
    drawn = new_figure(7, 8.2 if measured else 5.2)
    drawn.subplots_adjust(
        left=0.115, right=0.985, top=0.925 if measured else 0.885, bottom=0.062 if measured else 0.095, hspace=0.2
    )
    if measured:
        upper, lower = drawn.subplots(2, 1, height_ratios=(2, 3))
        for one, look in measured:
            upper.plot(one["t"].values, np.abs(one["energy_error"].values), **_thin_line(one, look))
        _finish_errors(upper, [one for one, _ in measured], unit)
    else:
        lower = drawn.subplots()
    for one, look in zip(given, looks, strict=True):
        _draw_orbit(lower, one, look)
    _finish_orbit(lower, given)
    panel_letter(lower, "B" if measured else "A", _orbit(given[0]))
    handles = _handles(given, looks, marker="none")
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _thin_line(one: xr.Dataset, look: Mapping[str, Any]) -> dict[str, Any]:
    return style_of(str(one.attrs["integrator"])).line(**{**look, "marker": "none", "linewidth": 0.8})


def _finish_errors(axes: Axes, given: Sequence[xr.Dataset], unit: str) -> None:
    log_scale(axes, "y")
    axes.set_xlabel(r"time $t$" + _in_brackets(unit))
    _common_meaning(given, "energy_error")
    notes = given[0]["max_energy_error"].attrs
    axes.set_ylabel(energy_error_label(notes, r"$|\Delta H|$", r"$|\Delta H/H_0|$"))
    panel_letter(axes, "A", "energy error at the samples")
    draw_floor(axes, given, "energy_error")


def _draw_orbit(axes: Axes, one: xr.Dataset, look: Mapping[str, Any]) -> None:
    q, p = one["q"].values, one["p"].values
    first, second = (q[:, 0], p[:, 0]) if q.shape[1] == 1 else (q[:, 0], q[:, 1])
    axes.plot(first, second, **_thin_line(one, look))
    axes.plot(first[:1], second[:1], marker="o", markersize=5, color="#404040", linestyle="none", zorder=4)


def _finish_orbit(axes: Axes, given: Sequence[xr.Dataset]) -> None:
    flat = given[0]["q"].sizes["component"] > 1
    if any((one["q"].sizes["component"] > 1) != flat for one in given):
        raise bad_setting("datasets", "systems of one and of several coordinates", "systems of like dimension")
    names = (("q", r"$q_1$"), ("q", r"$q_2$")) if flat else (("q", "$q$"), ("p", "$p$"))
    units = [_common_unit(given, name) for name, _ in names]
    axes.set_xlabel(names[0][1] + _in_brackets(units[0]))
    axes.set_ylabel(names[1][1] + _in_brackets(units[1]))
    if units[0] == units[1]:
        axes.set_aspect("equal", adjustable="datalim")


def _orbit(dataset: xr.Dataset) -> str:
    return ("orbit" if dataset["q"].sizes["component"] > 1 else "phase space") + ", from the dot on"
