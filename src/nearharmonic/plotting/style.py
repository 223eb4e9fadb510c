"""Style of the figures: one style per method, readable axes, and bitwise reproducible files."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from io import BytesIO
from math import isfinite
from pathlib import Path
from string import ascii_uppercase
from typing import Any
from xml.sax.saxutils import escape

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator

from nearharmonic.output.atomic import write_bytes
from nearharmonic.plotting.palette import Style, style_of

__all__ = [
    "SETTINGS", "Style", "house_style", "keep_inside", "lettered", "log_scale", "log_ticks", "mark_every",
    "method_handles", "new_figure", "panel_letter", "right_title", "save", "style_of", "write_beside",
]  # fmt: skip

#: matplotlib settings of every figure: the fonts that matplotlib ships, so that figures are identical on all machines.
SETTINGS: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.labelsize": 9.5,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#d9d9d9",
    "grid.linewidth": 0.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "lines.linewidth": 1.1,
    "lines.markersize": 5,
    "lines.markeredgewidth": 1.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "nearharmonic",
}

#: Metadata of files, without a timestamp.
_METADATA: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}


#: Decorator that draws in the style of the figures and restores the matplotlib settings of the caller.
house_style = mpl.rc_context(SETTINGS)


class NotebookFigure(Figure):
    """A figure that a notebook displays without pyplot, which is slow to load."""

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        with mpl.rc_context(SETTINGS):
            FigureCanvasAgg(self).print_png(picture)  # type: ignore[no-untyped-call]
        return picture.getvalue()


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


def panel_letter(axes: Axes, letter: str | int, says: str = "") -> None:
    """Write a letter, or that of a number from 0, in bold above the upper left corner of ``axes``, and a title."""
    axes.set_title(lettered(letter, says), loc="left", y=1.0, fontsize=9, pad=4)


def right_title(axes: Axes, says: str) -> None:
    """Write the system and the interval above the upper right corner of ``axes``."""
    axes.set_title(says, loc="right", y=1.0, fontsize=9, pad=4)


def lettered(letter: str | int, says: str = "") -> str:
    """Return a letter, or that of a number from 0, in bold, and a title behind it."""
    if isinstance(letter, int):
        letter = ascii_uppercase[letter % len(ascii_uppercase)]
    return rf"$\mathbf{{{letter}}}$  {says}".rstrip()


def write_beside(axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], **look: Any) -> None:
    """Write ``text`` beside a place, at an offset in points; ``look`` are arguments of ``Axes.annotate``."""
    look = {"color": "#404040", "fontsize": 8, **look}
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **look)


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
    """Label powers of ten if there is space, on a logarithmic axis, and ticks between them on a short one."""
    axis.set_major_locator(LogLocator(base=10, numticks=15))
    axis.set_minor_locator(LogLocator(base=10, subs="auto", numticks=40))
    # An axis of less than two decades may have no power of ten, or a single one.
    axis.set_minor_formatter(FuncFormatter(lambda value, _: _two_or_five(value, axis)))


def _two_or_five(value: float, axis: Axis) -> str:
    """Return the label of a minor tick: 2 and 5 times a power of ten on a short axis, nothing else."""
    least, most = axis.get_view_interval()
    digit, power = f"{value:.0e}".split("e")
    exact = abs(float(f"{value:.0e}") / value - 1) < 1e-9  # on a short axis ticks lie between the digits
    if not (exact and 0 < least < most < least * 100 and digit in "25"):
        return ""
    return rf"${digit}\times10^{{{int(power)}}}$"


def mark_every(position: int, methods: int, points: int, marks: int = 12) -> tuple[int, int]:
    """Return (first, step) of the points with a marker: about ``marks`` per curve, alternating between methods."""
    step = max(1, points // marks)
    return position * step // max(1, methods), step


def method_handles(integrators: Iterable[str], labels: Iterable[str], **changes: Any) -> list[Line2D]:
    """Return legend entries, one per method, with label, line and marker."""
    return [
        Line2D([], [], label=label, **style_of(name).line(**changes))
        for name, label in zip(integrators, labels, strict=True)
    ]


def _described(svg: bytes, description: str) -> bytes:
    """Return an SVG file with a description behind its title."""
    return svg.replace(b"</title>", f"</title>\n <desc>{escape(description)}</desc>".encode(), 1)


def save(figure: Figure, places: Sequence[str | os.PathLike[str]], *, transparent: bool = False) -> list[Path]:
    """Write ``figure`` to each of ``places``, in the format of its ending: .pdf, .svg or .png (200 dpi).

    Each file is written atomically. Equal figures give bitwise identical files: the metadata have no date, and ids of
    elements have a fixed salt. Text in an SVG file is text; the label of the figure is its description, and what stands
    before the first colon its title. If ``transparent``, SVG files have no background. The paths are returned.
    """
    description = str(figure.get_label())
    title = description.partition(":")[0]
    paths = [Path(place) for place in places]
    for path in paths:
        suffix = path.suffix.removeprefix(".")
        content = BytesIO()  # on a full disk, matplotlib's PDF writer raises an error of its own
        with mpl.rc_context(SETTINGS):
            figure.savefig(
                content, format=suffix, dpi=200, metadata={**_METADATA[suffix], **({"Title": title} if title else {})},
                transparent=transparent and suffix == "svg",
            )  # fmt: skip
        write_bytes(path, _described(content.getvalue(), description) if suffix == "svg" else content.getvalue())
    return paths
