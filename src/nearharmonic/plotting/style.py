"""Style of the figures, with readable axes and bitwise reproducible files, and the profile of energy errors."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from math import isfinite, log10
from pathlib import Path
from string import ascii_uppercase
from struct import pack
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import escape
from zlib import compress, crc32

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.font_manager import fontManager
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator

from nearharmonic.output.atomic import write_bytes
from nearharmonic.output.table import power_of_ten
from nearharmonic.plotting import profile
from nearharmonic.plotting.profile import UNITS, Line
from nearharmonic.plotting.recording import Recording

if TYPE_CHECKING:
    import xarray as xr

for _font in sorted(Path(__file__).with_name("fonts").glob("*.ttf")):
    fontManager.addfont(_font)

#: Settings of matplotlib for every figure. The fonts are files of this package: figures are the same on all machines.
SETTINGS: Any = {
    "font.family": ["DejaVu Figures", "DejaVu Sans"], "font.size": 9,
    "axes.labelsize": 9.5, "axes.linewidth": 0.7, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#d9d9d9", "grid.linewidth": 0.5,
    "xtick.direction": "in", "ytick.direction": "in", "xtick.top": True, "ytick.right": True,
    "lines.linewidth": 1.1, "lines.markersize": 5, "lines.markeredgewidth": 1.0,
    "legend.fontsize": 8.5, "legend.frameon": False,
    "text.hinting": "none",
    "mathtext.fontset": "custom", "mathtext.it": "DejaVu Figures:italic", "mathtext.bf": "DejaVu Figures:bold",
    **dict.fromkeys(("mathtext.rm", "mathtext.sf", "mathtext.tt", "mathtext.cal"), "DejaVu Figures"),
    "pdf.fonttype": 42,  # journals refuse fonts of type 3
    "svg.fonttype": "path", "svg.hashsalt": "nearharmonic",
}  # fmt: skip

#: Decorator that draws in the style of the figures and restores the matplotlib settings of the caller.
house_style = mpl.rc_context(SETTINGS)
#: Colour and marker of a method, for drawing code.
style_of = profile.style_of


class NotebookFigure(Figure):
    """A figure that a notebook displays without pyplot, which is slow to load."""

    def _repr_png_(self) -> bytes:
        return png(self, self.dpi)


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of ``width`` x ``height`` inches on an Agg canvas, without pyplot."""
    figure = NotebookFigure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


@house_style
def keep_inside(figure: Figure) -> None:
    """Move the frames of a figure inwards if labels of their axes would be cut at its left or right edge."""
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    boxes = [axis.get_tightbbox(renderer) for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    edges = [(box.x0 - 2, figure.bbox.width - 2 - box.x1) for box in boxes if box is not None]
    left, right = (min(0.0, *column) / figure.bbox.width for column in zip(*edges, strict=True))
    if left < 0 or right < 0:
        figure.subplots_adjust(left=figure.subplotpars.left - left, right=figure.subplotpars.right + right)


def panel_letter(axes: Axes, letter: str | int, says: str = "", y: float = 1.0) -> None:
    """Write a letter, or the letter of a number from 0, in bold at the upper left corner of ``axes``, and a title."""
    bold = letter if isinstance(letter, str) else ascii_uppercase[letter % len(ascii_uppercase)]
    axes.set_title(bold, x=0, ha="left", y=y, fontsize=9, pad=4, fontweight="bold")
    axes.set_title(says, loc="left", x=13 / 72 * axes.figure.dpi / axes.bbox.width, y=y, fontsize=9, pad=4)


def right_title(axes: Axes, says: str) -> None:
    """Write the system and the interval above the upper right corner of ``axes``, as high as the panel's letter."""
    axes.set_title(says, loc="right", y=axes.title.get_position()[1], fontsize=9, pad=4)


def lettered(number: int, says: str) -> str:
    """Return the letter of a number from 0, in bold, and a title behind it, as one text."""
    return rf"$\mathbf{{{ascii_uppercase[number % len(ascii_uppercase)]}}}$  {says}"


def write_beside(axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], **look: Any) -> None:
    """Write ``text`` beside a place, at an offset in points; ``look`` are arguments of ``Axes.annotate``."""
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **{"color": "#404040", "fontsize": 8, **look})


def log_scale(axes: Axes, directions: str) -> None:
    """Make the x and/or y axis logarithmic: powers of ten are labelled if there is space, with ticks between them.

    Numbers that are not positive leave gaps; by default, matplotlib would draw a line to the lower edge and back. An
    axis without positive numbers gets a range too, so that the figure is visibly empty.
    """
    for direction in directions:
        if not isfinite(getattr(axes.dataLim, f"minpos{direction}")):
            axes.set(**{f"{direction}lim": (1e-16, 1)})
        getattr(axes, f"set_{direction}scale")("log", nonpositive="mask")
        log_ticks(getattr(axes, f"{direction}axis"))


