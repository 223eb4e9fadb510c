"""Figures of the stability of each method, one for each item."""

from __future__ import annotations

from fractions import Fraction
from math import ceil
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
from matplotlib.ticker import MultipleLocator

from nearharmonic.plotting.profile import Style, problem_of, style_of
from nearharmonic.plotting.style import house_style, log_scale, mark_every, method_handles, new_figure, panel_letter
from nearharmonic_paper.experiments.stability.reductions import TOLERATED

KEPLER_COLUMNS = 5
# --- Kepler maps: energy error, spurious perihelion advance and loss of the orbit over eccentricity and step size.

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
    lines = -(-len(names) // KEPLER_COLUMNS)
    drawn = new_figure(7.4, 2.1 * lines + 4.0)
    parts: Any = drawn.subfigures(3, 1, height_ratios=[1.05 * lines + 0.35, 1.05 * lines + 0.35, 3.2])
    for part, (letter, variable, smallest, largest, says) in zip(parts, MAPS, strict=False):
        _draw_maps(part, cube, names, letter, variable, (smallest, largest), says)
    _draw_contours(parts[2], cube, names)
    return drawn


def _draw_maps(
    part: Any, cube: xr.Dataset, names: list[str], letter: str, variable: str, limits: tuple[float, float], says: str
) -> None:
    lines = -(-len(names) // KEPLER_COLUMNS)
    part.subplots_adjust(left=0.075, right=0.88, top=0.87, bottom=0.13, hspace=0.32, wspace=0.08)
    grid = part.subplots(lines, KEPLER_COLUMNS, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[len(names) :]:
        axes.set_visible(False)
    for axes, name in zip(grid.flat, names, strict=False):
        image = _draw_map(axes, cube.sel(integrator=name), variable, limits)
    for axes in grid[:, 0]:
        axes.set_ylabel("e", rotation=0, labelpad=6)
    part.supxlabel("force evaluations per orbit", fontsize=8.5, y=0.005)
    _colour_bar(part, image, (0.9, 0.13, 0.015, 0.66), limits)
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


def _colour_bar(
    figure: Any, image: Any, place: tuple[float, ...], limits: tuple[float, float], orientation: str = "vertical"
) -> Any:
    """Draw the bar of decades between ``limits``, two apart, at a place of the figure."""
    bar = figure.colorbar(image, cax=figure.add_axes(place), extend="min", orientation=orientation)
    ticks = np.arange(np.log10(limits[0]), np.log10(limits[1]) + 1, 2)
    bar.set_ticks(ticks, labels=[rf"$10^{{{int(t)}}}$" for t in ticks])
    bar.ax.grid(visible=False)
    return bar


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


# --- Range of validity of each method on the Henon-Heiles system: energy error and escapes over step size and energy.

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
    says = f"Hénon-Heiles system, {problem_of(cube)}".rstrip(", ")
    drawn.text(0.955, 1 - 0.62 / height, says, ha="right", fontsize=9)
    return drawn


def _draw_method(axes: Axes, one: xr.Dataset, colours: Any) -> Any:
    tau = one["tau_per_stage"].values
    half = (tau[-1] - tau[0]) / max(1, 2 * (tau.size - 1)) or tau[0] / 2
    with np.errstate(divide="ignore"):
        shade = np.log10(one["energy_error"].sel(quantile=0.5).transpose("energy", "tau_per_stage").values)
    escaped = one["escaped"].transpose("energy", "tau_per_stage").values > TOLERATED
    image = axes.imshow(
        np.ma.masked_where(escaped, shade), aspect="auto", interpolation="none", cmap=colours,
        norm=Normalize(np.log10(SMALLEST), np.log10(LARGEST)),
        extent=(tau[0] - half, tau[-1] + half, len(shade) - 0.5, -0.5),
    )  # fmt: skip
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
    place = (0.135, 1 - 0.33 / height, 0.42, 0.12 / height)
    bar = _colour_bar(figure, image, place, (SMALLEST, LARGEST), orientation="horizontal")
    bar.ax.set_title(r"median over the ensemble of $\max\,|\Delta H/H_0|$", fontsize=8.5, pad=3)
    bar.ax.tick_params(labelsize=8, pad=1)
    handles = [
        Patch(color=ESCAPED_COLOUR, label="more than 1 % escaped"),
        Line2D([], [], label="first linear limit", **LIMIT),
    ]
    figure.legend(handles=handles, loc="upper right", bbox_to_anchor=(0.96, 1.0), borderaxespad=0.4)
    figure.text(0.958, 1 - 0.8 / height, "$H$", va="bottom", ha="left", fontsize=8)


# --- Figure of energy errors for a kinetic energy different from p^2/2, on the relativistic oscillator.

#: Amplitudes of the panels A and B.
SMALL, RELATIVISTIC = 0.03, 1.0
_LARGEST_ERROR = 10.0


@house_style
def kinetic_energy(cube: xr.Dataset) -> Figure:
    """Draw ``max_energy_error`` (roles, amplitude, integrator, tau_per_stage) and ``relative_error`` of ``cube``."""
    drawn = new_figure(7, 7.4)
    drawn.subplots_adjust(left=0.105, right=0.985, top=0.865, bottom=0.065, hspace=0.3, wspace=0.25)
    upper, lower = drawn.subplots(2, 2, sharey="row")
    for axes, letter, amplitude in zip(upper, "AB", (SMALL, RELATIVISTIC), strict=True):
        errors = cube.max_energy_error.sel(roles="own").sel(amplitude=amplitude, method="nearest")
        _kinetic_energy_draw(axes, errors, "tau_per_stage")
        axes.set_xlabel(r"step size per stage, $\tau/s$")
        panel_letter(axes, letter, f"amplitude {errors.amplitude.item():g}")
    upper[0].set_ylabel(r"$\max\,|\Delta H/H_0|$")
    for axes in upper:
        axes.set_ylim(top=min(axes.get_ylim()[1], _LARGEST_ERROR))
    ratio = cube.relative_error
    says = {
        "own": rf"error / Ruth's at $\tau/s$ = {cube.attrs['compared_at']:g}",
        "exchanged": "the same, T and V exchanged",
    }
    for axes, letter, roles in zip(lower, "CD", says, strict=True):
        _kinetic_energy_draw(axes, ratio.sel(roles=roles), "amplitude")
        axes.set_xlabel("amplitude $A$")
        panel_letter(axes, letter, says[roles])
    lower[0].set_ylabel("error / Ruth's")
    labels = map(str, cube.label.values)
    handles: list[Line2D] = method_handles(map(str, cube.integrator.values), labels)
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.545, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _kinetic_energy_draw(axes: Axes, values: xr.DataArray, along: str) -> None:
    names = [str(name) for name in values.integrator.values]
    for position, name in enumerate(names):
        curve = values.sel(integrator=name)
        every = mark_every(position, len(names), curve.values)
        axes.plot(curve[along].values, curve.values, markevery=every, **style_of(name).line(markersize=4.5))
    log_scale(axes, "xy")


LINEAR_COLUMNS = 2
# --- Figure of linear stability: half the trace of the oscillator's step matrix against tau/s, one panel per method.

#: Limit of the axis: the trace is unbounded, but only its crossings of +-1 matter.
SHOWN = 1.6
GAP = "#d62728"


@house_style
def linear_stability(cube: xr.Dataset) -> Figure:
    """Draw ``half_trace`` (integrator, tau_per_stage) of ``cube`` and its gaps, from ``start`` to ``end``."""
    names = [str(name) for name in cube.integrator.values]
    rows = ceil(len(names) / LINEAR_COLUMNS)
    height = 0.6 + 1.45 * rows
    drawn = new_figure(7, height)
    drawn.subplots_adjust(left=0.085, right=0.985, top=1 - 0.25 / height, bottom=0.42 / height, hspace=0.32, wspace=0.1)
    panels = drawn.subplots(rows, LINEAR_COLUMNS, sharex=True, sharey=True, squeeze=False)
    for axes, name in zip(panels.flat, names, strict=False):
        _linear_draw(axes, cube.sel(integrator=name), style_of(name))
    for axes in panels.flat[len(names) :]:
        axes.remove()
    for axes in panels[-1]:
        axes.set_xlabel(r"step size per stage, $\tau/s$")
    for axes in panels[:, 0]:
        axes.set_ylabel(r"$\frac{1}{2}\,\mathrm{tr}\,K$")
    return drawn


def _linear_draw(axes: Axes, method: xr.Dataset, style: Style) -> None:
    tau, stages = method.tau_per_stage.values, int(method.stages)
    axes.axhspan(-1, 1, color="#f2f2f2", zorder=0)
    axes.plot(tau, np.cos(tau * stages), color="#b0b0b0", linewidth=0.6)
    for start, end in zip(method.start.values, method.end.values, strict=True):
        if np.isfinite(start):
            axes.axvspan(start / stages, min(end / stages, tau[-1]), color=GAP, alpha=0.16, linewidth=0)
            axes.plot([start / stages], [SHOWN], marker="v", color=GAP, markersize=4, clip_on=False, zorder=5)
    axes.plot(tau, np.where(np.abs(method.half_trace) <= 2 * SHOWN, method.half_trace, np.nan), color=style.colour)
    axes.set(xlim=(0, tau[-1]), ylim=(-SHOWN, SHOWN))
    axes.yaxis.set_major_locator(MultipleLocator(1))
    first, growth = float(method.start[0]), float(method.growth_per_step[0])
    says = rf"$\tau^*$ = {first:.6f}, " + (f"growth {growth:.1e}" if np.isfinite(growth) else "for good")
    axes.set_title(f"{method.label.item()}:  {says}", loc="left", fontsize=8.5, pad=5)


# --- Growth of round-off over long times: energy and lag along the track, compared with Brouwer's law.

_LINES: dict[str, Any] = {
    "plain": "-",
    "compensated": (0, (5, 2)),
    "extended": (0, (6, 2, 1, 2)),
    "coefficients": (0, (1, 1.5)),
}
_MARKERS = {"plain": "o", "compensated": "s", "extended": "^"}
#: Variable, Brouwer's exponent, axis label and sources drawn, for each column.
PANELS = (
    ("energy_error", 0.5, r"rms of $\delta H/|H_0|$", ("plain", "compensated", "extended")),
    ("lag", 1.5, "rms of the lag  (rad)", ("plain", "compensated", "extended", "coefficients")),
)


@house_style
def rounding_growth(cube: xr.Dataset) -> Figure:
    """Draw ``energy_error`` and ``lag`` of ``cube`` over (integrator, source, sample): rms, exponents and intervals."""
    names = [str(name) for name in cube["integrator"].values]
    drawn = new_figure(7.4, 7.6)
    drawn.subplots_adjust(left=0.125, right=0.985, top=0.865, bottom=0.065, hspace=0.27, wspace=0.25)
    upper, lower = drawn.subplots(2, 2, height_ratios=[1.5, 1])
    for column, (variable, exponent, says, sources) in enumerate(PANELS):
        _draw_growth(upper[column], cube, names, variable, sources, exponent)
        upper[column].set_ylabel(says)
        panel_letter(upper[column], "AB"[column], ("energy", "lag along the track")[column])
        _draw_exponents(lower[column], cube, names, variable, exponent)
        panel_letter(lower[column], "CD"[column], f"exponents; Brouwer: {exponent:g}")
    lower[0].set_yticks(range(len(names)), map(str, cube["label"].values))
    lower[1].set_yticks(range(len(names)), [])
    handles = method_handles(names, map(str, cube["label"].values))
    drawn.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, 0.998), ncols=4, columnspacing=1.2, fontsize=8)
    kinds = [
        Line2D([], [], color="#404040", linestyle=line, marker=_MARKERS.get(source, ""), markersize=4, label=source)
        for source, line in _LINES.items()
    ]
    drawn.legend(handles=kinds, loc="upper right", bbox_to_anchor=(1.0, 0.998), handlelength=3, fontsize=8)
    return drawn


def _draw_growth(
    axes: Axes, cube: xr.Dataset, names: list[str], variable: str, sources: tuple[str, ...], exponent: float
) -> None:
    """Draw the curves, and Brouwer's power law six times above the middle of each bundle, which it would hide."""
    for name in names:
        for source in sources:
            rms = cube[f"{variable}_rms"].sel(integrator=name, source=source).values
            look = style_of(name).line(marker="none", linestyle=_LINES[source], linewidth=0.9)
            axes.plot(cube["time"].sel(integrator=name).values, rms, **look)
    log_scale(axes, "xy")
    axes.set_xlabel("time  (periods)")
    time = cube["time"].isel(integrator=-1).values
    for source in _MARKERS:
        level = np.exp(np.log(cube[f"{variable}_rms"].sel(source=source).isel(sample=-1)).mean().item())
        axes.plot(time, 6 * level * (time / time[-1]) ** exponent, color="#8a8a8a", linewidth=1.6, zorder=1.5)


def _draw_exponents(axes: Axes, cube: xr.Dataset, names: list[str], variable: str, exponent: float) -> None:
    axes.axvline(exponent, color="#8a8a8a", linewidth=1.6, zorder=1.5)
    for place, (source, marker) in enumerate(_MARKERS.items()):
        for row, name in enumerate(names):
            one = cube.sel(integrator=name, source=source)
            axes.errorbar(
                one[f"{variable}_exponent"].item(), row + 0.24 * (place - 1), xerr=one[f"{variable}_interval"].item(),
                fmt=marker, color=style_of(name).colour, markersize=3.2, elinewidth=0.8,
            )  # fmt: skip
    axes.set(xlabel="exponent", ylim=(len(names) - 0.4, -0.6))
    axes.grid(visible=False, axis="y")
