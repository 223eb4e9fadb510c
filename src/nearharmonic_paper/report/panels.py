"""Panels of the interactive figures: axes, zoom, hover, and the lines and markers of the static figures.

Every renderer has the name of its method as a tag; the legend of the page uses it to show and hide the method. A page
holds the plots as a document of bokeh, and the script that shows them.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from math import pi
from pathlib import Path
from typing import Any, NamedTuple

import bokeh as library
import numpy as np
from bokeh import models as bokeh
from bokeh.core.serialization import Serializer
from bokeh.document import Document
from bokeh.models import ColumnDataSource as Source
from bokeh.models import GlyphRenderer as Renderer
from bokeh.models import Plot

from nearharmonic.plotting.profile import style_of

#: Width in pixels: a hover finds curves within half of it.
_REACH = 12
#: Columns of a curve of more points than a page can hold.
COLUMNS = 120
#: Number of markers on a curve, interleaved with those of other methods.
_MARKS = 14
#: In pixels.
_MARKER_SIZE = 7
#: Column of 1 for points with a marker and 0 for others.
MARKED = "marked"
FONT = "system-ui, sans-serif"
_LOGARITHMIC = "log"
#: Labels of axes and their ticks.
_AXIS = {
    "axis_label_text_font": FONT,
    "axis_label_text_font_style": "normal",
    "axis_label_text_font_size": "13px",
    "axis_label_text_color": "#222222",
    "major_label_text_font": FONT,
    "major_label_text_font_size": "12px",
    "major_label_text_color": "#333333",
}


class Marker(NamedTuple):
    """A marker of the house style: bokeh's name, rotation in radians, and SVG path within [-1, 1] for the legend."""

    shape: str
    angle: float
    outline: str


_HEXAGON = "M0-1L.87-.5V.5L0 1-.87 .5V-.5z"
_CIRCLE = "M-.9 0a.9.9 0 1 0 1.8 0a.9.9 0 1 0-1.8 0z"
_STAR = "M0-1L.25-.3H.95L.38.14.59.8 0 .4-.59.8-.38.14-.95-.3H-.25z"
_PLUS = "M-.35-1h.7v.65h.65v.7h-.65v.65h-.7v-.65h-.65v-.7h.65z"
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
    "*": Marker("star", 0.0, _STAR),
    "P": Marker("plus", 0.0, _PLUS),
    "X": Marker("plus", pi / 4, _CROSS),
}


class Panel(NamedTuple):
    """A panel of a figure: its title, which HTML wraps where it is long, its plot, and a text below the plot."""

    title: str
    plot: Plot
    note: str = ""


def span(values: Iterable[Any], logarithmic: bool, highest: float = np.inf) -> bokeh.Range1d:
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
    return exactly(float(low), float(min(high, highest)), logarithmic)


def exactly(low: float, high: float, logarithmic: bool = False) -> bokeh.Range1d:
    """Return a range of an axis from ``low`` to ``high``."""
    return bokeh.Range1d(start=low, end=high, tags=[_LOGARITHMIC] if logarithmic else [])


def new_plot(ranges: tuple[bokeh.Range1d, bokeh.Range1d], labels: tuple[str, str], height: int = 460) -> Plot:
    """Return an empty plot with these ranges (linear or logarithmic) and labels of x and y."""
    tools = [bokeh.BoxZoomTool(), bokeh.PanTool(), bokeh.WheelZoomTool(), bokeh.SaveTool(), bokeh.ResetTool()]
    axes = [_axis(one, label) for one, label in zip(ranges, labels, strict=True)]
    scales = [bokeh.LogScale() if _LOGARITHMIC in one.tags else bokeh.LinearScale() for one in ranges]
    return Plot(
        title=None,
        x_range=ranges[0],
        y_range=ranges[1],
        x_scale=scales[0],
        y_scale=scales[1],
        height=height,
        sizing_mode="stretch_width",
        output_backend="canvas",
        toolbar=bokeh.Toolbar(logo=None, tools=tools, active_drag=tools[0], active_scroll=None),
        min_border=4,
        min_border_right=14,
        outline_line_color="#444444",
        below=[axes[0]],
        left=[axes[1]],
        center=[bokeh.Grid(axis=axis, dimension=i, grid_line_color="#e3e3e3") for i, axis in enumerate(axes)],
    )


def _axis(one: bokeh.Range1d, label: str) -> bokeh.LinearAxis | bokeh.LogAxis:
    if _LOGARITHMIC in one.tags:
        ticks = {"ticker": bokeh.LogTicker(mantissas=[1, 5]), "formatter": bokeh.LogTickFormatter()}
        return bokeh.LogAxis(axis_label=label, major_label_policy=bokeh.NoOverlap(), **ticks, **_AXIS)
    return bokeh.LinearAxis(axis_label=label, ticker=bokeh.BasicTicker(mantissas=[1, 2, 5]), **_AXIS)


def use_categories(plot: Plot, labels: Sequence[str]) -> None:
    """Replace the y axis of ``plot`` by one of categories, from top to bottom."""
    plot.y_range, plot.y_scale = bokeh.FactorRange(factors=list(reversed(labels))), bokeh.CategoricalScale()
    plot.left = [bokeh.CategoricalAxis(**_AXIS)]
    plot.center[1].axis = plot.left[0]


def source_of(**columns: Any) -> Source:
    """Return a source of columns of equal length; numbers are exact doubles, or small integers."""
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    kept = {name: array if array.dtype.kind in "UO" or array.dtype == np.uint8 else array.astype(np.float64)
            for name, array in arrays.items()}  # fmt: skip
    return Source(data=kept)