def log_ticks(axis: Axis) -> None:
    """Label powers of ten if there is space, on a logarithmic axis, and 2 and 5 between them on a short one."""
    axis.set_major_locator(LogLocator(base=10, numticks=15))
    least, most = axis.get_view_interval()
    axis.set_minor_locator(LogLocator(base=10, subs=(2, 5) if 0 < 100 * least < most else "auto", numticks=10))
    # Few ticks, as each is five artists; and plain text, as formulas are parsed anew for each file.
    axis.set_major_formatter(FuncFormatter(lambda value, _: power_of_ten(round(log10(value)))))
    # An axis of less than two decades may have no power of ten, or a single one.
    axis.set_minor_formatter(FuncFormatter(lambda value, _: _two_or_five(value, axis)))


def _two_or_five(value: float, axis: Axis) -> str:
    """Return the label of a minor tick: 2 and 5 times a power of ten on a short axis, nothing else."""
    least, most = axis.get_view_interval()
    if not 0 < least < most < least * 100:
        return ""
    digit, power = f"{value:.0e}".split("e")
    exact = abs(float(f"{value:.0e}") / value - 1) < 1e-9  # on a short axis ticks lie between the digits
    return f"{digit}×{power_of_ten(int(power))}" if exact and digit in "25" else ""


def mark_every(position: int, methods: int, values: Any, marks: int = 12) -> list[int]:
    """Return the indices of the points with a marker: about ``marks``, alternating between methods, and lone points."""
    step = max(1, len(values) // marks)
    turns = range(position * step // max(1, methods), len(values), step)
    return sorted({*turns, *np.flatnonzero(profile.lone(np.asarray(values))).tolist()})


def with_lone_points(look: dict[str, Any], values: Any) -> dict[str, Any]:
    """Return the look of a curve: one without markers gets dots at the points that no line leads to."""
    lone = np.flatnonzero(profile.lone(values)).tolist()
    return look | {"marker": ".", "markevery": lone} if lone and look["marker"] == "none" else look


def method_handles(integrators: Iterable[str], labels: Iterable[str], **changes: Any) -> list[Line2D]:
    """Return legend entries, one per method, with label, line and marker."""
    named = zip(integrators, labels, strict=True)
    return [Line2D([], [], label=label, **style_of(name).line(**changes)) for name, label in named]


def label_ends(axes: Axes, curves: Iterable[Line2D], *, left: bool = False, size: float = 7.5) -> list[Text]:
    """Write the label of each curve beside its right or left end, in its colour a quarter darker; return the labels.

    Labels of ``size`` points keep the order of the ends and move apart as little as possible, each with a line to its
    end. The limits and the size of ``axes`` must be final.
    """
    low, high = axes.get_xlim()
    ends: list[tuple[float, float, Line2D]] = []
    for curve in curves:
        points = np.asarray(curve.get_xydata(), dtype=float)
        points = points[np.isfinite(points[:, 1]) & (low <= points[:, 0]) & (points[:, 0] <= high)]
        ends += [(*axes.transData.transform(points[0 if left else -1]), curve)] if len(points) else []
    ends.sort(key=lambda end: float(end[1]))
    point, side = axes.figure.dpi / 72, "right" if left else "left"
    rows = profile.spread(np.array([height for _, height, _ in ends]), 1.25 * size * point)
    labels, leaders = [], []
    for (x, y, curve), row in zip(ends, rows, strict=True):
        ways = [(x + far * point * (-1 if left else 1), height) for far, height in ((2, y), (10, row), (12, row))]
        *leader, (beside, middle) = axes.transData.inverted().transform(ways)
        says, colour = str(curve.get_label()), profile.darker(to_hex(curve.get_color()))
        labels.append(axes.text(beside, middle, says, ha=side, va="center", fontsize=size, color=colour))
        leaders.append(leader)
    joined = LineCollection(leaders, colors=[one.get_color() for one in labels], linewidths=0.5)
    axes.add_collection(joined, autolim=False)
    return labels


@house_style
def save(figure: Figure, places: Sequence[str | os.PathLike[str]], *, transparent: bool = False) -> list[Path]:
    """Write ``figure`` to each of ``places``, in the format of its ending: .pdf, .svg or .png (300 dpi).

    Each file is written atomically. Equal figures give bitwise identical files: the metadata have no date, and ids of
    elements have a fixed salt. Text in an SVG file is outlines. The first line of the label of the figure is its title,
    and the rest its description. If ``transparent``, SVG files have no background. The paths are returned.
    """
    title, _, caption = str(figure.get_label()).partition("\n")
    try:
        drawn: Figure = Recording(figure)
    except NotImplementedError:  # an image has other pixels in each format
        drawn = figure
    paths = [Path(place) for place in places]
    for path in paths:
        suffix = path.suffix.removeprefix(".")
        if suffix == "png":
            write_bytes(path, png(drawn, 300, title))
            continue
        content, is_svg = BytesIO(), suffix == "svg"  # on a full disk, matplotlib's PDF writer raises its own error
        (figure if transparent and is_svg else drawn).savefig(
            content, format=suffix, dpi=300, transparent=transparent and is_svg,
            metadata={"Date" if is_svg else "CreationDate": None} | ({"Title": title} if title else {}),
        )  # fmt: skip
        described = f"</title>\n <desc>{escape(caption or title)}</desc>".encode()
        written = content.getvalue()
        write_bytes(path, written.replace(b"</title>", described, 1) if is_svg else written)
    return paths


@house_style
def png(figure: Figure, dpi: float, title: str = "") -> bytes:
    """Return the picture as a PNG file without filters of rows.

    Pillow, which matplotlib uses, takes three times as long, for larger files: its filters are made for photographs.
    """
    canvas, own = FigureCanvasAgg(figure), figure.dpi
    figure.set_dpi(dpi)
    canvas.draw()  # type: ignore[no-untyped-call]
    figure.set_dpi(own)
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]  # type: ignore[no-untyped-call]
    height, width, _ = pixels.shape
    rows = np.pad(pixels.reshape(height, -1), ((0, 0), (1, 0)))  # each row begins with its filter, 0 for none
    chunks = [
        (b"IHDR", pack(">2I5B", width, height, 8, 2, 0, 0, 0)),  # three colours of 8 bits
        (b"pHYs", pack(">2IB", *[round(dpi / 0.0254)] * 2, 1)),
        (b"iTXt", b"Title" + bytes(5) + title.encode()),
        (b"IDAT", compress(rows.tobytes(), 3)),
        (b"IEND", b""),
    ]
    parts = (pack(">I", len(data)) + kind + data + pack(">I", crc32(kind + data)) for kind, data in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


# --- Benchmark profile, as in Figures 1, 3 and 5: relative energy errors against tau/s --------------------------------

#: Dashes of a curve in extended precision.
DASHED: dict[str, Any] = {"linestyle": (0, (4, 5)), "marker": "none", "linewidth": 0.9, "zorder": 2}
#: Place of a legend above the panels.
LEGEND: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.545, 0.995), "ncols": 4, "columnspacing": 1.8}
#: Rows for which there is space, enough for ten methods, and height of a row relative to the height of the figure.
LEGEND_ROWS, LEGEND_ROW = 3, 0.0195
#: Height of a row of the strip of diverged runs, largest height of the strip, and gap between panels, in inches.
STRIP_ROW, STRIP, GAP = 0.03, 0.42, 0.365


