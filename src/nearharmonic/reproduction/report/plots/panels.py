"""Panels of the interactive figures: axes, zoom and hover, and the methods' lines and markers as in the static ones.

Every renderer of a method carries the method's name among its tags, which the legend of the page toggles it by.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from nearharmonic.plotting.palette import style_of
from nearharmonic.reproduction.report.plots.markers import MARKERS
from nearharmonic.reproduction.report.plots.models import Field, Model

Array = np.ndarray[Any, np.dtype[Any]]
#: In pixels: a hover finds the curve that passes within half of it.
_REACH = 12
#: Markers on a curve of a method, taking turns with those of the others.
_MARKS = 14
#: In pixels.
_MARKER_SIZE = 7
#: Column of 1 where a point carries its marker and 0 where not.
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


@dataclass(frozen=True, kw_only=True)
class Panel:
    """A panel of a figure.

    Attributes
    ----------
    title : str
        Its letter, if it has one, and what it shows.
    plot : Model
        The plot; its title stands in HTML, where a long one is wrapped.
    note : str
        What the panel states below the plot.
    """

    title: str
    plot: Model
    note: str = ""


def span(values: Iterable[Any], logarithmic: bool, highest: float = np.inf) -> Model:
    """Return a range of an axis, for one or more panels, that holds all numbers and a margin.

    Parameters
    ----------
    values : iterable of array
        What is drawn; NaN and infinities count for nothing, on a logarithmic axis neither do zeros and negatives.
    logarithmic : bool
        Whether the axis is.
    highest : float
        Where the range ends at the latest.
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


def exactly(low: float, high: float, logarithmic: bool = False) -> Model:
    """Return a range of an axis from ``low`` to ``high``."""
    return Model("Range1d", start=low, end=high, tags=[_LOGARITHMIC] if logarithmic else [])


def new_plot(ranges: tuple[Model, Model], labels: tuple[str, str], height: int = 460) -> Model:
    """Return an empty plot whose axes are logarithmic where their ranges, x and y, are, named by ``labels``."""
    tools = [Model(kind) for kind in ("BoxZoomTool", "PanTool", "WheelZoomTool", "SaveTool", "ResetTool")]
    axes = [_axis(one, label) for one, label in zip(ranges, labels, strict=True)]
    scales = [Model("LogScale" if _is_logarithmic(one) else "LinearScale") for one in ranges]
    return Model(
        "Plot",
        title=None,
        x_range=ranges[0],
        y_range=ranges[1],
        x_scale=scales[0],
        y_scale=scales[1],
        height=height,
        sizing_mode="stretch_width",
        output_backend="canvas",
        toolbar=Model("Toolbar", logo=None, tools=tools, active_drag=tools[0], active_scroll=None),
        min_border=4,
        min_border_right=14,
        outline_line_color="#444444",
        below=[axes[0]],
        left=[axes[1]],
        center=[Model("Grid", axis=axis, dimension=i, grid_line_color="#e3e3e3") for i, axis in enumerate(axes)],
        renderers=[],
    )


def _is_logarithmic(one: Model) -> bool:
    return _LOGARITHMIC in one["tags"]


def _axis(one: Model, label: str) -> Model:
    if _is_logarithmic(one):
        ticks = {"ticker": Model("LogTicker", mantissas=[1, 5]), "formatter": Model("LogTickFormatter", min_exponent=4)}
        return Model("LogAxis", axis_label=label, major_label_policy=Model("NoOverlap"), **ticks, **_AXIS)
    ticks = {"ticker": Model("BasicTicker", mantissas=[1, 2, 5]), "formatter": Model("BasicTickFormatter")}
    return Model("LinearAxis", axis_label=label, major_label_policy=Model("AllLabels"), **ticks, **_AXIS)


def category_axis(labels: Sequence[str]) -> tuple[Model, Model, Model]:
    """Return range, scale and axis of categories, from the top down."""
    ticks = {"ticker": Model("CategoricalTicker"), "formatter": Model("CategoricalTickFormatter")}
    axis = Model("CategoricalAxis", major_label_policy=Model("AllLabels"), **ticks, **_AXIS)
    return Model("FactorRange", factors=list(reversed(labels))), Model("CategoricalScale"), axis


def source_of(**columns: Any) -> Model:
    """Return a source of equally long columns; numbers are doubles with every bit, or small integers."""
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    kept = {name: array if array.dtype.kind in "UO" or array.dtype == np.uint8 else array.astype(np.float64)
            for name, array in arrays.items()}  # fmt: skip
    return source_as_is(kept)