def drawable(values: Any) -> np.ndarray:
    """Return ``values`` with NaN for values that a logarithmic axis cannot show."""
    numbers = np.array(values, dtype=float)
    numbers[~(np.isfinite(numbers) & (numbers > 0))] = np.nan
    return numbers


def marked(columns: Mapping[str, Any], at: tuple[str, str], turn: tuple[int, int]) -> dict[str, Any]:
    """Return ``columns`` with a mask of the points ``at`` (x and y) with a marker: one of every few points.

    ``turn`` is the index of the method and the number of methods.
    """
    there = np.flatnonzero(np.isfinite(columns[at[0]]) & np.isfinite(columns[at[1]]))
    step = max(1, there.size // _MARKS)
    chosen = np.zeros(len(columns[at[0]]), dtype=np.uint8)
    chosen[there[turn[0] * step // max(1, turn[1]) :: step]] = 1
    return {**columns, MARKED: chosen}


def add(plot: Plot, source: Source, glyph: bokeh.Glyph, method: str = "", name: str = "") -> Renderer:
    """Draw a glyph; return the renderer, with ``method`` as its tag and ``name`` as its name in a hover."""
    tags = [method] if method else []
    return plot.add_glyph(source, glyph, tags=tags, name=name or None)


def add_line(plot: Plot, source: Source, at: tuple[str, str], method: str, **changes: Any) -> Renderer:
    """Draw a line along the columns ``at``, x and y, in the colour of ``method``."""
    look = {"line_color": style_of(method).colour, "line_width": 1.4} | changes
    return add(plot, source, bokeh.Line(x=at[0], y=at[1], **look), method)


def add_markers(
    plot: Plot, source: Source, at: tuple[str, str], method: str, name: str = "", **changes: Any
) -> Renderer:
    """Draw the marker of ``method`` at the columns ``at``, x and y; only at marked points if the source has a mask."""
    style = style_of(method)
    marker = MARKERS[style.marker]
    seen = {f"{part}_alpha": MARKED for part in ("line", "fill") if MARKED in source.data}
    look = {
        "marker": marker.shape,
        "angle": marker.angle,
        "size": _MARKER_SIZE,
        "line_color": style.colour,
        "line_width": 1.3,
        "fill_color": style.colour if style.filled else "#ffffff",
    }
    return add(plot, source, bokeh.Scatter(x=at[0], y=at[1], **(look | seen | changes)), method, name)


def add_level(plot: Plot, level: float, text: str) -> None:
    """Add a horizontal line with its name at the right end."""
    plot.add_layout(bokeh.Span(location=level, dimension="width", line_color="#404040", line_dash=[6, 3]))
    at = {"x": plot.x_range.end, "y": level, "x_offset": -8, "y_offset": 4}
    look = {"text_align": "right", "text_font_size": "12px", "text_color": "#404040", "text_font": FONT}
    plot.add_layout(bokeh.Label(text=text, background_fill_color="#ffffff", **at, **look))


def add_hits(plot: Plot, source: Source, at: tuple[str, str], method: str, name: str) -> list[Renderer]:
    """Draw invisible glyphs at the points ``at``, x and y, for a hover; return the renderers.

    A broad invisible line gives the nearest point, while markers would give the first point within reach. Isolated
    points between gaps get invisible markers.
    """
    columns = source.data
    x, y = (np.asarray(columns[one], dtype=float) for one in at)
    there = np.pad(np.isfinite(x) & np.isfinite(y), 1)
    alone = there[1:-1] & ~there[:-2] & ~there[2:]
    unseen = {"line_alpha": 0.0, "line_width": _REACH}
    line = bokeh.Line(x=at[0], y=at[1], **unseen)
    found = [add(plot, source, line, method, name)]
    if alone.any():
        points = source_of(**{one: np.asarray(values)[alone] for one, values in columns.items() if one != MARKED})
        found.append(add_markers(plot, points, at, method, name, line_alpha=0.0, fill_alpha=0.0))
    return found


def add_hover(plot: Plot, renderers: Sequence[Renderer], rows: Sequence[tuple[str, str]]) -> None:
    """Show ``rows`` of (text, field) at points of ``renderers``; fields have bokeh's notation, with printf formats."""
    formatters = {f"@{name}": "printf" for _, field in rows for name in re.findall(r"@(\w+)\{%", field)}
    plot.add_tools(
        bokeh.HoverTool(
            renderers=list(renderers),
            tooltips=[list(row) for row in rows],
            formatters=formatters,
            sort_by=None,
            limit=1,
            line_policy="nearest",
            point_policy="snap_to_data",
            attachment="horizontal",
        )
    )


def script() -> str:
    """Return the installed script of bokeh: the core without extensions."""
    return Path(library.__file__).parent.joinpath("server/static/js/bokeh.min.js").read_text(encoding="utf-8")


def document(roots: Sequence[Plot]) -> str:
    """Return a document with the plots ``roots`` as JSON.

    Models are numbered in the order of writing, so that equal plots give equal texts.
    """
    # Document.add_root searches all plots again at each call, which would double the total time.
    told = Document(title="nearharmonic").to_json(deferred=False)
    told["roots"] = Serializer(deferred=False).serialize(list(roots)).content
    text = json.dumps(told, separators=(",", ":"), allow_nan=False)
    ids: dict[str, str] = {}
    return re.sub(r'"id":"(\w+)"', lambda found: f'"id":"{ids.setdefault(found[1], f"m{len(ids)}")}"', text)
