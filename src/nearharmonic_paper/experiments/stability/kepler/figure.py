"""Kepler maps: energy error, spurious perihelion advance and loss of the orbit over eccentricity and step size."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, panel_letter, style_of

COLUMNS = 5
#: Grey, far from each colour of the maps for colour-blind readers too.
LOST_COLOUR = "#b8b8b8"
#: Eccentricities with a tick.
TICKS = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99)
#: Panel letter, variable, range of the colours, and label of the colour bar.
MAPS = (
    ("A", "energy_error", 1e-10, 1.0, r"$\max\,|\Delta H/H_0|$"),
    ("B", "perihelion_advance", 1e-10, 1.0, "|perihelion advance|  (rad per orbit)"),
)


@house_style
def kepler_stability(cube: xr.Dataset) -> Figure:
    """Draw ``energy_error``, ``perihelion_advance`` and ``evaluations_for_contour`` of ``cube``.

    Dimensions are (integrator, tau_per_stage, eccentricity); ``evaluations_per_orbit`` is each method's x axis.
    """
    names = [str(name) for name in cube["integrator"].values]
    lines = -(-len(names) // COLUMNS)
    drawn = new_figure(7.4, 2.1 * lines + 4.0)
    parts: Any = drawn.subfigures(3, 1, height_ratios=[1.05 * lines + 0.35, 1.05 * lines + 0.35, 3.2])
    for part, (letter, variable, smallest, largest, says) in zip(parts, MAPS, strict=False):
        _draw_maps(part, cube, names, letter, variable, (smallest, largest), says)
    _draw_contours(parts[2], cube, names)
    return drawn


def _draw_maps(
    part: Any, cube: xr.Dataset, names: list[str], letter: str, variable: str, limits: tuple[float, float], says: str
) -> None:
    lines = -(-len(names) // COLUMNS)
    part.subplots_adjust(left=0.075, right=0.88, top=0.87, bottom=0.13, hspace=0.32, wspace=0.08)
    grid = part.subplots(lines, COLUMNS, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[len(names) :]:
        axes.set_visible(False)
    for axes, name in zip(grid.flat, names, strict=False):
        image = _draw_map(axes, cube.sel(integrator=name), variable, limits)
    for axes in grid[:, 0]:
        axes.set_ylabel("e", rotation=0, labelpad=6)
    part.supxlabel("force evaluations per orbit", fontsize=8.5, y=0.005)
    bar = part.colorbar(image, cax=part.add_axes((0.9, 0.13, 0.015, 0.66)), extend="min")
    ticks = np.arange(np.log10(limits[0]), np.log10(limits[1]) + 1, 2)
    bar.set_ticks(ticks, labels=[rf"$10^{{{int(t)}}}$" for t in ticks])
    bar.ax.grid(visible=False)
    part.legend(handles=[Patch(color=LOST_COLOUR, label="lost")], loc="upper right", fontsize=8, borderaxespad=0.2)
    part.text(0.01, 0.985, rf"$\mathbf{{{letter}}}$  {says}", va="top", fontsize=9)


def _draw_map(axes: Axes, one: xr.Dataset, variable: str, limits: tuple[float, float]) -> Any:
    if variable == "perihelion_advance":  # a circle has no perihelion
        one = one.isel(eccentricity=np.flatnonzero(one["eccentricity"].values))
    evaluations, first = np.unique(one["evaluations_per_orbit"].values, return_index=True)
    values, kept = (
        one[name].transpose("tau_per_stage", "eccentricity").values[first] for name in (variable, "orbits_kept")
    )
    shade = np.log10(np.clip(np.where(np.isnan(kept), limits[0], abs(values)), limits[0], limits[1]))
    distance = 1 - one["eccentricity"].values
    lost = ~np.isfinite(values) & ~np.isnan(kept)
    colours = colormaps["viridis_r"].with_extremes(bad=LOST_COLOUR)
    image = axes.pcolormesh(
        _edges(evaluations), _edges(distance), np.ma.masked_where(lost, shade).T, cmap=colours, rasterized=True,
        norm=Normalize(np.log10(limits[0]), np.log10(limits[1])),
    )  # fmt: skip
    if variable == "energy_error":
        axes.plot(one["evaluations_for_contour"].values, distance, color="white", linewidth=1.1)
    axes.set(xscale="log", yscale="log", ylim=(1.0, distance[-1]))
    axes.set_yticks([1 - e for e in TICKS], [f"{e:g}" for e in TICKS], fontsize=6.5)
    axes.set_yticks([], minor=True)
    axes.set_xticks([10.0**k for k in range(1, 9) if evaluations[0] < 10.0**k < 0.9 * evaluations[-1]])
    axes.tick_params(axis="x", labelsize=7)
    axes.grid(visible=False)
    axes.set_title(str(one["label"].item()), fontsize=8, pad=2)
    return image


def _edges(centres: Any) -> Any:
    """Cell edges between positive ``centres``, halfway in the logarithm."""
    logs = np.log(centres)
    if logs.size == 1:
        return centres[0] * np.array([0.9, 1.1])
    middle = (logs[1:] + logs[:-1]) / 2
    return np.exp([2 * logs[0] - middle[0], *middle, 2 * logs[-1] - middle[-1]])


def _draw_contours(part: Any, cube: xr.Dataset, names: list[str]) -> None:
    part.subplots_adjust(left=0.075, right=0.72, top=0.92, bottom=0.15)
    axes = part.subplots()
    distance = 1 - cube["eccentricity"].values
    for name in names:
        evaluations = cube["evaluations_for_contour"].sel(integrator=name).values
        axes.plot(evaluations, distance, markevery=max(1, distance.size // 8), **style_of(name).line(markersize=4))
    log_scale(axes, "x")
    axes.set(yscale="log", ylim=(1.0, distance[-1]), xlabel="force evaluations per orbit")
    axes.set_yticks([1 - e for e in TICKS], [f"{e:g}" for e in TICKS])
    axes.set_yticks([], minor=True)
    axes.set_ylabel("e", rotation=0, labelpad=6)
    panel_letter(axes, "C", r"evaluations for $\max\,|\Delta H/H_0| < 10^{-6}$")
    part.legend(handles=method_handles(names, map(str, cube["label"].values)), loc="center right")
