"""The interactive figures of the paper, drawn by bokeh from the data of the static figures.

Every renderer has the name of its method as a tag; the legend of the page uses it to show and hide the method. A page
holds the plots of a figure as a document of bokeh, and the script that shows them. The document is written as JSON,
which is bokeh's interface for other languages: its Python classes would resolve 100 000 defaults a page, nine tenths of
the time, and the script resolves them anyway.
"""

from __future__ import annotations

import gzip
import json
import re
import sys
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import distribution, version
from math import log10, pi
from pathlib import Path
from string import ascii_uppercase
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.output.store import double_runs
from nearharmonic.output.table import power_of_ten
from nearharmonic.plotting.profile import (
    LARGEST_ERROR,
    PANELS,
    UNITS,
    Line,
    beyond,
    darker,
    energy_error_label,
    floor_name,
    floor_near,
    lines,
    lone,
    spread,
    style_of,
)
from nearharmonic_paper.experiments.paper.gain import gains
from nearharmonic_paper.experiments.paper.orbits import (
    MERCURY_RELATIVISTIC_ADVANCE,
    NO_ORDER,
    SATISFIED_BELOW,
    advances,
    arcseconds_per_century,
    contours,
    label_places,
    legs,
    levels,
    statement,
)

if TYPE_CHECKING:
    import xarray as xr


# --- Documents of bokeh, and the script that shows them.


class Model(SimpleNamespace):
    """A model of bokeh: ``kind``, the name of its class, and the attributes that differ from bokeh's defaults."""

    def __init__(self, kind: str, **attributes: Any) -> None:
        super().__init__(kind=kind, **attributes)


def fields(**columns: str) -> dict[str, Any]:
    """Return attributes of a glyph with a value for each point: names of columns of its source."""
    return {name: SimpleNamespace(type="field", field=column) for name, column in columns.items()}


def document(plots: Mapping[str, Model]) -> str:
    """Return a document with these plots, by their names, as JSON.

    Models are numbered in the order of writing, so that equal plots give equal texts; their ids begin with the name of
    the first plot, so that documents of several figures share a page.
    """
    ids: dict[int, str] = {}

    def written(one: Any) -> Any:
        if isinstance(one, np.ndarray):
            if one.dtype.kind in "UO":
                return one.tolist()
            told = {"shape": one.shape, "dtype": str(one.dtype), "order": sys.byteorder}
            # Bokeh expects gzip, here without compression: the whole document is compressed once.
            held = b64encode(gzip.compress(one.tobytes(), compresslevel=0, mtime=0)).decode()
            return {"type": "ndarray", "array": {"type": "bytes", "data": held}} | told
        if not isinstance(one, Model):
            return vars(one)
        if id(one) in ids:
            return {"id": ids[id(one)]}
        ids[id(one)] = f"{roots[0].name}-{len(ids)}"
        attributes = {
            name: {"type": "map", "entries": list(value.items())} if isinstance(value, dict) else value
            for name, value in vars(one).items() if name != "kind"
        }  # fmt: skip
        return {"type": "object", "name": one.kind, "id": ids[id(one)], "attributes": attributes}

    roots = list(plots.values())
    for name, plot in plots.items():
        plot.name = name  # the script of the page finds it by this id
    told = {"version": version("bokeh"), "title": "nearharmonic", "config": Model("DocumentConfig"), "roots": roots}
    return json.dumps(told, default=written, separators=(",", ":"), allow_nan=False)


def script() -> str:
    """Return the installed script of bokeh: the core without extensions."""
    place = distribution("bokeh").locate_file("bokeh/server/static/js/bokeh.min.js")
    return Path(str(place)).read_text(encoding="utf-8")


# --- Panels: axes, zoom, hover, and the lines and markers of the static figures.

#: Width in pixels: a hover finds curves within half of it.
_REACH = 12
#: Columns of a curve of more points than a page can hold.
COLUMNS = 120
#: Number of markers on a curve, interleaved with the markers of other methods.
_MARKS = 14
#: In pixels.
_MARKER_SIZE = 7
#: Column of 1 for points with a marker and 0 for others.
MARKED = "marked"
FONT = "system-ui, sans-serif"
_LOGARITHMIC = "log"
#: Labels of axes and their ticks.
_AXIS = {
    "axis_label_text_font": FONT, "axis_label_text_font_style": "normal", "axis_label_text_font_size": "13px",
    "axis_label_text_color": "#222222", "major_label_text_font": FONT, "major_label_text_font_size": "12px",
    "major_label_text_color": "#333333",
}  # fmt: skip


class Marker(NamedTuple):
    """A marker of the house style: bokeh's name, rotation in radians, and SVG path within [-1, 1] for the legend."""

    shape: str
    angle: float
    outline: str


