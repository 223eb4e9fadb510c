"""House style of the figures: one look per method, axes that print, files with the same bytes every time."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from io import BytesIO
from math import isfinite
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from nearharmonic.output.atomic import replacing
from nearharmonic.plotting.palette import Style, style_of

__all__ = [
    "SETTINGS", "Style", "house_style", "log_scale", "log_ticks", "mark_every", "method_handles", "new_figure",
    "panel_letter", "save", "style_of",
]  # fmt: skip

#: matplotlib settings of every figure: the fonts that matplotlib ships, so that all machines draw alike.
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
    "svg.hashsalt": "nearharmonic",
}

#: What a file says about its making must not hold the clock.
_METADATA: dict[str, dict[str, Any]] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}, "png": {}}


#: Decorator: draw in the house style and leave the caller's matplotlib settings as they were.
house_style = mpl.rc_context(SETTINGS)


class NotebookFigure(Figure):
    """A figure that a notebook shows without pyplot, which is slow to load."""

    def _repr_png_(self) -> bytes:
        picture = BytesIO()
        with mpl.rc_context(SETTINGS):
            FigureCanvasAgg(self).print_png(picture)  # type: ignore[no-untyped-call]
        return picture.getvalue()


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of ``width`` x ``height`` inches on an Agg canvas; pyplot is not needed."""
    figure = NotebookFigure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def panel_letter(axes: Axes, letter: str, says: str = "") -> None:
    """Write ``letter`` in bold, and what the panel shows, above the upper left corner of ``axes``."""
    axes.set_title(rf"$\mathbf{{{letter}}}$  {says}".rstrip(), loc="left", y=1.0, fontsize=9, pad=4)


def log_scale(axes: Axes, directions: str) -> None:
    """Make the x and/or y axis logarithmic: powers of ten labelled as far as they fit, ticks between them.

    Numbers that are not positive leave gaps: by default, matplotlib would draw a line to the lower edge and back. An
    axis on which nothing positive was drawn still gets a range, so that an empty figure can be seen to be empty.
    """
    for direction in directions:
        if not isfinite(getattr(axes.dataLim, f"minpos{direction}")):
            axes.set(**{f"{direction}lim": (1e-16, 1)})
        getattr(axes, f"set_{direction}scale")("log", nonpositive="mask")
        log_ticks(getattr(axes, f"{direction}axis"))


def log_ticks(axis: Axis) -> None:
    """Label powers of ten as far as they fit, and tick between them, on an axis that is logarithmic already."""
    axis.set_major_locator(LogLocator(base=10, numticks=15))
    axis.set_minor_locator(LogLocator(base=10, subs="auto", numticks=40))
    axis.set_minor_formatter(NullFormatter())


def mark_every(position: int, methods: int, points: int, marks: int = 12) -> tuple[int, int]:
    """(first, step) of the points that carry a marker: about ``marks`` per curve, methods taking turns."""
    step = max(1, points // marks)
    return position * step // max(1, methods), step


def method_handles(integrators: Iterable[str], labels: Iterable[str], **changes: Any) -> list[Line2D]:
    """Legend entries, one per method: its label beside its line and marker."""
    return [
        Line2D([], [], label=label, **style_of(name).line(**changes))
        for name, label in zip(integrators, labels, strict=True)
    ]


def save(figure: Figure, places: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Write ``figure`` to each of ``places``, in the format of its ending: .pdf, .svg or .png (200 dpi).

    Each file is moved into place when it is complete. The same figure gives the same bytes: no date in the metadata,
    element ids from a fixed salt.

    Returns
    -------
    list of Path
        The files, in the order of ``places``.
    """
    paths = [Path(place) for place in places]
    for path in paths:
        suffix = path.suffix.removeprefix(".")
        with replacing(path) as part, mpl.rc_context(SETTINGS):
            figure.savefig(part, format=suffix, dpi=200, metadata=_METADATA[suffix])
    return paths
