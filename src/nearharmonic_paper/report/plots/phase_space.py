"""Substeps in phase space and the Hamiltonian around them, as in Figure 6."""

from __future__ import annotations

from math import isfinite, pi
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import ColumnDataSource as Source
from bokeh.models import Plot
from contourpy import contour_generator

from nearharmonic_paper.claims.results import short
from nearharmonic_paper.report.plots import panels
from nearharmonic_paper.report.plots.panels import Panel

if TYPE_CHECKING:
    import xarray as xr

#: Shades of the Hamiltonian, from low to high.
_SHADES = (
    "#ffffff", "#f9fafb", "#f3f4f6", "#edeff2", "#e6e9ed", "#e0e4e9",
    "#dadfe4", "#d4d9e0", "#ced4db", "#c8ced7", "#c2c9d3", "#b9c3cf",
)  # fmt: skip
_BLUE, _RED, _GREEN = "#0b5fb5", "#d7301f", "#1a9850"
#: A bar across a dot, white.
_BAR = {"marker": "dash", "size": 7, "line_color": "#ffffff", "line_width": 2}
#: (next drift negative, next kick negative) -> meaning, and markers drawn over each other.
_DOTS: dict[tuple[bool, bool], tuple[str, tuple[dict[str, Any], ...]]] = {
    (False, False): ("no negative coefficient follows", ({"size": 7, "fill_color": _BLUE},)),
    (True, False): ("a negative drift follows", ({"size": 11, "fill_color": _RED}, _BAR)),
    (False, True): ("a negative kick follows", ({"size": 10, "fill_color": _GREEN}, _BAR | {"angle": pi / 2})),
    (True, True): (
        "negative drift and kick follow",
        ({"size": 12, "fill_color": _RED}, {"size": 7, "fill_color": _GREEN, "line_color": "#ffffff"}),
    ),
}
_ENDS: dict[str, dict[str, Any]] = {
    "initial": {"marker": "circle", "size": 14, "fill_alpha": 0.0, "line_color": _BLUE, "line_width": 2},
    "final": {"marker": "x", "size": 12, "line_color": _BLUE, "line_width": 2.5},
}


def phase_space(paths: dict[str, xr.Dataset]) -> list[Panel]:
    """Draw each Dataset of :func:`~nearharmonic_paper.experiments.paper.orbits.substeps.substeps` in a panel.

    Panels of one system share their axes and the picture of the Hamiltonian.
    """
    ranges: dict[str, tuple[Any, Any]] = {}
    around: dict[str, tuple[Any, Any]] = {}
    drawn = []
    for letter, path in paths.items():
        system = path.attrs["system"]
        if system not in ranges:
            edges = [path[name].values[[0, -1]].tolist() for name in ("q_grid", "p_grid")]
            ranges[system] = (panels.exactly(*edges[0]), panels.exactly(*edges[1]))
            around[system] = _hamiltonian(path)
        title = f"{letter}. {path.attrs['label']}, {path.attrs['system_label']}"
        plot = panels.new_plot(ranges[system], ("q", "p"), height=400)
        _add_hamiltonian(plot, around[system])
        _add_path(plot, path)
        drawn.append(Panel(title=title, plot=plot, note=_energy_statement(path)))
    return drawn


def _hamiltonian(path: xr.Dataset) -> tuple[Any, Any]:
    """Return sources of the picture of the Hamiltonian: the band of each point, and the edges of the bands."""
    q, p, H = (path[name].values for name in ("q_grid", "p_grid", "hamiltonian"))
    levels = np.linspace(H.min(), H.max(), len(_SHADES) + 1)[1:-1]
    bands = np.searchsorted(levels, H).astype(np.uint8)
    place = {"x": [q[0]], "y": [p[0]], "dw": [q[-1] - q[0]], "dh": [p[-1] - p[0]]}
    return Source(data={"bands": [bands], **place}), _lines(path, levels)