_HEXAGON = "M0-1L.87-.5V.5L0 1-.87 .5V-.5z"
_CIRCLE = "M-.9 0a.9.9 0 1 0 1.8 0a.9.9 0 1 0-1.8 0z"
_CROSS = "M-.95-.45L-.45-.95 0-.5 .45-.95 .95-.45 .5 0 .95 .45 .45 .95 0 .5-.45 .95-.95 .45-.5 0z"

#: Markers by their matplotlib names. Bokeh has no pentagon and no octagon; they become a hexagon, and a circle with a
#: dot.
MARKERS = {
    "o": Marker("circle", 0.0, _CIRCLE),
    "s": Marker("square", 0.0, "M-.85-.85h1.7v1.7h-1.7z"),
    "^": Marker("triangle", 0.0, "M0-.95L.95 .8H-.95z"),
    "v": Marker("inverted_triangle", 0.0, "M0 .95L.95-.8H-.95z"),
    "<": Marker("triangle", pi / 2, "M-.95 0L.8-.95V.95z"),
    ">": Marker("triangle", -pi / 2, "M.95 0L-.8-.95V.95z"),
    "D": Marker("diamond", 0.0, "M0-1L1 0 0 1-1 0z"),
    "d": Marker("diamond_dot", 0.0, "M0-1L.6 0 0 1-.6 0z"),
    "p": Marker("hex", 0.0, _HEXAGON),
    "h": Marker("hex_dot", 0.0, _HEXAGON),
    "8": Marker("circle_dot", 0.0, _CIRCLE),
    "*": Marker("star", 0.0, "M0-1L.25-.3H.95L.38.14.59.8 0 .4-.59.8-.38.14-.95-.3H-.25z"),
    "P": Marker("plus", 0.0, "M-.35-1h.7v.65h.65v.7h-.65v.65h-.7v-.65h-.65v-.7h.65z"),
    "X": Marker("plus", pi / 4, _CROSS),
}


class Panel(NamedTuple):
    """A panel of a figure: its title, which HTML wraps where it is long, its plot, and a text below the plot."""

    title: str
    plot: Model
    note: str = ""


def span(values: Iterable[Any], logarithmic: bool, highest: float = np.inf) -> Model:
    """Return a range of an axis, for one or more panels, with all numbers and a margin, up to ``highest`` at most.

    NaN and infinities are ignored, and on a logarithmic axis also zeros and negative numbers.
    """
    numbers = np.concatenate([np.ravel(np.asarray(value, dtype=float)) for value in values] or [np.empty(0)])
    numbers = numbers[np.isfinite(numbers) & ((numbers > 0) | (not logarithmic))]
    low, high = (numbers.min(), numbers.max()) if numbers.size else (1e-16, 1.0)
    if logarithmic:
        margin = max(0.03 * np.log10(high / low), 0.05)
        low, high = low / 10**margin, high * 10**margin
    else:
        margin = 0.03 * (high - low) or 0.5
        low, high = low - margin, high + margin
    return exactly(low, min(high, highest), logarithmic)


def exactly(low: float, high: float, logarithmic: bool = False) -> Model:
    """Return a range of an axis from ``low`` to ``high``."""
    return Model("Range1d", start=float(low), end=float(high), tags=[_LOGARITHMIC] if logarithmic else [])


def new_plot(ranges: tuple[Model, Model], labels: tuple[str, str], height: int = 460) -> Model:
    """Return an empty plot with these ranges (linear or logarithmic) and labels of x and y."""
    tools = [Model("BoxZoomTool"), Model("PanTool"), Model("WheelZoomTool"), Model("SaveTool"), Model("ResetTool")]
    axes = [_axis(one, label) for one, label in zip(ranges, labels, strict=True)]
    scales = [Model("LogScale") if _LOGARITHMIC in one.tags else Model("LinearScale") for one in ranges]
    return Model(
        "Plot", title=None, x_range=ranges[0], y_range=ranges[1], x_scale=scales[0], y_scale=scales[1], height=height,
        sizing_mode="stretch_width", output_backend="canvas", renderers=[], below=[axes[0]], left=[axes[1]],
        toolbar=Model("Toolbar", logo=None, tools=tools, active_drag=tools[0], active_scroll=None),
        min_border=4, min_border_right=14, outline_line_color="#444444",
        center=[Model("Grid", axis=axis, dimension=i, grid_line_color="#e3e3e3") for i, axis in enumerate(axes)],
    )  # fmt: skip


