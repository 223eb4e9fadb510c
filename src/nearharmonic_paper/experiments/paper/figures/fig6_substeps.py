"""Figure 6: substeps of two methods in phase space, coloured by the signs of the next coefficients."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, new_figure, panel_letter
from nearharmonic_paper.experiments.paper.orbits.substeps import paper_panels

if TYPE_CHECKING:
    import xarray as xr

_BLUE, _RED, _GREEN = "#0b5fb5", "#d7301f", "#1a9850"
_PALE = LinearSegmentedColormap.from_list("pale", ["#ffffff", "#b9c3cf"])
_LEVELS = 12


def _mark(marker: str, colour: str, size: float, **more: Any) -> dict[str, Any]:
    return {"marker": marker, "color": colour, "markersize": size, **more}


#: (next drift negative, next kick negative) -> meaning, and markers drawn over each other.
_DOTS: dict[tuple[bool, bool], tuple[str, tuple[dict[str, Any], ...]]] = {
    (False, False): ("next c, d ≥ 0", (_mark("o", _BLUE, 5),)),
    (True, False): ("next c < 0", (_mark("o", _RED, 8), _mark("_", "white", 5, markeredgewidth=1.4))),
    (False, True): ("next d < 0", (_mark("o", _GREEN, 7), _mark("|", "white", 5, markeredgewidth=1.4))),
    (True, True): (
        "next c, d < 0",
        (_mark("o", _RED, 9), _mark("o", _GREEN, 5, markeredgecolor="white", markeredgewidth=0.9)),
    ),
}
_INITIAL = _mark("o", _BLUE, 10, markerfacecolor="none", markeredgewidth=1.6)
_FINAL = _mark("x", _BLUE, 9, markeredgewidth=2.0)

_BOX: dict[str, Any] = {"boxstyle": "round,pad=0.3", "facecolor": "white", "edgecolor": "#8795a5", "linewidth": 0.5}
_SURFACE: dict[str, Any] = {"colors": "#1f2d3d", "linewidths": 1.0, "linestyles": [(0, (5, 3))]}


@house_style
def fig6_substeps() -> Figure:
    """Draw the four panels of the paper."""
    return draw_panels(paper_panels())


@house_style
def draw_panels(panels: Mapping[str, xr.Dataset]) -> Figure:
    """Draw each Dataset of ``experiments.paper.substeps.substeps`` in a panel of its letter, two in a row."""
    rows = (len(panels) + 1) // 2
    height = 0.7 + 3.3 * rows
    drawn = new_figure(7.6, height)
    drawn.subplots_adjust(left=0.08, right=0.955, top=1 - 0.85 / height, bottom=0.07, hspace=0.3, wspace=0.28)
    grid = drawn.subplots(rows, 2, squeeze=False).ravel()
    for axes, (letter, panel) in zip(grid, panels.items(), strict=False):
        _draw_panel(drawn, axes, panel)
        panel_letter(axes, letter, f"{panel.attrs['label']}, {panel.attrs['system_label']}")
    for axes in grid[len(panels) :]:
        axes.set_axis_off()
    labels, handles = zip(*_legend_entries(), strict=True)
    drawn.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.998), ncols=3, columnspacing=2.0)
    return drawn


def _draw_panel(drawn: Figure, axes: Axes, panel: xr.Dataset) -> None:
    q_grid, p_grid, H = (panel[name].values for name in ("q_grid", "p_grid", "hamiltonian"))
    shades = axes.contourf(q_grid, p_grid, H, levels=_LEVELS, cmap=_PALE)
    axes.contour(q_grid, p_grid, H, levels=shades.levels, colors="#8795a5", linewidths=0.5)
    axes.contour(q_grid, p_grid, H, levels=panel["H"].values[:1, 0], **_SURFACE)
    bar = drawn.colorbar(shades, ax=axes, pad=0.02, fraction=0.046, aspect=28)
    bar.ax.set_title("$H$", fontsize=8.5, pad=4)
    bar.ax.tick_params(labelsize=7.5)
    legs = "steps-post" if panel.attrs["first"] == "drift" else "steps-pre"
    for iteration in panel["iteration"].values:
        _draw_iteration(axes, panel.sel(iteration=iteration), legs)
    axes.set_xlim(q_grid[0], q_grid[-1])
    axes.set_ylim(p_grid[0], p_grid[-1])
    moving = rf"_{'xyz'[panel.attrs['component']]}" if panel.attrs["component"] else ""
    axes.set_xlabel(f"$q{moving}$")
    axes.set_ylabel(f"$p{moving}$")
    axes.grid(visible=False)
    for says, place, ha, va in (
        (_energy_statement(panel), (0.03, 0.03), "left", "bottom"),
        (rf"$\tau$ = {panel.attrs['tau']:.4g}", (0.97, 0.97), "right", "top"),
    ):
        axes.annotate(
            says, place, xycoords="axes fraction", ha=ha, va=va, fontsize=7.5, linespacing=1.5, bbox=_BOX, zorder=7
        )  # fmt: skip


def _energy_statement(panel: xr.Dataset) -> str:
    iterations = panel.sizes["iteration"]
    error = abs(float(panel["energy_error"].values[-1, -1]))
    left_at, followed = int(panel["left_at"]), int(panel.attrs["followed"])
    later = (
        f"leaves its energy surface at iteration {left_at}"
        if left_at
        else rf"up to {_scientific(float(panel['max_energy_error']))} in {followed} iterations"
    )
    return rf"$|\Delta H/H_0|$ = {_scientific(error)} after {iterations} iterations," + "\n" + later


def _scientific(number: float) -> str:
    if not isfinite(number):  # the path has overflowed
        return r"$\infty$"
    mantissa, exponent = f"{number:.1e}".split("e")
    return rf"${mantissa}\times10^{{{int(exponent)}}}$"


def _draw_iteration(axes: Axes, path: xr.Dataset, legs: str) -> None:
    q, p = path["q"].values, path["p"].values
    axes.plot(q, p, color="#4d5661", linewidth=0.6, drawstyle=legs, zorder=3)
    signs = zip(path["next_drift_sign"].values, path["next_kick_sign"].values, strict=True)
    kinds = [str(kind) for kind in path["kind"].values]
    for x, y, kind, (drift, kick) in zip(q, p, kinds, signs, strict=True):
        if kind == "substep":
            for layer, marker in enumerate(_DOTS[bool(drift < 0), bool(kick < 0)][1]):
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
