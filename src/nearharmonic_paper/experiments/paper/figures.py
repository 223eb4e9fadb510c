"""Figures 2, 4 and 6 of the paper, and the gain over Ruth's method."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite, log10, nan
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from nearharmonic.output.table import power_of_ten
from nearharmonic.plotting import column, style
from nearharmonic.plotting.profile import PANELS, Style, problem_of
from nearharmonic_paper.experiments.paper import orbits
from nearharmonic_paper.experiments.paper.gain import gains

if TYPE_CHECKING:
    import xarray as xr


# --- Figure 2: position error terms kappa of the harmonic oscillator, for both compositions of each method.

#: Methods with an error term above it have an inset.
LARGE = 1e3
_CIRCLE: dict[str, Any] = {"marker": "o", "markersize": 8, "markerfacecolor": "none"}


@style.house_style
def fig2_decomposition(terms: xr.Dataset) -> Figure:
    """Draw ``kappa`` of ``terms``, dimensions (integrator, first, order), NaN beyond the highest order reached."""
    kappa = terms["kappa"]
    labels = [str(label) for label in terms["label"].values]
    drawn = style.new_figure(7, 7.6)
    left = max(0.125, 0.0113 * max(map(len, labels), default=0))  # labels of methods stand beside panel B
    drawn.subplots_adjust(left=left, right=0.985, top=0.875, bottom=0.065, hspace=0.12)
    ratios = [3.2, 0.25 + 0.13 * len(labels)]
    upper, lower = drawn.subplots(2, 1, sharex=True, height_ratios=ratios)
    _draw_terms(upper, kappa.where(kappa >= orbits.SATISFIED_BELOW))
    _draw_satisfied(lower, (kappa < orbits.SATISFIED_BELOW), labels)
    style.panel_letter(upper, "A", "error terms that remain")
    style.right_title(upper, "simple harmonic oscillator, one step")
    limit = power_of_ten(round(log10(orbits.SATISFIED_BELOW)))
    style.panel_letter(lower, "B", f"error terms that vanish (below {limit})")
    lower.set_xlabel(r"order, $\lambda$")
    lower.xaxis.set_major_locator(MultipleLocator(1))
    handles = style.method_handles(map(str, terms["integrator"].values), labels, markersize=4)
    circles = Line2D([], [], color="#404040", linestyle="none", label="ABA composition", **_CIRCLE)
    handles += [circles, Line2D([], [], color="#404040", label="BAB composition")]
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.55, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_terms(axes: Axes, kappa: xr.DataArray) -> None:
    order, large = kappa["order"].values, (kappa.max(("first", "order")) > LARGE).values
    inset = axes.inset_axes((0.66, 0.08, 0.325, 0.33)) if large.any() and not large.all() else axes
    for name, is_large in zip(map(str, kappa["integrator"].values), large, strict=True):
        own, place = style.style_of(name), inset if is_large else axes
        term = kappa.sel(integrator=name)
        place.plot(order, term.sel(first="kick").values, color=own.colour, linewidth=1.2)
        _circles(place, order, term.sel(first="drift").values, own)
    if inset is not axes:
        inset.set_title(", ".join(map(str, kappa["label"].values[large])), fontsize=8, pad=3)
        inset.tick_params(labelsize=7.5)
        inset.margins(0.08)
        style.log_scale(inset, "y")
    style.log_scale(axes, "y")
    axes.set_ylabel(r"error term of the position, $\kappa_\lambda$")


def _circles(axes: Axes, x: Any, y: Any, own: Style) -> None:
    """Draw circles around the marker of the method, which identifies it without colour."""
    axes.plot(x, y, **own.points(markeredgewidth=0.9, **_CIRCLE))
    axes.plot(x, y, **own.points(markersize=3.2, markeredgewidth=0.8))


def _draw_satisfied(axes: Axes, satisfied: xr.DataArray, labels: list[str]) -> None:
    order = satisfied["order"].values
    for row, name in enumerate(map(str, satisfied["integrator"].values)):
        met = satisfied.sel(integrator=name)
        own = style.style_of(name)
        kick, drift = order[met.sel(first="kick").values], order[met.sel(first="drift").values]
        bar = own.points(marker="_", markersize=17, markeredgewidth=1.6)
        axes.plot(kick, [row] * len(kick), **bar)
        _circles(axes, drift, [row] * len(drift), own)
    axes.set_yticks(range(len(labels)), labels)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.4, -0.6)


# --- Figure 4: advance of Mercury's perihelion caused by the integrator, against force evaluations per orbit.

#: Points of a method, 1.5 mm wide each; and multiple of an advance up to which its bar is within its dot on any axis.
COLUMNS, HIDDEN = 100, 0.005


@style.house_style
def fig4_perihelion(cube: xr.Dataset) -> Figure:
    """Draw |perihelion_advance| of ``cube``, dimensions (precision, integrator, tau_per_stage), in rad per orbit.

    ``cube.attrs["orbital_period"]``, in h, converts it to arcseconds per century. Runs without a finite advance or
    interval are omitted.
    """
    drawn = style.new_figure(7, 6.4)
    drawn.subplots_adjust(left=0.105, right=0.895, top=0.865, bottom=0.08)
    axes = drawn.subplots()
    for one in orbits.advances(cube, COLUMNS):
        _draw_method(axes, one)
    axes.margins(x=0.03, y=0.04)
    style.log_scale(axes, "xy")
    axes.set_xlabel("force evaluations per orbit")
    style.right_title(axes, problem_of(cube, str(cube["tau_per_stage"].attrs.get("units", "1"))))
    axes.set_ylabel("|perihelion advance|  (rad per orbit)")
    _shade(axes)
    _add_century_axis(axes, orbits.arcseconds_per_century(float(cube.attrs["orbital_period"])))
    handles = style.method_handles(map(str, cube["integrator"].values), map(str, cube["label"].values))
    handles += [Line2D([], [], color="#404040", ls="none", marker="x", markersize=4, label="95 % interval includes 0")]
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, 0.995), ncols=4, columnspacing=1.8)
    return drawn


def _draw_method(axes: Axes, one: orbits.Advances) -> None:
    own, x = style.style_of(one.line.integrator), one.evaluations
    known, seen = np.where(one.known, one.size, np.nan), one.known & (one.interval > HIDDEN * one.size)
    axes.errorbar(x[seen], one.size[seen], yerr=one.interval[seen], fmt="none", ecolor=own.colour, elinewidth=0.8)
    axes.plot(x, known, color=own.colour, linewidth=0.5, marker=".", markersize=3.2)
    axes.plot(x, known, markevery=style.mark_every(*one.line.turn, known, marks=8), **own.points())
    axes.plot(x, np.where(one.unknown, one.size, np.nan), **own.points(marker="x", markersize=4, alpha=0.5))


def _shade(axes: Axes) -> None:
    """Shade advances of paths far from an ellipse, and advances of the size of rounding errors."""
    low, high = axes.get_ylim()
    among: dict[str, Any] = {"xycoords": axes.get_yaxis_transform(), "color": "#595959"}
    for says, *ends in orbits.NO_ORDER:
        start, end = np.clip(ends, low, high)
        if start < end:
            x, ha = (0.988, "right") if start > low else (0.012, "left")
            axes.axhspan(start, end, color="#ececec", zorder=0)
            style.write_beside(axes, says, (x, start), (0, 4), ha=ha, **among)
    axes.set_ylim(low, high)


def _add_century_axis(axes: Axes, arcseconds: float) -> None:
    """Add a second axis, ``arcseconds`` per century for 1 rad/orbit, and a line for the relativistic advance."""
    functions: Any = (lambda y: y * arcseconds, lambda y: y / arcseconds)
    century = axes.secondary_yaxis("right", functions=functions)
    century.set_ylabel("|perihelion advance|  (arcseconds per century)")
    style.log_ticks(century.yaxis)
    axes.tick_params(axis="y", which="both", right=False)
    level = orbits.MERCURY_RELATIVISTIC_ADVANCE / arcseconds
    axes.axhline(level, color="#404040", linestyle=(0, (6, 3)), linewidth=0.9, zorder=1.5)
    text = f"general relativity: {orbits.MERCURY_RELATIVISTIC_ADVANCE}″ per century"
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
    among = {"xycoords": ("axes fraction", "data"), "ha": "right", "zorder": 5}
    style.write_beside(axes, text, (0.988, level), (0, 4), bbox=box, **among)


# --- Energy errors of panel D of Figure 6 from starts outside its plane, until the paths diverge.

#: Black for the plane itself, then from near to far: at least 3:1 contrast with white, and 13 CIELAB units between any
#: two, with deuteranopia, protanopia and tritanopia as well.
_COLOURS = ("#000000", "#0072b2", "#a03070", "#009e73", "#d55e00")
_WIDTHS = (2.0, 1.2, 1.2, 1.2, 1.2)
_LEFT: dict[str, Any] = {"marker": "X", "markersize": 7, "markeredgecolor": "white", "markeredgewidth": 0.6}


@style.house_style
def fig6_displaced(cube: xr.Dataset) -> Figure:
    """Draw ``block_max_energy_error`` of ``cube``, dimensions (displacement, summation, iteration), and ``left_at``."""
    drawn = style.new_figure(7, 6.2)
    drawn.subplots_adjust(left=0.1, right=0.985, top=0.875, bottom=0.08, hspace=0.14)
    panels = drawn.subplots(2, 1, sharex=True, sharey=True)
    for axes, letter, summation in zip(panels, "AB", map(str, cube["summation"].values), strict=True):
        _draw(axes, cube.sel(summation=summation), float(cube.attrs["surface_limit"]))
        style.panel_letter(axes, letter, f"{cube.attrs['label']}, {cube.attrs['system_label']}, {summation} sums")
        axes.set_ylabel(r"$|\Delta H/H_0|$")
    panels[-1].set_xlabel("iteration")
    handles = [
        Line2D([], [], color=colour, linewidth=width, label=power_of_ten(round(log10(q_x))) if q_x else "0")
        for q_x, colour, width in zip(cube["displacement"].values.tolist(), _COLOURS, _WIDTHS, strict=False)
    ]
    handles.append(Line2D([], [], color="#404040", linestyle="none", label="leaves its energy surface", **_LEFT))
    place = style.LEGEND | {"bbox_to_anchor": (0.54, 0.998), "ncols": 6}
    drawn.legend(handles=handles, title="$q_x$ at the start", **place)
    return drawn


def _draw(axes: Axes, runs: xr.Dataset, limit: float) -> None:
    iteration = runs["iteration"].values
    axes.axhline(limit, color="#404040", linestyle=(0, (6, 3)), linewidth=0.9, zorder=1.5)
    text = f"surface left beyond an energy error of {limit:g}"
    style.write_beside(axes, text, (0.012, limit), (0, -4), xycoords=("axes fraction", "data"), va="top")
    for i, colour in enumerate(_COLOURS[: runs.sizes["displacement"]]):
        run = runs.isel(displacement=i)
        error, left_at = run["block_max_energy_error"].values, int(run["left_at"])
        kept = np.isfinite(error)
        x, y = iteration[kept], error[kept]
        if left_at:
            x, y = np.append(x, left_at), np.append(y, limit)
            axes.plot([left_at], [limit], color=colour, linestyle="none", zorder=4, **_LEFT)
        axes.plot(x, y, color=colour, linewidth=_WIDTHS[i])
    axes.margins(x=0.02)
    style.log_scale(axes, "xy")


# --- Gain over Ruth's method at equal cost: a panel for each system.


@style.house_style
def gain(*cubes: xr.Dataset, variable: str = "max_energy_error", narrow: bool = False) -> Figure:
    """Draw the gain in each cube, in panels side by side or, in a figure of the width of a column, in a column."""
    rows, across = (len(cubes), 1) if narrow else (1, len(cubes))
    drawn = style.new_figure(7, 3.6 * rows)
    above = (0.205 if narrow else 0.145) / rows  # the title has two lines in a column
    drawn.subplots_adjust(left=0.085, right=0.99, top=1 - above, bottom=0.125 / rows, wspace=0.04, hspace=0.25)
    title = f"{PANELS[variable].capitalize()} energy error at equal cost:", "bold methods against Ruth's"
    drawn.suptitle(("\n" if narrow else " ").join(title), y=0.985)
    panels = drawn.subplots(rows, across, sharey=True, squeeze=False).ravel()
    curves = [_draw_gains(axes, gains(cube, variable)) for axes, cube in zip(panels, cubes, strict=True)]
    style.log_scale(max(panels, key=lambda axes: isfinite(axes.dataLim.minposy)), "y")
    for number, (axes, cube) in enumerate(zip(panels, cubes, strict=True)):
        style.log_scale(axes, "x")
        if not style.say_if_empty(axes, [curve.get_ydata() for curve in curves[number]]):
            low, high = axes.dataLim.intervalx
            axes.set_xlim(low / (high / low) ** 0.3, high * 1.15)  # labels need room on the left
        bold = [np.asarray(curve.get_ydata(), dtype=float) for curve in curves[number] if curve.get_zorder() > 2]
        best = float(f"{np.fmax.reduce(np.ravel(bold), initial=nan):.1g}")
        says = f": up to {best:,.6g} times smaller".replace(",", " ") if isfinite(best) else ""
        style.panel_letter(axes, number, str(cube.attrs.get("system_label", "")).removesuffix(" system") + says)
        axes.set_xlabel(style.step_label(str(cube["tau_per_stage"].attrs.get("units", "1"))))
    for axes in panels[::across]:
        axes.set_ylabel("Ruth's error / error of the method")
    if narrow:
        column.narrow(drawn)
    for axes, named in zip(panels, curves, strict=True):
        style.label_ends(axes, named, left=True, size=column.SMALLEST if narrow else 7.5)
    return drawn


def _draw_gains(axes: Axes, found: xr.DataArray) -> list[Line2D]:
    """Draw a curve for each method, bold for methods with filled markers."""
    curves = []
    for curve in found:
        own = style.style_of(str(curve["integrator"].values))
        look: dict[str, Any] = {"linewidth": 2.2, "zorder": 3} if own.filled else {"linewidth": 0.9, "alpha": 0.6}
        label = str(curve["label"].values)
        curves += axes.plot(found["tau_per_stage"].values, curve.values, color=own.colour, label=label, **look)
    return curves


# --- Figure 6: substeps of two methods in phase space, coloured by the signs of the next coefficients.

_BLUE, _RED, _GREEN = "#0b5fb5", "#d7301f", "#1a9850"
_PALE = LinearSegmentedColormap.from_list("pale", ["#ffffff", "#b9c3cf"])


def _mark(marker: str, colour: str, size: float, **more: Any) -> dict[str, Any]:
    return {"marker": marker, "color": colour, "markersize": size, **more}


#: (next drift negative, next kick negative) -> meaning, and markers drawn over each other.
_DOTS: dict[tuple[bool, bool], tuple[str, tuple[dict[str, Any], ...]]] = {
    (False, False): ("next drift and kick forward", (_mark("o", _BLUE, 5),)),
    (True, False): ("next drift backward", (_mark("o", _RED, 8), _mark("_", "white", 5, markeredgewidth=1.4))),
    (False, True): ("next kick backward", (_mark("o", _GREEN, 7), _mark("|", "white", 5, markeredgewidth=1.4))),
    (True, True): (
        "next drift and kick backward",
        (_mark("o", _RED, 9), _mark("o", _GREEN, 5, markeredgecolor="white", markeredgewidth=0.9)),
    ),
}
_INITIAL = _mark("o", _BLUE, 10, markerfacecolor="none", markeredgewidth=1.6)
_FINAL = _mark("x", _BLUE, 9, markeredgewidth=2.0)

_BEHIND: dict[str, Any] = {"boxstyle": "square,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
_SURFACE: dict[str, Any] = {"colors": "#1f2d3d", "linewidths": 1.0, "linestyles": [(0, (5, 3))]}


@style.house_style
def fig6_substeps(panels: Mapping[str, xr.Dataset] | None = None, across: int = 2) -> Figure:
    """Draw each Dataset of :func:`~nearharmonic_paper.experiments.paper.orbits.substeps` in a panel of its letter.

    ``across`` stand in a row; by default they are the four panels of the paper.
    """
    panels = panels or orbits.paper_panels()
    rows = -(-len(panels) // across)
    height = 0.7 + 3.75 * rows
    drawn = style.new_figure(7.6, height)
    below, apart = (0.85, 0.42) if across > 1 else (1.2, 0.55)
    drawn.subplots_adjust(left=0.08, right=0.955, top=1 - 0.85 / height, bottom=below / height)
    drawn.subplots_adjust(hspace=apart, wspace=0.28)
    grid = drawn.subplots(rows, across, squeeze=False).ravel()
    for axes, (letter, panel) in zip(grid, panels.items(), strict=False):
        _draw_panel(drawn, axes, panel)
        style.panel_letter(axes, letter, f"{panel.attrs['label']}, {panel.attrs['system_label']}")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    labels, handles = zip(*_legend_entries(), strict=True)
    drawn.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.998), ncols=3, columnspacing=2.0)
    return drawn


def _draw_panel(drawn: Figure, axes: Axes, panel: xr.Dataset) -> None:
    q_grid, p_grid, H = (panel[name].values for name in ("q_grid", "p_grid", "hamiltonian"))
    shades = axes.contourf(q_grid, p_grid, H, levels=orbits.levels(panel), cmap=_PALE)
    axes.contour(q_grid, p_grid, H, levels=shades.levels, colors="#8795a5", linewidths=0.5)
    axes.contour(q_grid, p_grid, H, levels=panel["H"].values[:1, 0], **_SURFACE)
    bar = drawn.colorbar(shades, ax=axes, pad=0.02, fraction=0.046, aspect=28)
    bar.ax.set_title("H", fontsize=8.5, fontstyle="italic", y=1.0, pad=4)
    bar.ax.tick_params(labelsize=7.5)
    for i, leg in enumerate(orbits.legs(panel)):
        axes.plot(*leg.T, color="#4d5661", linewidth=0.6, zorder=3)
        _draw_dots(axes, panel.isel(iteration=i))
    axes.set_xlim(q_grid[0], q_grid[-1])
    axes.set_ylim(p_grid[0], p_grid[-1])
    moving = panel.attrs["component"]
    for letter, label in (("q", axes.set_xlabel), ("p", axes.set_ylabel)):
        label(f"${letter}_{'xyz'[moving]}$" if moving else letter, fontstyle="italic")
    axes.grid(visible=False)
    axes.tick_params(axis="x", pad=6)  # the labels of both axes meet in the corner
    for text, place in orbits.label_places(panel).items():
        look = {"fontsize": 7} if text.isdigit() else {"fontsize": 6.5, "bbox": _BEHIND}
        style.write_beside(axes, text, place, (0, 0), ha="center", va="center", zorder=5, **look)
    says = {"xycoords": "axes fraction", "va": "top", "linespacing": 1.4}
    style.write_beside(axes, "\n".join(orbits.statement(panel)), (0, 0), (0, -33), **says)


def _draw_dots(axes: Axes, path: xr.Dataset) -> None:
    q, p, drift, kick = (path[name].values for name in ("q", "p", "next_drift_sign", "next_kick_sign"))
    for x, y, drifts_back, kicks_back in zip(q[1:-1], p[1:-1], drift[1:-1] < 0, kick[1:-1] < 0, strict=True):
        for layer, marker in enumerate(_DOTS[bool(drifts_back), bool(kicks_back)][1]):
            axes.plot(x, y, linestyle="none", zorder=4 + layer / 10, **marker)
    axes.plot(q[:1], p[:1], linestyle="none", zorder=3.5, **_INITIAL)
    axes.plot(q[-1:], p[-1:], linestyle="none", zorder=3.6, **_FINAL)


def _legend_entries() -> list[tuple[str, Any]]:
    """Text and handle of each entry; a handle of markers is a tuple of them, drawn over each other."""
    looks = [("initial position", (_INITIAL,)), ("final position", (_FINAL,)), *_DOTS.values()]
    entries: list[tuple[str, Any]] = [
        (says, tuple(Line2D([], [], linestyle="none", **marker) for marker in markers)) for says, markers in looks
    ]
    surface = Line2D([], [], color=_SURFACE["colors"], linestyle=_SURFACE["linestyles"][0], linewidth=1.0)
    return [*entries[:2], ("energy surface of the start", surface), *entries[2:]]
