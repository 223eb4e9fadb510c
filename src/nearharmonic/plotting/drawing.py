"""Figures of Datasets, one for each kind and content."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from math import ceil, floor, inf, log10
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.plotting.energy_error import (
    DASHED,
    draw_floor,
    draw_profile,
    draw_profiles,
    error_label,
    say_if_empty,
)
from nearharmonic.plotting.palette import SPARE_COLOURS
from nearharmonic.plotting.plot import CUBE, MEMBER, PROFILE, RANKING, TRAJECTORY, check_measured
from nearharmonic.plotting.profile import Line, range_of
from nearharmonic.plotting.states import draw_curve, draw_points, name_of, pair_of
from nearharmonic.plotting.style import house_style, keep_inside, log_scale, new_figure, panel_letter, style_of

if TYPE_CHECKING:
    import xarray as xr

Looks = Sequence[Mapping[str, Any]]
#: Attributes that distinguish Datasets of one integrator, in the order of the legend.
TOLD = ("system", "precision", "summation", "first", "t_end", "split")
#: Dashes of the second, third, ... Dataset of one integrator; extended precision has the dashes of the figures.
DASHES = ("solid", (0, (6, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
#: Place of a legend above the panels.
LEGEND: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.545, 0.995), "ncols": 4, "columnspacing": 1.8}
#: Indicators of chaos over time: name, label, and scale of the axis.
INDICATORS = (
    ("lyapunov_exponent", r"largest exponent, $\ln(|\delta|/|\delta_0|)/t$", "log"),
    ("megno", "MEGNO", "linear"),
    ("sali", "SALI", "log"),
)
#: Methods of a recommendation that are named beside their points: the fastest ones.
NAMED = 8


def draw(source: str, kind: str, given: Sequence[xr.Dataset], axes: Sequence[str] | None) -> Figure:
    """Draw Datasets of the kind ``source`` as :func:`nearharmonic.plot` does."""
    drawn = _drawn(source, kind, given, axes)
    keep_inside(drawn)
    return drawn


def _drawn(source: str, kind: str, given: Sequence[xr.Dataset], axes: Sequence[str] | None) -> Figure:
    if source in (CUBE, RANKING):
        return (draw_profile if source == CUBE else _ranking)(given[0])
    if kind in ("orbit", "phase", "section"):
        return _states(given, kind, axes)
    looks = looks_of(given)
    if kind == "chaos":
        return _chaos(given, looks, _handles(given, looks, marker="none"))
    if source == TRAJECTORY:
        return _trajectories(given, looks, with_orbit=not kind)
    check_measured(given)
    _common_meaning(given, "max_energy_error")
    if kind == "work":
        return _work(given, looks, _handles(given, looks))
    return (
        _profiles(given, looks)
        if source == PROFILE
        else _members(given, looks, _handles(given, looks, linestyle="none"))
    )


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


def in_brackets(unit: str) -> str:
    """Return a unit in brackets, for the label of an axis; 1e6 is a power of ten."""
    shown = re.sub(r"1e(-?[0-9]+)", r"$10^{\1}$", unit)
    return "" if unit in ("1", "unknown") else f"  ({shown})"


def _frame(height: float, **edges: float) -> Figure:
    """Return a figure 7 inches wide with a legend above its panels."""
    drawn = new_figure(7, height)
    drawn.subplots_adjust(**{"left": 0.115, "right": 0.985, "top": 0.86, **edges})
    return drawn


def _labels_of(given: Sequence[xr.Dataset]) -> list[str]:
    """Return a legend entry for each Dataset: its integrator, and the attributes that tell it from others."""
    varied = [key for key in TOLD if len({one.attrs.get(key) for one in given}) > 1]
    found = []
    for one in given:
        name = str(one.attrs["integrator"])
        label = one.attrs.get("label") or (integrators[name].label if name in integrators else name)
        same = [other for other in given if other.attrs["integrator"] == name]
        more = [key for key in varied if key == "system" or len({other.attrs.get(key) for other in same}) > 1]
        single = "tau" in one and not one["tau"].ndim
        if single and len({float(other["tau"]) for other in same if not other["tau"].ndim}) > 1:
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
        style = style_of(name)
        if name not in colours:
            free = [c for c in (style.colour, *SPARE_COLOURS) if c not in colours.values()]
            colours[name] = free[0] if free else style.colour
        turn = seen[name] = seen.get(name, -1) + 1
        extended = one.attrs.get("precision") == "extended" and turn > 0
        look = dict(DASHED) if extended else {"linestyle": DASHES[turn % len(DASHES)]} if turn else {}
        if colours[name] != style.colour:
            look |= {"color": colours[name], "markerfacecolor": colours[name] if style.filled else "white"}
        looks.append(look)
    return looks


def _line(one: xr.Dataset, look: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    return style_of(str(one.attrs["integrator"])).line(**{**look, **changes})


def _thin(one: xr.Dataset, look: Mapping[str, Any]) -> dict[str, Any]:
    return _line(one, look, marker="none", linewidth=0.8)


def _handles(given: Sequence[xr.Dataset], looks: Looks, **changes: Any) -> list[Line2D]:
    return [
        Line2D([], [], label=label, **_line(one, look, **changes))
        for one, label, look in zip(given, _labels_of(given), looks, strict=True)
    ]


def stages_of(dataset: xr.Dataset) -> int:
    """Return the evaluations of the force per step, without the evaluation that starts the first step."""
    done = np.where(dataset["diverged_at"] > 0, dataset["diverged_at"], dataset["steps"])
    return int((int(dataset["evaluations"][0]) - (dataset.attrs["first"] == "kick")) // done[0])


@house_style
def _profiles(given: Sequence[xr.Dataset], looks: Looks) -> Figure:
    curves = []
    for i, one in enumerate(given):
        ascending = one.sortby("tau")
        runs = ascending.assign_coords(tau_per_stage=ascending["tau"] / stages_of(one))
        curves.append(Line(str(one.attrs["integrator"]), "", runs, (i, len(given))))
    return draw_profiles(curves, looks, _handles(given, looks), _common_unit(given, "tau"), given)


@house_style
def _trajectories(given: Sequence[xr.Dataset], looks: Looks, *, with_orbit: bool) -> Figure:
    measured = [one for one in given if one.attrs.get("energy") != "none"]
    if not measured and with_orbit:
        return _states(given, "orbit", None)
    check_measured(given if not with_orbit else measured)
    unit = _common_unit(given, "t")
    edges = {"top": 0.925, "bottom": 0.062} if with_orbit else {"top": 0.86, "bottom": 0.12}
    drawn = _frame(8.2 if with_orbit else 4.2, **edges, hspace=0.2)
    upper, *lower = drawn.subplots(2, 1, height_ratios=(2, 3)) if with_orbit else (drawn.subplots(),)
    for one, look in zip(given, looks, strict=True):
        if one.attrs.get("energy") != "none":
            upper.plot(one["t"].values, np.abs(one["energy_error"].values), **_thin(one, look))
    log_scale(upper, "y")
    upper.set_xlabel(r"time $t$" + in_brackets(unit))
    _common_meaning(measured, "energy_error")
    upper.set_ylabel(error_label(measured[0]["max_energy_error"].attrs))
    panel_letter(upper, "A", "energy error at the samples")
    draw_floor(upper, measured, "energy_error")
    for axes in lower:
        _draw_states(axes, given, looks, "orbit", None)
        panel_letter(axes, "B", _title_of("orbit", given))
    drawn.legend(handles=_handles(given, looks, marker="none"), **LEGEND)
    return drawn


@house_style
def _states(given: Sequence[xr.Dataset], kind: str, asked: Sequence[str] | None) -> Figure:
    looks = looks_of(given)
    drawn = _frame(5.2, top=0.885, bottom=0.095)
    axes = drawn.subplots()
    _draw_states(axes, given, looks, kind, asked)
    panel_letter(axes, "A", _title_of(kind, given, asked))
    if kind != "section":
        drawn.legend(handles=_handles(given, looks, marker="none"), **LEGEND)
    return drawn


def _draw_states(axes: Axes, given: Sequence[xr.Dataset], looks: Looks, kind: str, asked: Sequence[str] | None) -> None:
    """Draw orbits, phase spaces or a section, and label the axes."""
    if len({one["q"].sizes["component"] > 1 for one in given}) > 1:
        raise bad_setting("datasets", "systems of one and of several coordinates", "systems of like dimension")
    pair = pair_of(given[0], kind, asked)
    for one, look in zip(given, looks, strict=True):
        if kind == "section":
            draw_points(axes, one, pair)
        else:
            draw_curve(axes, one, pair, _thin(one, look))
    units = [_common_unit(given, name) for name, _ in pair]
    x, y = (name_of(one, given[0]) + in_brackets(unit) for one, unit in zip(pair, units, strict=True))
    axes.set(xlabel=x, ylabel=y)
    axes.yaxis.get_offset_text().set_x(-0.125)  # beside the title
    if units[0] == units[1] and all(index is not None for _, index in pair):
        axes.set_aspect("equal", adjustable="datalim")


def _title_of(kind: str, given: Sequence[xr.Dataset], asked: object = None) -> str:
    """Return the title of a panel of states."""
    first = given[0]
    if kind == "section":
        surface = re.sub(r"^q_(\d+)$", r"$q_\1 = 0$", str(first.attrs["surface_name"]))
        return f"{int(first['crossings'].sum())} crossings of {surface}, {first.attrs['direction']}"
    if asked is not None and any(index is None for _, index in pair_of(first, kind, asked)):
        return "trajectory, from the dot on"
    phase = kind == "phase" or first["q"].sizes["component"] == 1
    return ("phase space" if phase else "orbit") + ", from the dot on"


def varying(given: Sequence[xr.Dataset]) -> str:
    """Return ``parameter_<name>`` if it is the only varied parameter of each ensemble, else :data:`MEMBER`."""
    found = {
        tuple(name for name in one.variables if str(name).startswith("parameter_") and np.ptp(one[name].values) > 0)
        for one in given
    }
    names = found.pop()
    return str(names[0]) if len(names) == 1 and not found else MEMBER


@house_style
def _chaos(given: Sequence[xr.Dataset], looks: Looks, handles: Sequence[Line2D]) -> Figure:
    """Draw the indicators of chaos of results of ``tangent`` over time, members in one colour each."""
    shown = [one for one in INDICATORS if all(one[0] in dataset for dataset in given)]
    height = 0.9 + 2.3 * len(shown)
    drawn = _frame(height, left=0.125, top=1 - 0.55 / height, bottom=0.07, hspace=0.16)
    panels = drawn.subplots(len(shown), 1, sharex=True, squeeze=False).flat
    for number, (axes, (name, label, scale)) in enumerate(zip(panels, shown, strict=True)):
        for one, look in zip(given, looks, strict=True):
            rows, style = np.atleast_2d(one[name].values), _thin(one, look)
            colours = colormaps["cividis"](np.linspace(0, 0.9, len(rows))) if len(rows) > 1 else [style["color"]]
            for row, colour in zip(rows, colours, strict=True):
                axes.plot(one["t"].values, row, **{**style, "color": colour})
        if scale == "log":
            log_scale(axes, "y")
        axes.set_ylabel(label + in_brackets(str(given[0][name].attrs.get("units", "1"))))
        panel_letter(axes, number, "one line for each member" if MEMBER in given[0].dims and not number else "")
    axes.set_xlabel(r"time $t$" + in_brackets(_common_unit(given, "t")))
    drawn.legend(handles=handles, **LEGEND)
    return drawn


@house_style
def _members(given: Sequence[xr.Dataset], looks: Looks, handles: Sequence[Line2D]) -> Figure:
    """Draw the maximum energy error of each member of ensembles as a point, and say how many members diverged."""
    against = varying(given)
    unit = "1" if against == MEMBER else _common_unit(given, against)
    drawn = _frame(4.6, bottom=0.105)
    axes = drawn.subplots()
    for one, look in zip(given, looks, strict=True):
        errors = one["max_energy_error"].values
        x = np.arange(errors.size) if against == MEMBER else one[against].values
        style = _line(one, look, linestyle="none")
        axes.plot(x, errors, **{**style, "markersize": 2.5 if errors.size > 100 else 5})
    log_scale(axes, "y")
    axes.set_xlabel(against.removeprefix("parameter_") + ("" if unit == "1" else f"  ({unit})"))
    lost = sum(int((one["status"] == "diverged").sum()) for one in given)
    members = sum(one.sizes[MEMBER] for one in given)
    more = ", a point for each member" + (f"; {lost} of {members} diverged" if lost else "")
    _finish_maxima(axes, given, more)
    draw_floor(axes, given, "max_energy_error")
    drawn.legend(handles=handles, **LEGEND)
    return drawn


@house_style
def _work(given: Sequence[xr.Dataset], looks: Looks, handles: Sequence[Line2D]) -> Figure:
    """Draw the maximum energy errors of sweeps against the evaluations of the force."""
    drawn = _frame(4.6, bottom=0.115)
    axes = drawn.subplots()
    for one, look in zip(given, looks, strict=True):
        ascending = one.sortby("evaluations")
        axes.plot(ascending["evaluations"], ascending["max_energy_error"], **_line(one, look))
    log_scale(axes, "xy")
    axes.set_xlabel("evaluations of the force")
    _finish_maxima(axes, given)
    drawn.legend(handles=handles, **LEGEND)
    return drawn


def _finish_maxima(axes: Axes, given: Sequence[xr.Dataset], more: str = "") -> None:
    notes = given[0]["max_energy_error"].attrs
    axes.set_ylabel(error_label(notes, r"\max\,"))
    panel_letter(axes, "A", f"maximum {range_of(notes)}{more}")
    say_if_empty(axes, [one["max_energy_error"].values for one in given])


@house_style
def _ranking(ranking: xr.Dataset) -> Figure:
    """Draw the error of each method of a recommendation against its evaluations and against its time."""
    measure = "position_error" if "position_error" in ranking else f"{ranking.attrs['measure']}_energy_error"
    errors, bound = ranking[measure], float(ranking.attrs["error"])
    drawn = _frame(4.6, bottom=0.115, wspace=0.08)
    left, right = drawn.subplots(1, 2, sharey=True)
    handles = []
    for axes, x in ((left, ranking["evaluations"].values), (right, 1e3 * ranking["time"].values)):
        for rank, (a, b) in enumerate(zip(x, errors.values, strict=True)):
            style = style_of(str(ranking["integrator"].values[rank])).line(linestyle="none")
            look = style if rank < NAMED else {"marker": ".", "color": "#9a9a9a", "linestyle": "none"}
            (point,) = axes.plot([a], [b], **look)
            if axes is left and rank < NAMED:
                point.set_label(f"{rank + 1}. {ranking['label'].values[rank]}")
                handles.append(point)
        axes.axhline(bound, color="#595959", linewidth=0.8, linestyle=(0, (6, 3)))
        log_scale(axes, "xy")
        axes.set(xlim=_between_labels(x), ylim=_between_labels([*errors.values, bound]))
    left.set(
        xlabel="evaluations of the force",
        ylabel="position error" if measure == "position_error" else error_label(errors.attrs),
    )
    right.set_xlabel("time (ms)")
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