def _lines(path: xr.Dataset, levels: Any) -> Any:
    """Return the source of the contours of the Hamiltonian at ``levels``."""
    generator = contour_generator(*(path[name].values for name in ("q_grid", "p_grid", "hamiltonian")))
    lines: list[Any] = [
        np.round(np.asarray(line, dtype=float), 4) for level in levels for line in generator.lines(level)
    ]
    return Source(data={"q": [line[:, 0] for line in lines], "p": [line[:, 1] for line in lines]})


def _add_hamiltonian(plot: Plot, around: tuple[Source, Source]) -> None:
    bands, edges = around
    mapper = bokeh.LinearColorMapper(palette=list(_SHADES), low=-0.5, high=len(_SHADES) - 0.5)
    panels.add(plot, bands, bokeh.Image(image="bands", color_mapper=mapper, x="x", y="y", dw="dw", dh="dh"))
    panels.add(plot, edges, _contours("#8795a5", line_width=0.6))


def _contours(colour: str, **look: Any) -> bokeh.MultiLine:
    return bokeh.MultiLine(xs="q", ys="p", line_color=colour, **look)


def _add_path(plot: Plot, path: xr.Dataset) -> None:
    """Draw the path, its dots and ends, and the energy surface through its start, tagged with the method."""
    method, label = path.attrs["integrator"], path.attrs["label"]
    surface = _lines(path, path["H"].values[:1, 0])
    panels.add(plot, surface, _contours("#1f2d3d", line_width=1.3, line_dash=[5, 3]), method)
    q, p, error = (path[name].values for name in ("q", "p", "energy_error"))
    legs = [_legs(*one, drift_first=path.attrs["first"] == "drift") for one in zip(q, p, strict=True)]
    lines = Source(data={"q": [leg[0] for leg in legs], "p": [leg[1] for leg in legs]})
    panels.add(plot, lines, _contours("#4d5661", line_width=1.0), method)
    for end, at in (("initial", 0), ("final", -1)):
        place = panels.source_of(q=q[:, at], p=p[:, at])
        panels.add_markers(plot, place, ("q", "p"), method, **({"angle": 0.0} | _ENDS[end]))
    signs = np.column_stack([path["next_drift_sign"].values, path["next_kick_sign"].values]) < 0
    hit = []
    for kind, (says, layers) in _DOTS.items():
        chosen = np.flatnonzero((path["kind"].values == "substep") & np.all(signs == kind, axis=1))
        dots = panels.source_of(**{
            name: values[:, chosen].ravel() for name, values in (("q", q), ("p", p), ("error", abs(error)))
        })  # fmt: skip
        for layer in layers:
            look = {"marker": "circle", "angle": 0.0, "line_color": None, "line_width": 1.2} | layer
            renderer = panels.add_markers(plot, dots, ("q", "p"), method, f"{label}: {says}", **look)
        hit.append(renderer)
    rows = [("method", "$name"), ("q, p", "@q{%.4f}, @p{%.4f}"), ("|ΔH/H₀|", "@error{%.2e}")]
    panels.add_hover(plot, hit, rows)


def _legs(q: Any, p: Any, *, drift_first: bool) -> tuple[Any, Any]:
    """Return the path with its corners: drifts move along q, kicks along p."""
    corners = (q[1:], p[:-1]) if drift_first else (q[:-1], p[1:])
    along_q, along_p = (
        np.concatenate([points[:1], np.column_stack([corner, points[1:]]).ravel()])
        for points, corner in zip((q, p), corners, strict=True)
    )
    return along_q, along_p


def _energy_statement(path: xr.Dataset) -> str:
    error, largest = abs(float(path["energy_error"].values[-1, -1])), float(path["max_energy_error"])
    left_at, followed = int(path["left_at"]), int(path.attrs["followed"])
    after = f"|ΔH/H₀| = {short(error, 2) if isfinite(error) else '∞'} after {path.sizes['iteration']} iterations"
    if left_at:
        return f"{after}, leaves its energy surface at iteration {left_at}"
    return f"{after}, up to {short(largest, 2)} in {followed}"
