"""Figures of Datasets, one for each kind and content, and the frames of films."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from html import escape
from io import BytesIO
from math import ceil, floor, inf, log10, pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.engine.kernels import formulas_digest
from nearharmonic.errors import bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats
from nearharmonic.plotting import style
from nearharmonic.plotting.plot import CUBE, MEMBER, PROFILE, RANKING, TRAJECTORY, check_measured, plot
from nearharmonic.plotting.profile import SPARE_COLOURS, Line, range_of
from nearharmonic.systems import systems
from nearharmonic.systems.formulas import with_parameters

if TYPE_CHECKING:
    import xarray as xr

#: Attributes that distinguish Datasets of one integrator, in the order of the legend.
TOLD = ("system", "precision", "summation", "first", "t_end", "split")
#: Dashes of the second, third, ... Dataset of one integrator; extended precision has the dashes of the figures.
DASHES = ("solid", (0, (6, 2)), (0, (1, 1)), (0, (6, 2, 1, 2)))
#: Indicators of chaos over time: name, label, and logarithmic axes.
INDICATORS = (
    ("lyapunov_exponent", r"largest exponent, $\ln(|\delta|/|\delta_0|)/t$", "y"), ("megno", "MEGNO", ""),
    ("sali", "SALI", "y"),
)  # fmt: skip
#: Methods of a recommendation that are named beside their points: the fastest ones.
NAMED = 8


class Run(NamedTuple):
    """A Dataset with its entry in the legend, and the changes of its method's line style."""

    dataset: xr.Dataset
    label: str
    look: Mapping[str, Any]

    def line(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot``."""
        return style.style_of(str(self.dataset.attrs["integrator"])).line(**{**self.look, **changes})

    def thin(self) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for a thin line without markers."""
        return self.line(marker="none", linewidth=0.8)


@style.house_style
def draw(source: str, kind: str, given: Sequence[xr.Dataset], axes: Sequence[str] | None) -> Figure:
    """Draw Datasets of the kind ``source`` as :func:`nearharmonic.plot` does."""
    if source in (CUBE, RANKING):
        return (style.draw_profile if source == CUBE else _ranking)(given[0])
    runs = runs_of(given)
    if kind in ("orbit", "phase", "section"):
        return _states(runs, kind, axes)
    if kind == "chaos":
        return _chaos(runs)
    if source == TRAJECTORY:
        return _trajectories(runs, with_orbit=not kind)
    check_measured(given)
    _common_meaning(given, "max_energy_error")
    return _profiles(runs) if (source, kind) == (PROFILE, "energy") else _maxima(runs, kind)


def write_above(drawn: Figure, title: str) -> None:
    """Write a title into a strip added above a figure."""
    (width, height), strip = drawn.get_size_inches(), 0.32
    share = height / (height + strip)
    drawn.set_size_inches(width, height + strip)
    for one in drawn.axes:
        box = one.get_position()
        one.set_position((box.x0, box.y0 * share, box.width, box.height * share))
    for legend in drawn.legends:
        legend.set_bbox_to_anchor((0.545, 0.995 * share), transform=drawn.transFigure)
    drawn.text(0.5, 1 - strip / 2 / (height + strip), title, ha="center", va="center", fontsize=min(10.8, 2.4 * width))


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
    drawn = style.new_figure(7, height)
    drawn.subplots_adjust(**{"left": 0.115, "right": 0.985, "top": 0.86, **edges})
    return drawn


# --- Legend and line style of each Dataset ----------------------------------------------------------------------------


def runs_of(given: Sequence[xr.Dataset]) -> list[Run]:
    """Return each Dataset with its label and look: integrators differ in colours, runs of one in dashes."""
    runs, turns, colours = list[Run](), dict[str, int](), dict[str, str]()
    for one, label in zip(given, _labels_of(given), strict=True):
        name = str(one.attrs["integrator"])
        own = style.style_of(name)
        if name not in colours:
            free = [c for c in (own.colour, *SPARE_COLOURS) if c not in colours.values()]
            colours[name] = free[0] if free else own.colour
        turn = turns[name] = turns.get(name, -1) + 1
        extended = one.attrs.get("precision") == "extended" and turn > 0
        look = dict(style.DASHED) if extended else {"linestyle": DASHES[turn % len(DASHES)]} if turn else {}
        if colours[name] != own.colour:
            look |= {"color": colours[name], "markerfacecolor": colours[name] if own.filled else "white"}
        runs.append(Run(one, label, look))
    return runs


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
    words = {"precision": f"{value} precision", "summation": f"{value} sums", "first": f"{value} first"}
    return words.get(key) or (f"t = {value}" if key == "t_end" else value.replace("_", " "))


def _add_legend(drawn: Figure, runs: Sequence[Run], **changes: Any) -> None:
    drawn.legend(handles=[Line2D([], [], label=run.label, **run.line(**changes)) for run in runs], **style.LEGEND)


# --- A figure for each content ----------------------------------------------------------------------------------------


def _profiles(runs: Sequence[Run]) -> Figure:
    curves = []
    for i, (one, _, _) in enumerate(runs):
        ascending = one.sortby("tau")
        done = np.where(one["diverged_at"] > 0, one["diverged_at"], one["steps"])
        # Evaluations of the force per step, without the one that starts the first step.
        stages = int((int(one["evaluations"][0]) - (one.attrs["first"] == "kick")) // done[0])
        ascending = ascending.assign_coords(tau_per_stage=ascending["tau"] / stages)
        curves.append(Line(str(one.attrs["integrator"]), "", ascending, (i, len(runs))))
    given = [run.dataset for run in runs]
    handles = [Line2D([], [], label=run.label, **run.line()) for run in runs]
    return style.draw_profiles(curves, [run.look for run in runs], handles, _common_unit(given, "tau"), given)


def _trajectories(runs: Sequence[Run], *, with_orbit: bool) -> Figure:
    given = [run.dataset for run in runs]
    measured = [one for one in given if one.attrs.get("energy") != "none"]
    if not measured and with_orbit:
        return _states(runs, "orbit", None)
    check_measured(given if not with_orbit else measured)
    edges = {"top": 0.925, "bottom": 0.062} if with_orbit else {"top": 0.86, "bottom": 0.12}
    drawn = _frame(8.2 if with_orbit else 4.2, **edges, hspace=0.2)
    upper, *lower = drawn.subplots(2, 1, height_ratios=(2, 3)) if with_orbit else (drawn.subplots(),)
    for run in runs:
        if run.dataset.attrs.get("energy") != "none":
            upper.plot(run.dataset["t"].values, np.abs(run.dataset["energy_error"].values), **run.thin())
    style.log_scale(upper, "y")
    upper.set_xlabel(r"time $t$" + in_brackets(_common_unit(given, "t")))
    _common_meaning(measured, "energy_error")
    upper.set_ylabel(style.error_label(measured[0]["max_energy_error"].attrs))
    style.panel_letter(upper, "A", "energy error at the samples")
    style.draw_floor(upper, measured, "energy_error")
    for axes in lower:
        _draw_states(axes, runs, "orbit", None)
        style.panel_letter(axes, "B", _title_of("orbit", given[0]))
    _add_legend(drawn, runs, marker="none")
    return drawn


def _states(runs: Sequence[Run], kind: str, asked: Sequence[str] | None) -> Figure:
    drawn = _frame(5.2, top=0.885, bottom=0.095)
    axes = drawn.subplots()
    _draw_states(axes, runs, kind, asked)
    style.panel_letter(axes, "A", _title_of(kind, runs[0].dataset, asked))
    if kind != "section":
        _add_legend(drawn, runs, marker="none")
    return drawn


def varying(given: Sequence[xr.Dataset]) -> str:
    """Return ``parameter_<name>`` if it is the only varied parameter of each ensemble, else :data:`MEMBER`."""
    found = {
        tuple(name for name in one.variables if str(name).startswith("parameter_") and np.ptp(one[name].values) > 0)
        for one in given
    }
    names = found.pop()
    return str(names[0]) if len(names) == 1 and not found else MEMBER


def _chaos(runs: Sequence[Run]) -> Figure:
    """Draw the indicators of chaos of results of ``tangent`` over time, members in one colour each."""
    given = [run.dataset for run in runs]
    shown = [one for one in INDICATORS if all(one[0] in dataset for dataset in given)]
    height = 0.9 + 2.3 * len(shown)
    drawn = _frame(height, left=0.125, top=1 - 0.55 / height, bottom=0.07, hspace=0.16)
    panels = drawn.subplots(len(shown), 1, sharex=True, squeeze=False).flat
    for number, (axes, (name, label, logarithmic)) in enumerate(zip(panels, shown, strict=True)):
        for run in runs:
            rows, look = np.atleast_2d(run.dataset[name].values), run.thin()
            colours = colormaps["cividis"](np.linspace(0, 0.9, len(rows))) if len(rows) > 1 else [look["color"]]
            for row, colour in zip(rows, colours, strict=True):
                axes.plot(run.dataset["t"].values, row, **{**look, "color": colour})
        style.log_scale(axes, logarithmic)
        axes.set_ylabel(label + in_brackets(str(given[0][name].attrs.get("units", "1"))))
        style.panel_letter(axes, number, "one line for each member" if MEMBER in given[0].dims and not number else "")
    axes.set_xlabel(r"time $t$" + in_brackets(_common_unit(given, "t")))
    _add_legend(drawn, runs, marker="none")
    return drawn


def _maxima(runs: Sequence[Run], kind: str) -> Figure:
    """Draw the maximum energy errors of sweeps against the evaluations ("work"), or of each member of ensembles."""
    given = [run.dataset for run in runs]
    notes = given[0]["max_energy_error"].attrs
    drawn = _frame(4.6, bottom=0.115 if kind == "work" else 0.105)
    axes, title = drawn.subplots(), f"maximum {range_of(notes)}"
    if kind == "work":
        for run in runs:
            ascending = run.dataset.sortby("evaluations")
            errors = ascending["max_energy_error"].values
            axes.plot(ascending["evaluations"].values, errors, **style.with_lone_points(run.line(), errors))
        axes.set_xlabel("evaluations of the force")
    else:
        against = varying(given)
        unit = "1" if against == MEMBER else _common_unit(given, against)
        for run in runs:
            errors = run.dataset["max_energy_error"].values
            x = np.arange(errors.size) if against == MEMBER else run.dataset[against].values
            axes.plot(x, errors, **{**run.line(linestyle="none"), "markersize": 2.5 if errors.size > 100 else 5})
        axes.set_xlabel(against.removeprefix("parameter_") + ("" if unit == "1" else f"  ({unit})"))
        lost = sum(int((one["status"] == "diverged").sum()) for one in given)
        title += ", a point for each member"
        title += f"; {lost} of {sum(one.sizes[MEMBER] for one in given)} diverged" if lost else ""
    style.log_scale(axes, "xy" if kind == "work" else "y")
    axes.set_ylabel(style.error_label(notes, r"\max\,"))
    style.panel_letter(axes, "A", title)
    style.say_if_empty(axes, [one["max_energy_error"].values for one in given])
    if kind != "work":
        style.draw_floor(axes, given, "max_energy_error")
    _add_legend(drawn, runs, **({} if kind == "work" else {"linestyle": "none"}))
    return drawn


def _ranking(ranking: xr.Dataset) -> Figure:
    """Draw the error of each method of a recommendation against its evaluations and against its time."""
    measure = "position_error" if "position_error" in ranking else f"{ranking.attrs['measure']}_energy_error"
    errors, bound = ranking[measure], float(ranking.attrs["error"])
    drawn = _frame(4.6, bottom=0.115, wspace=0.08)
    left, right = drawn.subplots(1, 2, sharey=True)
    handles = []
    for axes, x in ((left, ranking["evaluations"].values), (right, 1e3 * ranking["time"].values)):
        for rank, (a, b) in enumerate(zip(x, errors.values, strict=True)):
            own = style.style_of(str(ranking["integrator"].values[rank])).points()
            look = own if rank < NAMED else {"marker": ".", "color": "#9a9a9a", "linestyle": "none"}
            (point,) = axes.plot([a], [b], **look)
            if axes is left and rank < NAMED:
                point.set_label(f"{rank + 1}. {ranking['label'].values[rank]}")
                handles.append(point)
        axes.axhline(bound, color="#595959", linewidth=0.8, linestyle=(0, (6, 3)))
        style.log_scale(axes, "xy")
        axes.set(xlim=_between_labels(x), ylim=_between_labels([*errors.values, bound]))
    says = "position error" if measure == "position_error" else style.error_label(errors.attrs)
    left.set(xlabel="evaluations of the force", ylabel=says)
    right.set_xlabel("time (ms)")
    style.panel_letter(left, "A", "error and evaluations")
    style.panel_letter(right, "B", "error and time")
    drawn.legend(handles=handles, **style.LEGEND)
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


# --- Orbits, phase space and Poincare sections: two quantities of states against each other ---------------------------

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
    if asked is None:
        if kind == "orbit" and d > 1:
            return ("q", 0), ("q", 1)
        free = int(kind == "section" and d > 1 and dataset.attrs.get("surface_name") == "q_1")
        return ("q", free), ("p", free)
    known: dict[str, Quantity] = {f"{name}{i + 1}": (name, i) for name in "qp" for i in range(d)}
    for name, one in dataset.variables.items():
        if name != "sample" and one.dims == dataset["q"].dims[:-1] and one.dtype.kind in "fi":
            known[str(name)] = str(name), None
    names = known | {"q": ("q", 0), "p": ("p", 0)} | {f"{n}_{i + 1}": (n, i) for n in "qp" for i in range(d)}
    chosen = [names.get(name) for name in asked if isinstance(name, str)] if isinstance(asked, list | tuple) else []
    pair = [quantity for quantity in chosen if quantity is not None]
    if len(pair) != 2 or len(pair) != len(asked):  # type: ignore[arg-type]
        raise bad_setting("axes", asked, f"two of {', '.join(known)}")
    return pair[0], pair[1]


def name_of(quantity: Quantity, dataset: xr.Dataset) -> str:
    """Return the name of a quantity in a label: $q_1$, $q$ of a system of one coordinate, or a variable in words."""
    name, index = quantity
    if index is None:
        return "time $t$" if name == "t" else str(dataset[name].attrs.get("long_name", name))
    return f"${name}_{index + 1}$" if dataset["q"].sizes["component"] > 1 else f"${name}$"


def _column(one: xr.Dataset, quantity: Quantity) -> Floats:
    """Return the values of a quantity over the samples, or over members and crossings."""
    name, index = quantity
    values: Floats = one[name].values
    return values if index is None else values[..., index]


def _draw_states(axes: Axes, runs: Sequence[Run], kind: str, asked: Sequence[str] | None) -> None:
    """Draw orbits, phase spaces or a section, and label the axes."""
    given = [run.dataset for run in runs]
    if len({one["q"].sizes["component"] > 1 for one in given}) > 1:
        raise bad_setting("datasets", "systems of one and of several coordinates", "systems of like dimension")
    pair = pair_of(given[0], kind, asked)
    for run in runs:
        if kind == "section":
            colours = colormaps["cividis"](np.linspace(0, 0.9, run.dataset.sizes["member"]))  # the darker part
            for colour, x, y in zip(colours, *(_column(run.dataset, quantity) for quantity in pair), strict=True):
                axes.plot(x, y, ".", markersize=3 if x.size < 300 else 1.5, markeredgewidth=0, color=colour)
        else:
            _draw_curve(axes, run.dataset, pair, run.thin())
    units = [_common_unit(given, name) for name, _ in pair]
    x, y = (name_of(one, given[0]) + in_brackets(unit) for one, unit in zip(pair, units, strict=True))
    axes.set(xlabel=x, ylabel=y)
    axes.yaxis.get_offset_text().set_x(-0.125)  # beside the title
    if units[0] == units[1] and all(index is not None for _, index in pair):
        axes.set_aspect("equal", adjustable="datalim")


def _title_of(kind: str, first: xr.Dataset, asked: object = None) -> str:
    """Return the title of a panel of states."""
    if kind == "section":
        surface = re.sub(r"^q_(\d+)$", r"$q_\1 = 0$", str(first.attrs["surface_name"]))
        return f"{int(first['crossings'].sum())} crossings of {surface}, {first.attrs['direction']}"
    if asked is not None and any(index is None for _, index in pair_of(first, kind, asked)):
        return "trajectory, from the dot on"
    phase = kind == "phase" or first["q"].sizes["component"] == 1
    return ("phase space" if phase else "orbit") + ", from the dot on"


def _draw_curve(axes: Axes, one: xr.Dataset, pair: Pair, line: Mapping[str, Any]) -> None:
    """Draw a trajectory from a dot on: smooth between coarse samples, or as points if its formulas are unknown."""
    x, y = columns = [_column(one, quantity) for quantity in pair]
    turn = _largest_turn(x, y)
    smooth = _smooth(one, pair) if turn > COARSE else None
    if smooth is None and turn > APART and ("t", None) not in pair:
        line = {**line, "linestyle": "none", "marker": ".", "markersize": 3, "markeredgewidth": 0}
        line["markerfacecolor"] = line["color"]
    axes.plot(*(columns if smooth is None else smooth), **line)
    axes.plot(x[:1], y[:1], marker="o", markersize=5, color="#404040", linestyle="none", zorder=4)


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
    """Return dx/dt of states x = (q, p, t), None unless the formulas of a result belong to a registered system.

    The name alone does not tell: a user's system may have it too.
    """
    name = str(one.attrs.get("system"))
    system = systems[name] if name in systems.registered else None
    if not system or system.regularisation is not None or formulas_digest(system) != one.attrs.get("formulas"):
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


# --- Frames of films, as a GIF file or in an HTML page ----------------------------------------------------------------

_PAGE = """<!DOCTYPE html>
<meta charset="utf-8"><title>{title}</title>
<style>body{{font:14px sans-serif;text-align:center}}img{{max-width:100%}}input{{width:60%}}</style>
<img alt="{title}"><br><button>pause</button> <input type="range" min="0" max="{last}" value="0">
<script>
const frames={frames},at=s=>document.querySelector(s),slider=at("input"),button=at("button");
let playing=true;
function show(k){{slider.value=k;at("img").src="data:image/png;base64,"+frames[k];}}
slider.oninput=()=>{{playing=false;button.textContent="play";show(+slider.value);}};
button.onclick=()=>{{playing=!playing;button.textContent=playing?"pause":"play";}};
setInterval(()=>{{if(playing)show((+slider.value+1)%frames.length);}},{interval});
show(0);
</script>
"""


def film_gif(given: Sequence[xr.Dataset], frames: int, fps: int, title: str | None) -> bytes:
    """Return the film of trajectories as a GIF file."""
    from PIL import Image

    first, *others = [Image.open(BytesIO(one)).convert("RGB") for one in _pictures(given, frames, title)]
    content = BytesIO()
    first.save(content, "GIF", save_all=True, append_images=others, duration=int(1000 / fps), loop=0)
    return content.getvalue()


def film_page(given: Sequence[xr.Dataset], frames: int, fps: int, title: str | None) -> str:
    """Return the film of trajectories as an HTML page, which needs no network."""
    return _PAGE.format(
        title=escape(title or "orbit and energy error"), last=frames - 1, interval=round(1000 / fps),
        frames=[b64encode(one).decode() for one in _pictures(given, frames, title)],
    )  # fmt: skip


@style.house_style
def _pictures(given: Sequence[xr.Dataset], frames: int, title: str | None) -> list[bytes]:
    """Return the frames as PNG files with 90 pixels per inch."""
    figure = plot(given, title=title)
    show, found = truncator(figure, given), []
    for k in range(frames):
        show(k / (frames - 1))
        found.append(style.png(figure, 90))
    return found


def truncator(figure: Figure, given: Sequence[xr.Dataset]) -> Callable[[float], None]:
    """Put the orbit above the energy error; return a function that cuts the runs ``given`` at a share of the time."""
    energy, orbit = figure.axes
    upper, lower = energy.get_position(), orbit.get_position()
    energy.set_position((lower.x0, lower.y0, upper.width, upper.height))
    orbit.set_position((upper.x0, upper.y1 - lower.height, lower.width, lower.height))
    for axes, letter in ((orbit, "A"), (energy, "B")):
        style.panel_letter(axes, letter, axes.get_title(loc="left"))
    figure.draw_without_rendering()  # the limits of complete curves
    curves = [(orbit.lines[2 * k], energy.lines[k]) for k in range(len(given))]
    whole = [[np.array(line.get_xydata()) for line in pair] for pair in curves]
    dots = [orbit.plot([], [], "o", markersize=6, color=line.get_color())[0] for _, line in curves]
    times = [one["t"].values for one in given]
    first, last = min(t[0] for t in times), max(t[-1] for t in times)
    unit = in_brackets(str(given[0]["t"].attrs.get("units", "1")))

    def show(share: float) -> None:
        now = first + share * (last - first)
        for t, pair, points, dot in zip(times, curves, whole, dots, strict=True):
            passed = (np.searchsorted(t, now * (1 + 1e-12), side="right") - 1) / max(1, len(t) - 1)
            for line, all_of_it in zip(pair, points, strict=True):
                line.set_data(*all_of_it[: round(passed * (len(all_of_it) - 1)) + 1].T)
            dot.set_data(*np.array(pair[0].get_xydata())[-1:].T)
        style.right_title(orbit, f"$t$ = {now:.4g}{unit}")

    return show
