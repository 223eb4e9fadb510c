"""Range of validity of each method on the Henon-Heiles system: energy error and escapes over step size and energy."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from nearharmonic.plotting.profile import problem_of
from nearharmonic.plotting.style import house_style, new_figure
from nearharmonic_paper.experiments.stability.henon_heiles.reductions import TOLERATED

#: Range of energy errors of the colours; smaller and larger errors have the colours of the ends.
SMALLEST, LARGEST = 1e-8, 1.0

#: Grey, far from each colour of the map for colour-blind readers too; a black line with a white edge is seen on both.
ESCAPED_COLOUR, LIMIT_COLOUR = "#b8b8b8", "#000000"
LIMIT: dict[str, Any] = {
    "color": LIMIT_COLOUR, "linewidth": 1.2, "path_effects": [withStroke(linewidth=2.8, foreground="white")],
}  # fmt: skip


@house_style
def henon_heiles_stability(cube: xr.Dataset) -> Figure:
    """Draw ``energy_error`` (median) and ``escaped`` of ``cube``, dimensions (integrator, energy, tau_per_stage)."""
    names = [str(name) for name in cube["integrator"].values]
    drawn = new_figure(7, 1.35 + 0.68 * len(names))
    height = drawn.get_figheight()
    drawn.subplots_adjust(left=0.135, right=0.955, top=1 - 0.82 / height, bottom=0.48 / height, hspace=0.16)
    rows = np.atleast_1d(drawn.subplots(len(names), 1, sharex=True))
    colours = colormaps["plasma_r"].with_extremes(bad=ESCAPED_COLOUR)
    for axes, name in zip(rows, names, strict=True):
        image = _draw_method(axes, cube.sel(integrator=name), colours)
    rows[-1].set_xlabel(r"step size per stage, $\tau/s$")
    _annotate(drawn, image, height)
    drawn.text(
        0.955, 1 - 0.62 / height, f"Hénon-Heiles system, {problem_of(cube)}".rstrip(", "), ha="right", fontsize=9
    )
    return drawn


def _draw_method(axes: Axes, one: xr.Dataset, colours: Any) -> Any:
    tau = one["tau_per_stage"].values
    half = (tau[-1] - tau[0]) / max(1, 2 * (tau.size - 1)) or tau[0] / 2
    with np.errstate(divide="ignore"):
        shade = np.log10(one["energy_error"].sel(quantile=0.5).transpose("energy", "tau_per_stage").values)
    escaped = one["escaped"].transpose("energy", "tau_per_stage").values > TOLERATED
    image = axes.imshow(
        np.ma.masked_where(escaped, shade),
        aspect="auto",
        interpolation="none",
        cmap=colours,
        norm=Normalize(np.log10(SMALLEST), np.log10(LARGEST)),
        extent=(tau[0] - half, tau[-1] + half, len(shade) - 0.5, -0.5),
    )
    limit = one["linear_limit"].item()
    if tau[0] - half <= limit <= tau[-1] + half:
        axes.axvline(limit, **LIMIT)
    axes.set_ylabel(str(one["label"].item()), rotation=0, ha="right", va="center")
    axes.set_yticks(range(len(shade)), [str(Fraction(float(e)).limit_denominator(1000)) for e in one["energy"].values])
    axes.yaxis.tick_right()
    axes.tick_params(axis="y", labelsize=5.5, length=0, pad=2)
    axes.grid(visible=False)
    for line in np.arange(0.5, len(shade) - 1):
        axes.axhline(line, color="white", linewidth=0.6)
    return image


def _annotate(figure: Figure, image: Any, height: float) -> None:
    """Draw the colour bar above the maps, with the meaning of grey and of the line."""
    bar = figure.colorbar(
        image,
        cax=figure.add_axes((0.135, 1 - 0.33 / height, 0.42, 0.12 / height)),
        extend="min",
        orientation="horizontal",
    )
    ticks = np.arange(np.log10(SMALLEST), np.log10(LARGEST) + 1, 2)
    bar.set_ticks(ticks.tolist(), labels=[rf"$10^{{{int(t)}}}$" for t in ticks])
    bar.ax.set_title(r"median over the ensemble of $\max\,|\Delta H/H_0|$", fontsize=8.5, pad=3)
    bar.ax.tick_params(labelsize=8, pad=1)
    bar.ax.grid(visible=False)
    handles = [
        Patch(color=ESCAPED_COLOUR, label="more than 1 % escaped"),
        Line2D([], [], label="first linear limit", **LIMIT),
    ]
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.96, 1.0), borderaxespad=0.4)
    figure.text(0.958, 1 - 0.8 / height, "$H$", va="bottom", ha="left", fontsize=8)