@house_style
def draw_profile(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (top) and ``mean_energy_error`` (bottom) of every method of ``cube``.

    ``cube`` has dimensions (integrator, tau_per_stage), optionally after ``precision`` with "double" (solid, marked)
    and "extended" (dashed). NaN (not computed) and zeros leave gaps; diverged runs are in a strip above the panel.
    """
    curves = profile.lines(cube)
    handles = method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    if any(line.extended for line in curves):
        handles.append(Line2D([], [], color="#404040", linestyle=DASHED["linestyle"], label="extended precision"))
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    looks = [DASHED | {"linestyle": line.dashes()} if line.extended else {} for line in curves]
    drawn = draw_profiles(curves, looks, handles, unit, [cube])
    right_title(drawn.axes[0], profile.problem_of(cube, unit))
    return drawn


@house_style
def draw_profiles(
    curves: Sequence[Line], looks: Sequence[Mapping[str, Any]], handles: Sequence[Line2D], unit: str,
    given: Sequence[xr.Dataset],
) -> Figure:  # fmt: skip
    """Draw the maximum (top) and the mean (bottom) energy errors of methods against the step size per stage.

    ``looks`` are changes of the style of each curve, ``handles`` the entries of the legend. Of the Datasets ``given``
    the first has the attributes of the errors, and any may have a floor.
    """
    attributes, height = given[0]["max_energy_error"].attrs, 8.2
    drawn = new_figure(7, height)
    spare = LEGEND_ROW * max(0, LEGEND_ROWS - -(-len(handles) // LEGEND["ncols"]))
    strips = {variable: profile.beyond(curves, variable) for variable in profile.PANELS}
    strip = min(STRIP, STRIP_ROW * max(len(rows) for rows, _ in strips.values())) / height
    top, bottom, gap = 0.885 + spare - strip, 0.062, GAP / height + strip
    frame = (top - bottom - gap) / len(profile.PANELS)
    drawn.subplots_adjust(left=0.105, right=0.985, top=top, bottom=bottom, hspace=gap / frame)
    panels = dict(zip(profile.PANELS, drawn.subplots(len(profile.PANELS), 1, sharex=True, sharey=True), strict=True))
    styles = [style_of(line.integrator).line(**{"zorder": 3, **look}) for line, look in zip(curves, looks, strict=True)]
    for number, (variable, statistic) in enumerate(profile.PANELS.items()):
        axes = panels[variable]
        for line, style in zip(curves, styles, strict=True):
            errors = line.runs[variable].values
            look = {"markevery": mark_every(*line.turn, errors)} | with_lone_points(style, errors)
            axes.plot(line.runs["tau_per_stage"].values, errors, **look)
        if strips[variable][0]:
            above = axes.inset_axes((0, 1, 1, strip / frame), sharex=axes)
            _draw_strip(above, *strips[variable], [style["color"] for style in styles])
        axes.set_ylabel(error_label(attributes, r"\max\," if statistic == "maximum" else rf"\mathrm{{{statistic}}}\,"))
        panel_letter(axes, number, f"{statistic} {profile.range_of(attributes)}", 1 + strip / frame)
    upper, *_, lower = panels.values()
    upper.margins(x=0.02, y=0.03)
    log_scale(upper, "xy")
    if upper.get_ylim()[1] > profile.LARGEST_ERROR:
        upper.set_ylim(top=profile.LARGEST_ERROR)
    for variable, axes in panels.items():
        if say_if_empty(axes, [line.runs[variable].values for line in curves]):
            taus = np.concatenate([line.runs["tau_per_stage"].values for line in curves])
            axes.set_xlim(taus.min() / 2, taus.max() * 2)
        else:
            _slope_guide(axes)
            draw_floor(axes, given, variable)
    lower.set_xlabel(step_label(unit))
    drawn.legend(handles=handles, **LEGEND)
    return drawn


def _draw_strip(axes: Axes, rows: Sequence[Any], name: str, colours: Sequence[str]) -> None:
    """Draw the rows of ``profile.beyond``, a square for each run; ``colours`` are the colours of all curves."""
    look: Any = {"linestyle": "none", "marker": "s", "markersize": 1.9, "markeredgewidth": 0}
    for row, (curve, runs) in enumerate(rows):
        taus = runs["tau_per_stage"].values
        axes.plot(taus, np.full(taus.size, row), color=colours[curve], **look)
    axes.margins(x=0.02)
    axes.set(ylim=(len(rows) - 0.2, -0.8), yticks=[], facecolor="#f6f6f6")
    axes.xaxis.set_visible(False)
    axes.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=7.5, labelpad=3, linespacing=0.95)


def step_label(unit: str) -> str:
    """Return the label of an axis of step sizes per stage, with its unit in words."""
    in_words = "" if unit == "1" else f", {UNITS.get(unit, unit)}"
    return rf"step size per stage, $\tau/s$ ($s$ stages){in_words}"


def error_label(attributes: Mapping[str, str], statistic: str = "") -> str:
    """Return the label of an axis of energy errors with these attributes, in the notation of matplotlib."""
    return profile.energy_error_label(attributes, rf"${statistic}|\Delta H|$", rf"${statistic}|\Delta H/H_0|$")


def say_if_empty(axes: Axes, errors: Iterable[Any]) -> bool:
    """Write the reason into the middle of ``axes`` if no error can be drawn; return True in that case."""
    values = np.concatenate([np.ravel(one) for one in errors])
    if np.any(np.isfinite(values) & (values > 0)):
        return False
    text = "every energy error is 0" if np.any(values == 0) else "no energy errors"
    text = "every run diverged: it left its energy surface" if np.isinf(values).any() else text
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#595959")
    return True


def draw_floor(axes: Axes, given: Sequence[xr.Dataset], variable: str) -> None:
    """Draw :func:`nearharmonic.plotting.profile.floor_near`, unless it is 0, on axes with logarithmic energy errors."""
    if floor := profile.floor_near(given, variable):
        axes.axhline(floor, color="#595959", linewidth=0.7, linestyle=(0, (1, 1.5)), zorder=1.5)
        look = {"color": "#595959", "ha": "right", "xycoords": axes.get_yaxis_transform()}
        write_beside(axes, profile.floor_name(floor), (0.99, floor), (0, 2), **look)


def _slope_guide(axes: Axes) -> None:
    """Draw two short lines of slope 4 and 6 in the empty lower right corner, for comparison with curves."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    length = min(4.0, (right / left) ** 0.14)
    start_x, start_y = right * (left / right) ** 0.32, low * (high / low) ** 0.09
    for order in (4, 6):
        x, y = start_x * length, start_y * length**order
        axes.plot([start_x, x], [start_y, y], color="#8a8a8a", linewidth=1.0, scalex=False, scaley=False, zorder=1.5)
        write_beside(axes, f"order {order}", (x, y), (3, 0), color="#595959", va="center")