def _axis(one: Model, label: str) -> Model:
    if _LOGARITHMIC in one.tags:
        ticks = {"ticker": Model("LogTicker", mantissas=[1, 5]), "formatter": Model("LogTickFormatter")}
        return Model("LogAxis", axis_label=label, major_label_policy=Model("NoOverlap"), **ticks, **_AXIS)
    return Model("LinearAxis", axis_label=label, ticker=Model("BasicTicker", mantissas=[1, 2, 5]), **_AXIS)


def source_of(**columns: Any) -> Model:
    """Return a source of columns of equal length; numbers are exact doubles, or small integers."""
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    kept = {name: array if array.dtype.kind in "UO" or array.dtype == np.uint8 else array.astype(np.float64)
            for name, array in arrays.items()}  # fmt: skip
    return Model("ColumnDataSource", data=kept)


def lines_of(lines: Sequence[Any]) -> Model:
    """Return a source of lines, each as its coordinates along x and y."""
    return Model("ColumnDataSource", data={"x": [line[0] for line in lines], "y": [line[1] for line in lines]})


def marked(columns: Mapping[str, Any], y: str, line: Line) -> dict[str, Any]:
    """Return ``columns`` with a mask of the points with a marker: points that no line leads to, and one of every few.

    Curves in extended precision have only the former.
    """
    chosen, there = lone(columns[y]).astype(np.uint8), np.flatnonzero(np.isfinite(columns[y]))
    if not line.extended:
        step, (index, methods) = max(1, there.size // _MARKS), line.turn
        chosen[there[index * step // max(1, methods) :: step]] = 1
    return {**columns, MARKED: chosen}


def add(plot: Model, source: Model, glyph: Model, method: str = "", name: str = "") -> Model:
    """Draw a glyph; return the renderer, with ``method`` as its tag and ``name`` as its name in a hover."""
    tags = [method] if method else []
    renderer = Model("GlyphRenderer", data_source=source, glyph=glyph, tags=tags, name=name or None)
    plot.renderers.append(renderer)
    return renderer


def add_line(plot: Model, source: Model, at: tuple[str, str], method: str, **changes: Any) -> Model:
    """Draw a line along the columns ``at``, x and y, in the colour of ``method``."""
    look = {"line_color": style_of(method).colour, "line_width": 1.4} | changes
    return add(plot, source, Model("Line", **fields(x=at[0], y=at[1]), **look), method)


def add_lines(plot: Model, source: Model, method: str = "", **look: Any) -> None:
    """Draw all lines of a source of :func:`lines_of`."""
    add(plot, source, Model("MultiLine", **fields(xs="x", ys="y"), **look), method)


def add_markers(plot: Model, source: Model, at: tuple[str, str], method: str, name: str = "", **changes: Any) -> Model:
    """Draw the marker of ``method`` at the columns ``at``, x and y; only at marked points if the source has a mask."""
    style = style_of(method)
    marker = MARKERS[style.marker]
    seen = fields(line_alpha=MARKED, fill_alpha=MARKED) if MARKED in source.data else {}
    look = {"marker": marker.shape, "angle": marker.angle, "size": _MARKER_SIZE, "line_color": style.colour}
    look |= {"line_width": 1.3, "fill_color": style.colour if style.filled else "#ffffff"}
    return add(plot, source, Model("Scatter", **fields(x=at[0], y=at[1]), **(look | seen | changes)), method, name)


def add_level(plot: Model, level: float, text: str) -> None:
    """Add a horizontal line with its name at the right end."""
    plot.center.append(Model("Span", location=level, dimension="width", line_color="#404040", line_dash=[6, 3]))
    at = {"x": plot.x_range.end, "y": level, "x_offset": -8, "y_offset": 4}
    look = {"text_align": "right", "text_font_size": "12px", "text_color": "#404040", "text_font": FONT}
    plot.center.append(
        Model("Label", text=text, background_fill_color="#ffffff", background_fill_alpha=0.8, **at, **look)
    )


def add_hits(plot: Model, source: Model, at: tuple[str, str], method: str, name: str) -> list[Model]:
    """Draw invisible glyphs at the points ``at``, x and y, for a hover; return the renderers.

    A broad invisible line gives the nearest point, while markers would give the first point within reach. Isolated
    points between gaps get invisible markers.
    """
    columns = source.data
    alone = lone(np.asarray(columns[at[1]], dtype=float))
    unseen = {"line_alpha": 0.0, "line_width": _REACH}
    line = Model("Line", **fields(x=at[0], y=at[1]), **unseen)
    found = [add(plot, source, line, method, name)]
    if alone.any():
        points = source_of(**{one: np.asarray(values)[alone] for one, values in columns.items() if one != MARKED})
        found.append(add_markers(plot, points, at, method, name, line_alpha=0.0, fill_alpha=0.0))
    return found


def add_hover(plot: Model, renderers: Sequence[Model], rows: Sequence[tuple[str, str]]) -> None:
    """Show ``rows`` of (text, field) at points of ``renderers``; fields have bokeh's notation, with printf formats."""
    formatters = {f"@{name}": "printf" for _, field in rows for name in re.findall(r"@(\w+)\{%", field)}
    found: dict[str, Any] = {"renderers": list(renderers), "line_policy": "nearest", "point_policy": "snap_to_data"}
    told = {"tooltips": [list(row) for row in rows], "formatters": formatters, "attachment": "horizontal"}
    plot.toolbar.tools.append(Model("HoverTool", **found, sort_by=None, limit=1, **told))


# --- Figures of the paper.

#: Height of a row of the strip of diverged runs, relative to the panel beneath it; and style of its name.
_ROW = 0.011
_NAME = {"text_font": FONT, "text_font_size": "11px", "text_color": "#444444", "text_baseline": "middle"}
_BAND = {"fill_color": "#ececec", "fill_alpha": 1.0, "line_color": None, "level": "underlay"}
_SQUARE = {"marker": "square", "angle": 0.0, "size": 4, "line_color": None}
#: Operator of the outer row -> name of the composition.
_COMPOSITIONS = {"drift": "ABA", "kick": "BAB"}
#: Shades of the Hamiltonian, from low to high.
_SHADES = (
    "#ffffff", "#f9fafb", "#f3f4f6", "#edeff2", "#e6e9ed", "#e0e4e9",
    "#dadfe4", "#d4d9e0", "#ced4db", "#c8ced7", "#c2c9d3", "#b9c3cf",
)  # fmt: skip
_BLUE, _RED, _GREEN = "#0b5fb5", "#d7301f", "#1a9850"
#: Height of a row of labels, relative to the height of a panel on a phone.
_LABEL_ROW = 0.05
#: A bar across a dot, white.
_BAR = {"marker": "dash", "size": 7, "line_color": "#ffffff", "line_width": 2}
#: (next drift negative, next kick negative) -> meaning, and markers drawn over each other.
_DOTS: dict[tuple[bool, bool], tuple[str, tuple[dict[str, Any], ...]]] = {
    (False, False): ("next drift and kick forward", ({"size": 7, "fill_color": _BLUE},)),
    (True, False): ("next drift backward", ({"size": 11, "fill_color": _RED}, _BAR)),
    (False, True): ("next kick backward", ({"size": 10, "fill_color": _GREEN}, _BAR | {"angle": pi / 2})),
    (True, True): (
        "next drift and kick backward",
        ({"size": 12, "fill_color": _RED}, {"size": 7, "fill_color": _GREEN, "line_color": "#ffffff"}),
    ),
}
#: Look of a colour bar.
_SCALE = {"padding": 2, "bar_line_color": "#444444", "title_standoff": 2, "title_text_font": FONT} | {
    name: value for name, value in _AXIS.items() if name.startswith("major_label")
}
#: Markers of the first and the last state of a path, by its index.
_ENDS: dict[int, dict[str, Any]] = {
    0: {"marker": "circle", "size": 14, "fill_alpha": 0.0, "line_color": _BLUE, "line_width": 2},
    -1: {"marker": "x", "size": 12, "line_color": _BLUE, "line_width": 2.5},
}


def energy_error(cube: xr.Dataset) -> list[Panel]:
    """Draw the energy errors of every method of ``cube``, like the static figure.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally led by precision. Diverged runs are squares in a
    strip at the upper edge. The panels share both axes.
    """
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    floors = {name: floor for name in PANELS if (floor := floor_near([cube], name))}
    errors = [*(cube[name].values for name in PANELS), [*floors.values()]]
    along = span([cube["tau_per_stage"].values], logarithmic=True)
    up = span(errors, logarithmic=True, highest=LARGEST_ERROR)
    shown = lines(cube, columns=COLUMNS)
    strips = {name: beyond(shown, name) for name in PANELS}
    edge, row = up.end, (up.end / up.start) ** _ROW
    up.end *= row ** (max(len(rows) for rows, _ in strips.values()) + 1)
    sources = [source_of(**marked(_columns(line.runs), "max_energy_error", line)) for line in shown]
    symbols = energy_error_label(cube["max_energy_error"].attrs, "|ΔH|", "|ΔH/H₀|")
    found = []
    for letter, (name, statistic) in zip(ascii_uppercase, PANELS.items(), strict=False):
        label = f"{'max' if statistic == 'maximum' else statistic} {symbols}"
        plot = new_plot((along, up), (_step_label(unit), label))
        plot.left[0].bounds = [up.start, edge]  # no labels beside the strip
        _add_slopes(plot)
        if name in floors:
            add_level(plot, floors[name], floor_name(floors[name]))
        says = [line.label + (", extended precision" if line.extended else "") for line in shown]
        hits: list[Model] = []
        for line, source, title in zip(shown, sources, says, strict=True):
            offset, dash = line.dashes()
            look = {"line_dash": [*dash], "line_dash_offset": offset, "line_width": 1.1} if line.extended else {}
            add_line(plot, source, ("x", name), line.integrator, **look)
            if source.data[MARKED].any():
                add_markers(plot, source, ("x", name), line.integrator)
            hits += add_hits(plot, source, ("x", name), line.integrator, title)
        rows, text = strips[name]
        if rows:  # over the lines, which would go on above the panel
            strip = Model("BoxAnnotation", bottom=edge, fill_color="#f6f6f6", fill_alpha=1.0, line_color="#444444")
            at = {"x": along.start, "y": float(edge * row ** ((len(rows) + 1) / 2)), "x_offset": 4}
            plot.center += [strip, Model("Label", text=text.replace("\n", " "), level="overlay", **at, **_NAME)]
        squares = []
        for i, (curve, runs) in enumerate(rows):
            lost = _lost(runs, name, edge * row ** (len(rows) - i))
            method = shown[curve].integrator
            look = _SQUARE | {"fill_color": style_of(method).colour}
            squares.append(add_markers(plot, lost, ("x", "row"), method, says[curve], **look))
            squares[-1].level = "overlay"
        cost = ("τ/s", f"@x{{%.6g}}{_unit(unit)}, @evaluations{{0,0}} evaluations")
        for renderers, field in ((hits, f"@{name}{{%.4e}}"), (squares, "@said, @status")):
            add_hover(plot, renderers, [("", "$name"), cost, (label, field)])
        found.append(Panel(f"{letter}. {statistic.capitalize()} over all steps", plot))
    return found


def gain(*cubes: xr.Dataset, variable: str = "max_energy_error") -> list[Panel]:
    """Draw the gain over Ruth's method of every method of each of ``cubes``, like the static figure."""
    found = [gains(cube, variable) for cube in cubes]
    up, drawn = span([one.values for one in found], logarithmic=True), []
    for letter, cube, one in zip(ascii_uppercase, cubes, found, strict=False):
        unit, there = cube["tau_per_stage"].attrs.get("units", "1"), one.notnull().any("integrator").values
        x = one["tau_per_stage"].values[there]
        along = span([x], logarithmic=True)
        along.start *= (along.start / along.end) ** 0.3  # labels need room on the left
        plot = new_plot((along, up), (_step_label(unit), "Ruth's error / error of the method"))
        _label_ends(plot, one[:, there])
        hits: list[Model] = []
        for curve, label in zip(one[:, there], cube["label"].values, strict=True):
            source, method = source_of(x=x, gain=curve.values), str(curve["integrator"].values)
            look = {"line_width": 3.0} if style_of(method).filled else {"line_alpha": 0.6}
            add_line(plot, source, ("x", "gain"), method, **look)
            hits += add_hits(plot, source, ("x", "gain"), method, str(label))
        rows = [("method", "$name"), ("times smaller", "@gain{%.4g}"), ("τ/s", f"@x{{%.6g}}{_unit(unit)}")]
        add_hover(plot, hits, rows)
        drawn.append(Panel(f"{letter}. {cube.attrs['system_label']}, {PANELS[variable]} over all steps", plot))
    return drawn


def _label_ends(plot: Model, curves: xr.DataArray) -> None:
    """Write the label of each curve beside its left end, as in the static figure; a phone has space for them too."""
    first = [curve.dropna("tau_per_stage")[:1] for curve in curves]
    ends = sorted((one for one in first if one.size), key=lambda one: one.item())
    up, along = (np.log(one.end / one.start) for one in (plot.y_range, plot.x_range))
    rows = np.exp(spread(np.log([one.item() for one in ends]), _LABEL_ROW * up))
    for one, row in zip(ends, rows, strict=True):
        method, label, x = (one[name].item() for name in ("integrator", "label", "tau_per_stage"))
        source = source_of(x=[x], y=[one.item()], aside=[x * np.exp(-0.03 * along)], row=[row], label=[label])
        colour = darker(style_of(method).colour)
        add(plot, source, Model("Segment", **fields(x0="x", y0="y", x1="aside", y1="row"), line_color=colour), method)
        look = _NAME | {"text_color": colour, "text_align": "right", "x_offset": -2}
        add(plot, source, Model("Text", **fields(x="aside", y="row", text="label"), **look), method)


def _step_label(unit: str) -> str:
    return "step size per stage, τ/s (s stages)" + ("" if unit == "1" else f", {UNITS.get(unit, unit)}")


def _unit(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _columns(runs: xr.Dataset) -> dict[str, Any]:
    """Return the runs of one method from the first to the last with a drawable error."""
    errors = {name: runs[name].values.astype(float) for name in PANELS}
    columns = {name: np.where(np.isfinite(error) & (error > 0), error, np.nan) for name, error in errors.items()}
    there = np.flatnonzero(np.any([np.isfinite(values) for values in columns.values()], axis=0))
    kept = slice(there[0], there[-1] + 1) if there.size else slice(0)
    columns |= {"x": runs["tau_per_stage"].values, "evaluations": runs["evaluations"].values}
    return {name: values[kept] for name, values in columns.items()}


def _lost(runs: xr.Dataset, name: str, height: float) -> Model:
    """Return a row of the strip of diverged runs, at this height on the axis of the errors."""
    errors, left = runs[name].values, zip(runs["status"].values.astype(str), runs["diverged_at"].values, strict=True)
    return source_of(
        x=runs["tau_per_stage"].values,
        row=np.full(errors.size, height),
        said=[f"{error:.4e}" if np.isfinite(error) else "∞" for error in errors],
        evaluations=runs["evaluations"].values,
        status=[f"diverged at step {step}" if how == "diverged" else how for how, step in left],
    )


def _add_slopes(plot: Model) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, to read the order of a curve."""
    x, y = plot.x_range.end / 6, plot.y_range.start * 30
    ends = [(4 * x, y * 4.0**order) for order in (4, 6)]
    guides = lines_of([(np.array([x, a]), np.array([y, b])) for a, b in ends])
    add_lines(plot, guides, line_color="#8a8a8a", line_width=1.0)
    words = {"text_color": "#595959", "text_font": FONT, "text_font_size": "11px"}
    # Above the steeper line and below the other one: a narrow window has no room on the right of their ends.
    plot.center.append(Model("Label", text="order 6", x=4 * x, y=y * 4.0**6, x_offset=-6, text_align="right", **words))
    plot.center.append(Model("Label", text="order 4", x=4 * x, y=y, text_align="right", text_baseline="top", **words))


def decomposition(terms: xr.Dataset) -> list[Panel]:
    """Draw ``kappa`` of ``terms``, dimensions (integrator, first, order): terms that remain, and terms that vanish.

    Markers with circles are ABA compositions, markers with lines BAB compositions; the panels share the axis of the
    order.
    """
    order, kappa = terms["order"].values, np.array(terms["kappa"].values, dtype=float)
    labels = [str(label) for label in terms["label"].values]
    along = span([order], logarithmic=False)
    remain = span([kappa[kappa >= SATISFIED_BELOW]], logarithmic=True)
    upper = new_plot((along, remain), ("order, λ", "κ"))
    lower = new_plot((along, span([[0, 1]], logarithmic=False)), ("order, λ", ""))
    lower.y_range, lower.y_scale = Model("FactorRange", factors=labels[::-1]), Model("CategoricalScale")
    lower.left = [Model("CategoricalAxis", **_AXIS)]
    lower.center[1].axis = lower.left[0]
    for plot in (upper, lower):
        plot.below[0].ticker = Model("SingleIntervalTicker", interval=2, num_minor_ticks=2)
    dots: list[Model] = []
    bars: list[Model] = []
    unseen, bar = {"line_alpha": 0.0, "fill_alpha": 0.0}, {"marker": "dash", "angle": 0.0, "size": 20, "line_width": 2}
    for method, label, one in zip(map(str, terms["integrator"].values), labels, kappa, strict=True):
        for first, composition in _COMPOSITIONS.items():
            values = one[terms["first"].values.tolist().index(first)]
            gone, name = values < SATISFIED_BELOW, f"{label} as {composition}"
            remaining = source_of(order=order, shown=np.where(values >= SATISFIED_BELOW, values, np.nan))
            vanishing = source_of(order=order[gone], row=np.full(gone.sum(), label), shown=values[gone])
            if composition == "ABA":
                dots.append(_circle(upper, remaining, "shown", method, name))
                bars.append(_circle(lower, vanishing, "row", method, name))
            else:
                add_line(upper, remaining, ("order", "shown"), method)
                dots.append(add_markers(upper, remaining, ("order", "shown"), method, name, **unseen))
                bars.append(add_markers(lower, vanishing, ("order", "row"), method, name, **bar))
    for plot, renderers in ((upper, dots), (lower, bars)):
        add_hover(plot, renderers, [("", "$name"), ("order λ", "@order"), ("|κ|", "@shown{%.4e}")])
    limit = power_of_ten(round(log10(SATISFIED_BELOW)))
    return [
        Panel("A. Error terms that remain: line BAB, circles ABA", upper),
        Panel(f"B. Error terms that vanish, κ below {limit}: bar BAB, circles ABA", lower),
    ]


def _circle(plot: Model, source: Model, y: str, method: str, name: str) -> Model:
    """Draw circles around the marker of the method, which identifies it without colour."""
    add_markers(plot, source, ("order", y), method, size=5, line_width=1)
    circle = {"marker": "circle", "angle": 0.0, "size": 12, "fill_alpha": 0.0, "line_width": 1.1}
    return add_markers(plot, source, ("order", y), method, name, **circle)


def perihelion(cube: xr.Dataset) -> list[Panel]:
    """Draw |perihelion_advance| of ``cube``, over (precision, integrator, tau_per_stage), with its 95 % interval.

    Runs whose interval includes zero are crosses without a line. The dashed line is the advance of general relativity.
    """
    century = arcseconds_per_century(float(cube.attrs["orbital_period"]))
    runs, x, y = double_runs(cube), "per_orbit", "advance"
    told = abs(runs["perihelion_advance"].values)[np.isfinite(runs["perihelion_advance_interval"].values)]
    along = span([runs["evaluations_per_orbit"].values], logarithmic=True)
    up = span([told], logarithmic=True)
    plot = new_plot((along, up), ("force evaluations per orbit", "|perihelion advance| (rad per orbit)"))
    plot.extra_y_ranges = {"century": exactly(up.start * century, up.end * century, logarithmic=True)}
    plot.extra_y_scales = {"century": Model("LogScale")}
    plot.right = [_axis(plot.extra_y_ranges["century"], "arcseconds per century")]
    plot.right[0].y_range_name, plot.right[0].axis_label_standoff = "century", 10
    for says, *between in NO_ORDER:
        low, high = np.clip(between, up.start, up.end).tolist()
        if low < high:
            top = low > up.start
            at = {"x": along.end if top else along.start, "y": low, "x_offset": -8 if top else 8, "y_offset": 3}
            look = _NAME | at | {"text_align": "right" if top else "left", "text_baseline": "bottom"}
            band = Model("BoxAnnotation", **({"bottom": low} if top else {"top": high}), **_BAND)
            plot.center += [band, Model("Label", text=says, **look)]
    relativity = f"general relativity:\n{MERCURY_RELATIVISTIC_ADVANCE}″ per century"  # a phone has no room for one line
    add_level(plot, MERCURY_RELATIVISTIC_ADVANCE / century, relativity)
    dots: list[Model] = []
    for line, evaluations, size, interval, known, unknown in advances(cube, COLUMNS // 2):
        runs, method = line.runs, line.integrator
        columns: dict[str, Any] = {x: evaluations, y: size, "interval": interval, "arcseconds": size * century}
        columns["tau_per_stage"] = runs["tau_per_stage"].values
        source = source_of(**marked(columns | {y: np.where(known, size, np.nan)}, y, line))
        add_line(plot, source, (x, y), method, line_width=1.0)
        bars = {x: evaluations[known], "low": (size - interval)[known], "high": (size + interval)[known]}
        ends = Model("Segment", **fields(x0=x, x1=x, y0="low", y1="high"), line_color=style_of(method).colour)
        add(plot, source_of(**bars), ends, method)
        dot: dict[str, Any] = {"marker": "circle", "angle": 0.0, "size": 3.5, "fill_color": style_of(method).colour}
        add_markers(plot, source, (x, y), method, **dot, line_alpha=0.0, fill_alpha=1.0)
        add_markers(plot, source, (x, y), method)
        zero = source_of(**{name: values[unknown] for name, values in columns.items()})
        cross = {"marker": "x", "angle": 0.0, "size": 5, "line_alpha": 0.5}
        crosses = add_markers(plot, zero, (x, y), method, line.label, **cross)
        dots += [*add_hits(plot, source, (x, y), method, line.label), crosses]
    unit = _unit(cube["tau_per_stage"].attrs.get("units", "1"))
    rows = [
        ("", "$name"),
        ("evaluations per orbit", f"@{x}{{%.5g}}, τ/s = @tau_per_stage{{%.4g}}{unit}"),
        ("|advance|", f"@{y}{{%.3e}} ± @interval{{%.0e}} rad per orbit, @arcseconds{{%.4g}}″ per century"),
    ]
    add_hover(plot, dots, rows)
    return [Panel("", plot)]


def phase_space(paths: dict[str, xr.Dataset]) -> list[Panel]:
    """Draw each Dataset of :func:`~nearharmonic_paper.experiments.paper.orbits.substeps` in a panel.

    Panels of one system share their axes and the picture of the Hamiltonian.
    """
    shared: dict[str, tuple[Any, ...]] = {}
    drawn = []
    for letter, path in paths.items():
        system = path.attrs["system"]
        if system not in shared:
            ranges = tuple(exactly(*path[name].values[[0, -1]]) for name in ("q_grid", "p_grid"))
            shared[system] = (ranges, *_hamiltonian(path))
        ranges, bands, edges, heights, shades = shared[system]
        along = f" along {'xyz'[path.attrs['component']]}" if path.attrs["component"] else ""
        plot = new_plot(ranges, (f"q{along}", f"p{along}"), height=400)
        mapper = Model("LinearColorMapper", palette=shades, low=-0.5, high=len(shades) - 0.5)
        add(plot, bands, Model("Image", **fields(image="bands", x="x", y="y", dw="dw", dh="dh"), color_mapper=mapper))
        add_lines(plot, edges, line_color="#8795a5", line_width=0.6)
        scale = Model("LinearColorMapper", palette=shades, low=float(heights[0]), high=float(heights[-1]))
        ticks = Model("FixedTicker", ticks=heights[::2].tolist())
        plot.below.append(Model("ColorBar", color_mapper=scale, ticker=ticks, title="H", height=10, **_SCALE))
        _add_path(plot, path)
        title = f"{letter}. {path.attrs['label']}, {path.attrs['system_label']}"
        drawn.append(Panel(title, plot, " ".join(statement(path))))
    return drawn


def _hamiltonian(path: xr.Dataset) -> tuple[Any, Any, Any, list[str]]:
    """Return sources of the picture of the Hamiltonian (the band of each point, and its edges), levels, and shades."""
    q, p, H = (path[name].values for name in ("q_grid", "p_grid", "hamiltonian"))
    heights = levels(path)
    bands = np.searchsorted(heights[1:-1], H).astype(np.uint8)
    place = {"x": [q[0]], "y": [p[0]], "dw": [q[-1] - q[0]], "dh": [p[-1] - p[0]]}
    edges = lines_of([np.round(line, 4).T for level in heights[1:-1] for line in contours(path, level)])
    shades = [_SHADES[round(i)] for i in np.linspace(0, len(_SHADES) - 1, len(heights) - 1)]
    return Model("ColumnDataSource", data={"bands": [bands], **place}), edges, heights, shades


def _add_path(plot: Model, path: xr.Dataset) -> None:
    """Draw the path, its dots and ends, and the energy surface through its start, tagged with the method."""
    method, label = path.attrs["integrator"], path.attrs["label"]
    surface = lines_of([np.round(line, 4).T for line in contours(path, float(path["H"][0, 0]))])
    add_lines(plot, surface, method, line_color="#1f2d3d", line_width=1.3, line_dash=[5, 3])
    q, p, error = (path[name].values for name in ("q", "p", "energy_error"))
    add_lines(plot, lines_of([leg.T for leg in legs(path)]), method, line_color="#4d5661", line_width=1.0)
    for at, look in _ENDS.items():
        add_markers(plot, source_of(q=q[:, at], p=p[:, at]), ("q", "p"), method, angle=0.0, **look)
    signs = np.column_stack([path["next_drift_sign"].values, path["next_kick_sign"].values]) < 0
    hit = []
    for kind, (says, layers) in _DOTS.items():
        chosen = np.flatnonzero((path["kind"].values == "substep") & np.all(signs == kind, axis=1))
        dots = source_of(**{
            name: values[:, chosen].ravel() for name, values in (("q", q), ("p", p), ("error", abs(error)))
        })  # fmt: skip
        for layer in layers:
            look = {"marker": "circle", "angle": 0.0, "line_color": None, "line_width": 1.2} | layer
            renderer = add_markers(plot, dots, ("q", "p"), method, f"{label}: {says}", **look)
        hit.append(renderer)
    rows = [("method", "$name"), ("q, p", "@q{%.4f}, @p{%.4f}"), ("|ΔH/H₀|", "@error{%.2e}")]
    add_hover(plot, hit, rows)
    middle = {"text_align": "center", "text_baseline": "middle", "text_font": FONT, "text_color": "#404040"}
    for text, (x, y) in label_places(path).items():
        behind = {} if text.isdigit() else {"background_fill_color": "#ffffff"}
        glyph = Model("Text", **fields(x="q", y="p", text="text"), text_font_size="11px", **middle, **behind)
        add(plot, source_of(q=[x], p=[y], text=[text]), glyph, method if text.isdigit() else "")
