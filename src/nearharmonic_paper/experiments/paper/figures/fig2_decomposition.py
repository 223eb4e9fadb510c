"""Figure 2: position error terms kappa of the harmonic oscillator, for both compositions of each method."""

from __future__ import annotations

from math import log10
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from nearharmonic.plotting.style import (
    Style,
    house_style,
    log_scale,
    method_handles,
    new_figure,
    panel_letter,
    right_title,
    style_of,
)
from nearharmonic_paper.experiments.paper.figures.shown import SATISFIED_BELOW

if TYPE_CHECKING:
    import xarray as xr

_CIRCLE: dict[str, Any] = {"marker": "o", "markersize": 8, "markerfacecolor": "none"}


@house_style
def fig2_decomposition(terms: xr.Dataset) -> Figure:
    """Draw ``kappa`` of ``terms``, dimensions (integrator, first, order), NaN beyond the highest order reached."""
    kappa = terms["kappa"]
    labels = [str(label) for label in terms["label"].values]
    drawn = new_figure(7, 7.6)
    left = max(0.125, 0.0113 * max(map(len, labels), default=0))  # labels of methods stand beside panel B
    drawn.subplots_adjust(left=left, right=0.985, top=0.875, bottom=0.065, hspace=0.12)
    ratios = [3.2, 0.25 + 0.13 * len(labels)]
    upper, lower = drawn.subplots(2, 1, sharex=True, height_ratios=ratios)
    _draw_terms(upper, kappa.where(kappa >= SATISFIED_BELOW))
    _draw_satisfied(lower, (kappa < SATISFIED_BELOW), labels)
    panel_letter(upper, "A", "error terms that remain")
    right_title(upper, "simple harmonic oscillator, one step")
    panel_letter(lower, "B", rf"error terms that vanish ($\kappa_\lambda < 10^{{{log10(SATISFIED_BELOW):.0f}}}$)")
    lower.set_xlabel(r"order, $\lambda$")
    lower.xaxis.set_major_locator(MultipleLocator(1))
    handles = method_handles(map(str, terms["integrator"].values), labels, markersize=4)
    handles += [
        Line2D([], [], color="#404040", linestyle="none", label="ABA composition", **_CIRCLE),
        Line2D([], [], color="#404040", label="BAB composition"),
    ]
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.55, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_terms(axes: Axes, kappa: xr.DataArray) -> None:
    order = kappa["order"].values
    for name in map(str, kappa["integrator"].values):
        style = style_of(name)
        term = kappa.sel(integrator=name)
        axes.plot(order, term.sel(first="kick").values, color=style.colour, linewidth=1.2)
        _circles(axes, order, term.sel(first="drift").values, style)
    log_scale(axes, "y")
    axes.set_ylabel(r"error term of the position, $\kappa_\lambda$")


def _circles(axes: Axes, x: Any, y: Any, style: Style) -> None:
    """Draw circles around the marker of the method, which identifies it without colour."""
    axes.plot(x, y, **style.points(markeredgewidth=0.9, **_CIRCLE))
    axes.plot(x, y, **style.points(markersize=3.2, markeredgewidth=0.8))


def _draw_satisfied(axes: Axes, satisfied: xr.DataArray, labels: list[str]) -> None:
    order = satisfied["order"].values
    for row, name in enumerate(map(str, satisfied["integrator"].values)):
        met = satisfied.sel(integrator=name)
        style = style_of(name)
        kick, drift = order[met.sel(first="kick").values], order[met.sel(first="drift").values]
        bar = style.points(marker="_", markersize=17, markeredgewidth=1.6)
        axes.plot(kick, [row] * len(kick), **bar)
        _circles(axes, drift, [row] * len(drift), style)
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.4, -0.6)
