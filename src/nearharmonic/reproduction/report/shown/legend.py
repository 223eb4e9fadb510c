"""The legend of the page: one entry for each method, with the colour and the marker of the static figures."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from nearharmonic.plotting.palette import style_of
from nearharmonic.reproduction.report.plots.markers import MARKERS
from nearharmonic.reproduction.report.shown.figures import ShownFigure


class Entry(NamedTuple):
    """A method in the legend: name, label, and marker as an SVG path with colours."""

    method: str
    label: str
    outline: str
    colour: str
    fill: str


def entries(figures: Iterable[ShownFigure]) -> list[Entry]:
    """Return an entry for each method that a figure draws, in the order of the figure with the most methods."""
    drawn = sorted(figures, key=lambda figure: -len(figure.methods))
    methods = {method: label for figure in reversed(drawn) for method, label in figure.methods.items()}
    ordered = dict.fromkeys(method for figure in drawn for method in figure.methods)
    return [_entry(method, methods[method]) for method in ordered]


def _entry(method: str, label: str) -> Entry:
    style = style_of(method)
    fill = style.colour if style.filled else "#ffffff"
    return Entry(method, label, MARKERS[style.marker].outline, style.colour, fill)