def source_as_is(columns: Mapping[str, Any]) -> Model:
    """Return a source of ``columns``, arrays or lists of arrays."""
    nothing = Model("Selection", indices=[], line_indices=[])
    return Model("ColumnDataSource", selected=nothing, selection_policy=Model("UnionRenderers"), data=columns)


def drawable(values: Any) -> Array:
    """Return ``values`` with NaN where a logarithmic axis has no place for them."""
    numbers = np.array(values, dtype=float)
    numbers[~(np.isfinite(numbers) & (numbers > 0))] = np.nan
    return numbers


def marked(columns: Mapping[str, Any], at: tuple[str, str], turn: tuple[int, int]) -> dict[str, Any]:
    """Return ``columns`` and which of the points ``at``, x and y, carry a marker: every few of them.

    ``turn`` is the number of the method among how many.
    """
    there = np.flatnonzero(np.isfinite(columns[at[0]]) & np.isfinite(columns[at[1]]))
    step = max(1, there.size // _MARKS)
    chosen = np.zeros(len(columns[at[0]]), dtype=np.uint8)
    chosen[there[turn[0] * step // max(1, turn[1]) :: step]] = 1
    return {**columns, MARKED: chosen}


def add(plot: Model, source: Model, glyph: Model, method: str = "", name: str = "") -> Model:
    """Draw a glyph; return the renderer, tagged with its ``method``, which a hover calls ``name``."""
    tags = [method] if method else []
    everything = Model("CDSView", filter=Model("AllIndices"))
    renderer = Model("GlyphRenderer", data_source=source, glyph=glyph, view=everything, tags=tags, name=name or None)
    plot["renderers"].append(renderer)
    return renderer


def add_line(plot: Model, source: Model, at: tuple[str, str], method: str, **changes: Any) -> Model:
    """Draw a line along the columns ``at``, x and y, in the colour of ``method``."""
    look = {"line_color": style_of(method).colour, "line_width": 1.4} | changes
    return add(plot, source, Model("Line", x=Field(at[0]), y=Field(at[1]), **look), method)


def add_markers(plot: Model, source: Model, at: tuple[str, str], method: str, name: str = "", **changes: Any) -> Model:
    """Draw the marker of ``method`` at the columns ``at``, x and y, at points marked if the source says which."""
    style = style_of(method)
    marker = MARKERS[style.marker]
    seen = {f"{part}_alpha": Field(MARKED) for part in ("line", "fill") if MARKED in source["data"]}
    look = {
        "marker": marker.shape,
        "angle": marker.angle,
        "size": _MARKER_SIZE,
        "line_color": style.colour,
        "line_width": 1.3,
        "fill_color": style.colour if style.filled else "#ffffff",
    }
    return add(plot, source, Model("Scatter", x=Field(at[0]), y=Field(at[1]), **(look | seen | changes)), method, name)


def add_level(plot: Model, level: float, text: str) -> None:
    """Add a horizontal line with its name at the right end."""
    plot["center"].append(Model("Span", location=level, dimension="width", line_color="#404040", line_dash=[6, 3]))
    at = {"x": plot["x_range"]["end"], "y": level, "x_offset": -8, "y_offset": 4}
    look = {"text_align": "right", "text_font_size": "12px", "text_color": "#404040", "text_font": FONT}
    plot["center"].append(Model("Label", text=text, background_fill_color="#ffffff", **at, **look))


def add_hits(plot: Model, source: Model, at: tuple[str, str], method: str, name: str) -> list[Model]:
    """Draw what a hover finds the points ``at``, x and y, by; return the renderers.

    That is an unseen broad line, which gives the nearest of its points, where markers give the first within reach; and
    markers, unseen as well, where a point stands between gaps.
    """
    columns = source["data"]
    x, y = (np.asarray(columns[one], dtype=float) for one in at)
    there = np.pad(np.isfinite(x) & np.isfinite(y), 1)
    alone = there[1:-1] & ~there[:-2] & ~there[2:]
    unseen = {"line_alpha": 0.0, "line_width": _REACH}
    line = Model("Line", x=Field(at[0]), y=Field(at[1]), **unseen)
    found = [add(plot, source, line, method, name)]
    if alone.any():
        points = source_of(**{one: np.asarray(values)[alone] for one, values in columns.items() if one != MARKED})
        found.append(add_markers(plot, points, at, method, name, line_alpha=0.0, fill_alpha=0.0))
    return found


def add_hover(plot: Model, renderers: Sequence[Model], rows: Sequence[tuple[str, str]]) -> None:
    """Show ``rows`` of (text, field) at points of ``renderers``; fields in bokeh's notation, formats of printf."""
    formatters = {f"@{name}": "printf" for _, field in rows for name in re.findall(r"@(\w+)\{%", field)}
    plot["toolbar"]["tools"].append(
        Model(
            "HoverTool",
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
