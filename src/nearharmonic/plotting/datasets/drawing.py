"""Figures of Datasets, one for each kind and content."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nearharmonic.errors import bad_setting
from nearharmonic.plotting.datasets.kinds import CUBE, MEMBER, PROFILE, RANKING, TRAJECTORY, check_measured
from nearharmonic.plotting.datasets.legend import LEGEND, handles_of, in_brackets, looks_of
from nearharmonic.plotting.datasets.members import draw_chaos, draw_members, varying
from nearharmonic.plotting.datasets.states import draw_curve, draw_points, name_of, pair_of
from nearharmonic.plotting.datasets.work import draw_ranking, draw_work, stages_of
from nearharmonic.plotting.energy_error import PANELS, Profile, draw_profile, draw_profiles
from nearharmonic.plotting.floor import draw_floor
from nearharmonic.plotting.levels import energy_error_label
from nearharmonic.plotting.style import house_style, keep_inside, log_scale, new_figure, panel_letter, style_of

if TYPE_CHECKING:
    import xarray as xr


def draw(source: str, kind: str, given: Sequence[xr.Dataset], axes: Sequence[str] | None) -> Figure:
    drawn = _drawn(source, kind, given, axes)
    keep_inside(drawn)
    return drawn


def _drawn(source: str, kind: str, given: Sequence[xr.Dataset], axes: Sequence[str] | None) -> Figure:
    if source in (CUBE, RANKING):
        return (draw_profile if source == CUBE else draw_ranking)(given[0])
    if kind in ("orbit", "phase", "section"):
        return _states(given, kind, axes)
    if kind == "chaos":
        looks = looks_of(given)
        return draw_chaos(given, handles_of(given, looks, marker="none"), looks, _common_unit(given, "t"))
    if source == TRAJECTORY:
        return _trajectories(given, with_orbit=not kind)
    check_measured(given)
    _common_meaning(given, "max_energy_error")
    if kind == "work":
        return draw_work(given, handles_of(given, looks_of(given)), looks_of(given))
    return _profiles(given) if source == PROFILE else _members(given)


def write_above(drawn: Figure, title: str) -> None:
    """Write a title into a strip added above a figure."""
    width, height = drawn.get_size_inches()
    strip = 0.32
    share = height / (height + strip)
    drawn.set_size_inches(width, height + strip)
    for one in drawn.axes:
        box = one.get_position()
        one.set_position((box.x0, box.y0 * share, box.width, box.height * share))
    for legend in drawn.legends:
        legend.set_bbox_to_anchor((0.545, 0.995 * share), transform=drawn.transFigure)
    drawn.text(0.5, 1 - strip / 2 / (height + strip), title, ha="center", va="center", fontsize="large")


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
    against, looks = varying(given), looks_of(given)
    unit = "1" if against == MEMBER else _common_unit(given, against)
    return draw_members(given, handles_of(given, looks, linestyle="none"), looks, unit)


@house_style
def _profiles(given: Sequence[xr.Dataset]) -> Figure:
    unit, looks = _common_unit(given, "tau"), looks_of(given)
    profiles = []
    for position, (one, look) in enumerate(zip(given, looks, strict=True)):
        ascending = one.sortby("tau")
        profiles.append(
            Profile(
                integrator=str(one.attrs["integrator"]),
                tau_per_stage=ascending["tau"].values / stages_of(one),
                errors={variable: ascending[variable].values for _, variable, _, _ in PANELS},
                turn=(position, len(given)),
                look=look,
            )
        )
    return draw_profiles(profiles, handles_of(given, looks), unit, given[0]["max_energy_error"].attrs, given)


@house_style
def _trajectories(given: Sequence[xr.Dataset], *, with_orbit: bool) -> Figure:
    measured = [one for one in given if one.attrs.get("energy") != "none"]
    if not measured and with_orbit:
        return _states(given, "orbit", None)
    check_measured(given if not with_orbit else measured)
    unit, looks = _common_unit(given, "t"), looks_of(given)
    drawn = new_figure(7, 8.2 if with_orbit else 4.2)
    drawn.subplots_adjust(
        left=0.115, right=0.985, top=0.925 if with_orbit else 0.86, bottom=0.062 if with_orbit else 0.12, hspace=0.2
    )
    upper, *lower = drawn.subplots(2, 1, height_ratios=(2, 3)) if with_orbit else (drawn.subplots(),)
    for one, look in zip(given, looks, strict=True):
        if one.attrs.get("energy") != "none":
            upper.plot(one["t"].values, np.abs(one["energy_error"].values), **_thin_line(one, look))
    _finish_errors(upper, measured, unit)
    for axes in lower:
        _draw_states(axes, given, looks, "orbit", None)
        panel_letter(axes, "B", _says("orbit", given))
    drawn.legend(handles=handles_of(given, looks, marker="none"), **LEGEND)
    return drawn


@house_style
def _states(given: Sequence[xr.Dataset], kind: str, asked: Sequence[str] | None) -> Figure:
    looks = looks_of(given)
    drawn = new_figure(7, 5.2)
    drawn.subplots_adjust(left=0.115, right=0.985, top=0.885, bottom=0.095)
    axes = drawn.subplots()
    _draw_states(axes, given, looks, kind, asked)
    panel_letter(axes, "A", _says(kind, given, asked))
    if kind != "section":
        drawn.legend(handles=handles_of(given, looks, marker="none"), **LEGEND)
    return drawn


def _draw_states(
    axes: Axes, given: Sequence[xr.Dataset], looks: Sequence[Mapping[str, Any]], kind: str, asked: Sequence[str] | None
) -> None:
    """Draw orbits, phase spaces or a section, and label the axes."""
    flat = given[0]["q"].sizes["component"] > 1
    if any((one["q"].sizes["component"] > 1) != flat for one in given):
        raise bad_setting("datasets", "systems of one and of several coordinates", "systems of like dimension")
    pair = pair_of(given[0], kind, asked)
    for one, look in zip(given, looks, strict=True):
        if kind == "section":
            draw_points(axes, one, pair)
        else:
            draw_curve(axes, one, pair, _thin_line(one, look))
    units = [_common_unit(given, name) for name, _ in pair]
    x, y = (name_of(one, given[0]) + in_brackets(unit) for one, unit in zip(pair, units, strict=True))
    axes.set(xlabel=x, ylabel=y)
    axes.yaxis.get_offset_text().set_x(-0.125)  # beside the title
    if units[0] == units[1] and all(index is not None for _, index in pair):
        axes.set_aspect("equal", adjustable="datalim")


def _thin_line(one: xr.Dataset, look: Mapping[str, Any]) -> dict[str, Any]:
    return style_of(str(one.attrs["integrator"])).line(**{**look, "marker": "none", "linewidth": 0.8})


def _finish_errors(axes: Axes, given: Sequence[xr.Dataset], unit: str) -> None:
    log_scale(axes, "y")
    axes.set_xlabel(r"time $t$" + in_brackets(unit))
    _common_meaning(given, "energy_error")
    notes = given[0]["max_energy_error"].attrs
    axes.set_ylabel(energy_error_label(notes, r"$|\Delta H|$", r"$|\Delta H/H_0|$"))
    panel_letter(axes, "A", "energy error at the samples")
    draw_floor(axes, given, "energy_error")


def _says(kind: str, given: Sequence[xr.Dataset], asked: object = None) -> str:
    """Return the title of a panel of states."""
    first = given[0]
    if kind == "section":
        surface = re.sub(r"^q_(\d+)$", r"$q_\1 = 0$", str(first.attrs["surface_name"]))
        return f"{int(first['crossings'].sum())} crossings of {surface}, {first.attrs['direction']}"
    if asked is not None and any(index is None for _, index in pair_of(first, kind, asked)):
        return "trajectory, from the dot on"
    phase = kind == "phase" or first["q"].sizes["component"] == 1
    return ("phase space" if phase else "orbit") + ", from the dot on"
