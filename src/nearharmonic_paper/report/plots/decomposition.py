"""Error terms kappa of the harmonic oscillator against their order, for both compositions, as in Figure 2."""

from __future__ import annotations

from math import log10
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models as bokeh
from bokeh.models import ColumnDataSource as Source
from bokeh.models import GlyphRenderer as Renderer
from bokeh.models import Plot

from nearharmonic.plotting.levels import SATISFIED_BELOW
from nearharmonic_paper.claims.results import power_of_ten
from nearharmonic_paper.report.plots import panels
from nearharmonic_paper.report.plots.panels import Panel

if TYPE_CHECKING:
    import xarray as xr

#: Operator of the outer row -> name of the composition.
_COMPOSITIONS = {"drift": "ABA", "kick": "BAB"}
_ROWS = [("method", "$name"), ("order λ", "@order"), ("|κ|", "@shown{%.4e}")]


def decomposition(terms: xr.Dataset) -> list[Panel]:
    """Draw ``kappa`` of ``terms``, dimensions (integrator, first, order): terms that remain, and terms that vanish.

    Markers with circles are ABA compositions, markers with lines BAB compositions; the panels share the axis of the
    order.
    """
    order = terms["order"].values
    kappa = np.array(terms["kappa"].values, dtype=float)
    labels = [str(label) for label in terms["label"].values]
    along = panels.span([order], logarithmic=False)
    remain = panels.span([kappa[kappa >= SATISFIED_BELOW]], logarithmic=True)
    upper = panels.new_plot((along, remain), ("order, λ", "κ"))
    lower = panels.new_plot((along, panels.span([[0, 1]], logarithmic=False)), ("order, λ", ""))
    panels.use_categories(lower, labels)
    for plot in (upper, lower):
        plot.below[0].ticker = bokeh.SingleIntervalTicker(interval=2, num_minor_ticks=2)
    dots: list[Renderer] = []
    bars: list[Renderer] = []
    for method, one in zip(map(str, terms["integrator"].values), kappa, strict=True):
        label = str(terms["label"].sel(integrator=method).item())
        for first, composition in _COMPOSITIONS.items():
            values = one[terms["first"].values.tolist().index(first)]
            dots.append(_draw_remaining(upper, order, values, (method, f"{label} as {composition}")))
            bars.append(_draw_vanishing(lower, order, values, (method, label, composition)))
    panels.add_hover(upper, dots, _ROWS)
    panels.add_hover(lower, bars, _ROWS)
    limit = power_of_ten(round(log10(SATISFIED_BELOW)))
    return [
        Panel(title="A. Error terms that remain: line BAB, circles ABA", plot=upper),
        Panel(title=f"B. Error terms that vanish, κ below {limit}: bar BAB, circles ABA", plot=lower),
    ]


def _draw_remaining(plot: Plot, order: Any, values: Any, names: tuple[str, str]) -> Renderer:
    """Draw the nonzero terms of one composition; return the renderer for the hover."""
    method, name = names
    shown = np.where(values >= SATISFIED_BELOW, values, np.nan)
    source = panels.source_of(order=order, shown=shown)
    if name.endswith("ABA"):
        return _circle(plot, source, "shown", method, name)
    panels.add_line(plot, source, ("order", "shown"), method)
    return panels.add_markers(plot, source, ("order", "shown"), method, name, line_alpha=0.0, fill_alpha=0.0)


def _draw_vanishing(plot: Plot, order: Any, values: Any, names: tuple[str, str, str]) -> Renderer:
    """Mark the vanishing terms of one composition; return the renderer for the hover."""
    method, label, composition = names
    gone = values < SATISFIED_BELOW
    source = panels.source_of(order=order[gone], row=np.full(gone.sum(), label), shown=values[gone])
    name = f"{label} as {composition}"
    if composition == "ABA":
        return _circle(plot, source, "row", method, name)
    bar = {"marker": "dash", "angle": 0.0, "size": 20, "line_width": 2}
    return panels.add_markers(plot, source, ("order", "row"), method, name, **bar)


def _circle(plot: Plot, source: Source, y: str, method: str, name: str) -> Renderer:
    """Draw circles around the marker of the method, which identifies it without colour."""
    panels.add_markers(plot, source, ("order", y), method, size=5, line_width=1)
    circle = {"marker": "circle", "angle": 0.0, "size": 12, "fill_alpha": 0.0, "line_width": 1.1}
    return panels.add_markers(plot, source, ("order", y), method, name, **circle)
