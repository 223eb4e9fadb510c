"""House style of the figures: one colour and marker per method, axes that print, files with the same bytes every time.

A method is told apart twice: by colour, and by marker with its filling for grey print and colour-blind readers. Filled
markers are the methods of Nielsen (2015), hollow ones those it compares with. Line dashes are left free for each
figure's own distinction (extended precision, composition).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any
from zlib import crc32

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullFormatter

from nearharmonic.output.atomic import replacing

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


@dataclass(frozen=True)
class Style:
    """How one method is drawn in all figures."""

    colour: str
    marker: str
    filled: bool = False

    def line(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for a curve of this method, some of them changed."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face} | changes

    def points(self, **changes: Any) -> dict[str, Any]:
        """Keywords of ``Axes.plot`` for markers without a line."""
        return self.line(linestyle="none") | changes


# Chosen by search: at least 3:1 contrast with white, and 13 CIELAB units between any two colours as a reader with
# deuteranopia, protanopia or tritanopia sees them (Machado et al. 2009, doi:10.1109/TVCG.2009.113).
_STYLES = {
    "ruth": Style("#6b6b6b", "o"),
    "s5odr4": Style("#806515", "s"),
    "aba104": Style("#00a070", "^"),
    "aba864": Style("#4a90e2", "D"),
    "aba1064": Style("#8e3fb5", "v"),
    "yoshida_s7o6a": Style("#e0569b", "p"),
    "abas5o6h": Style("#e86a10", "o", filled=True),
    "babs7o7h": Style("#0b3c8c", "s", filled=True),
    "babps8o7h": Style("#8b0000", "^", filled=True),
    "babps9o7h": Style("#000000", "D", filled=True),
    # The rest of Nielsen's Table 4, which the paper's figures leave out.
    "abas5o6h_b": Style("#8a4b08", "P", filled=True),
    "abas5o6h_c": Style("#c1440e", "X", filled=True),
    "babs6o7h": Style("#2b5fa5", "P", filled=True),
    "babs6o5h": Style("#14746f", "X", filled=True),
    "babps6o5h": Style("#9d174d", "P", filled=True),
    "babps7o6h": Style("#5b21b6", "X", filled=True),
    # Methods that the paper left out: a colour for each source, a marker for each method.
    "leapfrog": Style("#707070", "<"),
    "blanes_moan_s6o4": Style("#3a3a9c", "<"),
    "srkn_b6": Style("#3a3a9c", ">"),
    "srkn_b11": Style("#3a3a9c", "h"),
    "srkn_a14": Style("#3a3a9c", "*"),
    "mclachlan_s4": Style("#1f7a7a", "<"),
    "mclachlan_s5": Style("#1f7a7a", ">"),
    "mclachlan_sb3a4": Style("#1f7a7a", "h"),
    "mclachlan_sb3a5": Style("#1f7a7a", "*"),
    "mclachlan_ss5": Style("#1f7a7a", "8"),
    "pefrl": Style("#a0408f", "<"),
    "vefrl": Style("#a0408f", ">"),
    "efrl": Style("#a0408f", "h"),
    "omelyan_p5": Style("#a0408f", "*"),
    "omelyan_v5": Style("#a0408f", "8"),
    "s9odr6a": Style("#2e6e2e", "<"),
    "s15odr8": Style("#2e6e2e", ">"),
}

_SPARE_COLOURS = ("#2a8f80", "#8a8a2e", "#332288", "#aa4499", "#cc6677", "#117733", "#5d5d5d")
_SPARE_MARKERS = ("<", ">", "*", "h", "d", "8")


def style_of(integrator: str) -> Style:
    """The style of a method by its id; one that the table does not hold gets its own from a hash of the id."""
    if integrator in _STYLES:
        return _STYLES[integrator]
    rest, colour = divmod(crc32(integrator.encode()), len(_SPARE_COLOURS))
    rest, marker = divmod(rest, len(_SPARE_MARKERS))
    return Style(_SPARE_COLOURS[colour], _SPARE_MARKERS[marker], filled=rest % 2 == 1)


#: Decorator: draw in the house style and leave the caller's matplotlib settings as they were.
house_style = mpl.rc_context(SETTINGS)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of ``width`` x ``height`` inches on an Agg canvas; pyplot, slow to load, is not needed."""
    figure = Figure(figsize=(width, height))
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
