"""Spurious advance of the perihelion against force evaluations per orbit, as in Figure 4."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import GlyphRenderer as Renderer
from bokeh.models import Plot

from nearharmonic.output.dataset import double_runs
from nearharmonic.plotting.levels import MERCURY_RELATIVISTIC_ADVANCE, arcseconds_per_century, envelope
from nearharmonic.plotting.palette import style_of
from nearharmonic_paper.report.plots import panels
from nearharmonic_paper.report.plots.panels import Panel

if TYPE_CHECKING:
    import xarray as xr

_X, _Y = "per_orbit", "advance"
_TEXT = "|perihelion advance| (rad per orbit)"


def perihelion(cube: xr.Dataset) -> list[Panel]:
    """Draw |perihelion_advance| of ``cube``, over (precision, integrator, tau_per_stage), with its 95 % interval.

    Runs whose interval includes zero are crosses without a line. The dashed line is the advance of general relativity.
    """
    century = arcseconds_per_century(float(cube.attrs["orbital_period"]))
    unit = cube["tau_per_stage"].attrs.get("units", "1")
    runs = double_runs(cube)
    advance = abs(runs["perihelion_advance"].values)
    ranges = (
        panels.span([runs["evaluations_per_orbit"].values], logarithmic=True),
        panels.span([advance[np.isfinite(runs["perihelion_advance_interval"].values)]], logarithmic=True),
    )
    plot = panels.new_plot(ranges, ("force evaluations per orbit", _TEXT), height=460)
    relativity = f"general relativity: {MERCURY_RELATIVISTIC_ADVANCE}″ per century"
    panels.add_level(plot, MERCURY_RELATIVISTIC_ADVANCE / century, relativity)
    methods = cube.sizes["integrator"]
    dots = [dot for turn in range(methods) for dot in _draw(plot, _seen(runs, turn), (turn, methods), century)]
    rows = [
        ("method", "$name"),
        ("evaluations per orbit", f"@{_X}{{%.5g}}"),
        ("|advance|", f"@{_Y}{{%.4e}} ± @interval{{%.1e}} rad per orbit"),
        ("", "@arcseconds{%.4g}″ per century"),
        ("τ/s", f"@tau_per_stage{{%.6g}}{'' if unit == '1' else f' {unit}'}"),
        ("evaluations", "@evaluations{0,0}"),
        ("status", "@status"),
    ]
    panels.add_hover(plot, dots, rows)
    return [Panel(title="", plot=plot)]


def _seen(runs: xr.Dataset, turn: int) -> xr.Dataset:
    """Return the runs of one method that the plot can show."""
    return envelope(runs.isel(integrator=turn), ["perihelion_advance"], panels.COLUMNS // 2)


def _draw(plot: Plot, runs: xr.Dataset, turn: tuple[int, int], century: float) -> list[Renderer]:
    """Draw the runs of one method; return the renderers for the hover."""
    method, label = str(runs["integrator"].item()), str(runs["label"].item())
    advance = panels.drawable(abs(runs["perihelion_advance"].values))
    interval = np.array(runs["perihelion_advance_interval"].values, dtype=float)
    there = np.isfinite(advance) & np.isfinite(interval)
    columns: dict[str, Any] = {
        _X: runs["evaluations_per_orbit"].values,
        _Y: advance,
        "interval": interval,
        "arcseconds": advance * century,
        "tau_per_stage": runs["tau_per_stage"].values,
        "evaluations": runs["evaluations"].values if "evaluations" in runs else np.full(advance.size, np.nan),
        "status": runs["status"].values.astype(str) if "status" in runs else np.full(advance.size, "ok"),
    }
    known, unknown = there & (interval < advance), there & ~(interval < advance)
    line = {_X: columns[_X], _Y: np.where(known, advance, np.nan)}
    source = panels.source_of(**panels.marked(columns | line, (_X, _Y), turn))
    panels.add_line(plot, source, (_X, _Y), method, line_width=1.0)
    bars = panels.source_of(
        **{_X: columns[_X][known], "low": (advance - interval)[known], "high": (advance + interval)[known]}
    )
    ends = {"x0": _X, "x1": _X, "y0": "low", "y1": "high"}
    panels.add(plot, bars, bokeh.Segment(**ends, line_color=style_of(method).colour), method)
    panels.add_markers(plot, source, (_X, _Y), method)
    zero = panels.source_of(**{name: values[unknown] for name, values in columns.items()})
    cross = {"marker": "x", "angle": 0.0, "size": 5, "line_alpha": 0.5}
    crosses = panels.add_markers(plot, zero, (_X, _Y), method, label, **cross)
    return [*panels.add_hits(plot, source, (_X, _Y), method, label), crosses]
