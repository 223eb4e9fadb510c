"""Markers of the methods: bokeh markers and SVG outlines for the matplotlib markers of the house style."""

from __future__ import annotations

from math import pi
from typing import NamedTuple


class Marker(NamedTuple):
    """Form of a marker of the house style on the page.

    Attributes
    ----------
    shape : str
        Name of bokeh's marker.
    angle : float
        Rotation in radians.
    outline : str
        SVG path within [-1, 1] x [-1, 1], for the legend.
    """

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
