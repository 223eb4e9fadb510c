"""Growth of round-off over long times: energy and lag along the track, compared with Brouwer's law."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, log_scale, method_handles, new_figure, panel_letter, style_of

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
        _draw_growth(upper[column], cube, names, variable, sources)
        _draw_law(upper[column], cube, variable, exponent)
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


def _draw_growth(axes: Axes, cube: xr.Dataset, names: list[str], variable: str, sources: tuple[str, ...]) -> None:
    for name in names:
        for source in sources:
            rms = cube[f"{variable}_rms"].sel(integrator=name, source=source).values
            axes.plot(
                cube["time"].sel(integrator=name).values,
                rms,
                **style_of(name).line(marker="none", linestyle=_LINES[source], linewidth=0.9),
            )
    log_scale(axes, "xy")
    axes.set_xlabel("time  (periods)")


def _draw_law(axes: Axes, cube: xr.Dataset, variable: str, exponent: float) -> None:
    """Draw Brouwer's power law, six times above the middle of each bundle of curves so that it does not hide them."""
    time = cube["time"].isel(integrator=-1).values
    for source in ("plain", "compensated", "extended"):
        level = np.exp(np.log(cube[f"{variable}_rms"].sel(source=source).isel(sample=-1)).mean().item())
        law = 6 * level * (time / time[-1]) ** exponent
        axes.plot(time, law, color="#8a8a8a", linewidth=1.6, zorder=1.5)


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
