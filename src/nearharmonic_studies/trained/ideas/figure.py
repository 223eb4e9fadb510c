"""The figure of ideas: gains against anharmonicity, and a map of the best idea."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from nearharmonic.plotting.style import house_style, log_scale, new_figure, panel_letter

#: Name, colour and marker of each idea.
LOOKS = {
    "exact_oscillator": ("oscillator solved exactly, not trained", "#2f7fd6", "D"),
    "trained_exact": ("oscillator solved exactly, trained", "#0d2f6e", "P"),
    "harmonic_conditions": ("harmonic conditions", "#e08214", "s"),
    "nystrom": ("Nyström, order 6 and 8", "#1b7837", "^"),
    "trained": ("trained with T and V", "#c1121f", "o"),
    "general": ("general (Blanes-Moan, ABA, ...)", "#6b6b6b", "v"),
}
#: Number of panels of gains, and lead in decades with full colour in the map.
PANELS, FULL = 3, 0.8
#: Minimum colour saturation of a leader.
PALEST = 0.22


@house_style
def trained_ideas(cube: xr.Dataset) -> Figure:
    """Draw ``gain`` of ``cube`` against anharmonicity at three step sizes, and ``leader`` over both."""
    drawn = new_figure(9.2, 10.2)
    places = np.unique(np.linspace(0, cube["tau_per_stage"].size - 1, PANELS + 2).round().astype(int))
    shown = places[1:-1][:PANELS] if places.size > PANELS + 1 else places[:PANELS]
    width = 0.92 / len(shown)
    top = [drawn.add_axes((0.065 + k * width, 0.695, width - 0.015, 0.235)) for k in range(len(shown))]
    for k, (axes, place) in enumerate(zip(top, shown[::-1], strict=True)):
        one = cube.isel(tau_per_stage=place)
        _gains(axes, one)
        panel_letter(axes, k, rf"$\tau/s = {float(one['tau_per_stage']):g}$ rad")
    low, high = (f([axes.get_ylim()[k] for axes in top]) for k, f in ((0, min), (1, max)))
    for k, axes in enumerate(top):
        axes.set_ylim(low, high)
        axes.tick_params(labelleft=k == 0)
    top[0].set_ylabel("gain over general methods (decades)")
    says = ("", "which idea is ahead, and by how many decades"), ("_split", "the same where H is split into T and V")
    for k, (suffix, text) in enumerate(says):
        below = drawn.add_axes((0.065, 0.365 - 0.31 * k, 0.905, 0.265))
        _map(below, cube, suffix)
        panel_letter(below, len(shown) + k, text)
    below.set_xlabel(r"anharmonicity: median variation $\delta$ of the Hessian along the orbits", labelpad=2)
    handles = [
        Line2D([], [], color=colour, marker=marker, markersize=4, label=label)
        for label, colour, marker in LOOKS.values()
    ]
    drawn.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.52, 0.999), ncols=3, columnspacing=1.6)
    return drawn


def _gains(axes: Axes, one: xr.Dataset) -> None:
    delta = one["anharmonicity"].values[:, 1]
    for idea in map(str, one["idea"].values):
        _, colour, marker = LOOKS[idea]
        values, bounds = (one[key].sel(idea=idea).values for key in ("gain", "gain_interval"))
        axes.fill_between(delta, *bounds.T, color=colour, alpha=0.2, linewidth=0)
        axes.plot(delta, values, color=colour, marker=marker, markersize=3.4)
    log_scale(axes, "x")
    axes.set_xlabel(r"anharmonicity $\delta$", labelpad=1)


def _map(axes: Axes, cube: xr.Dataset, suffix: str) -> None:
    """Draw the leader of each cell of ``cube``, from the variables with this suffix."""
    lead, leader = cube[f"lead{suffix}"].values, cube[f"leader{suffix}"].values
    colours = np.ones((*lead.shape, 3))
    for (t, j), name in np.ndenumerate(leader):
        if np.isfinite(lead[t, j]):
            depth = PALEST + (1 - PALEST) * float(np.clip(lead[t, j] / FULL, 0, 1))
            colours[t, j] = 1 - depth * (1 - np.array(to_rgb(LOOKS[str(name)][1])))
            dark = colours[t, j] @ (0.3, 0.59, 0.11) < 0.5
            axes.text(j, t, f"{lead[t, j]:.1f}", ha="center", va="center", fontsize=7, color="w" if dark else "k")
    axes.imshow(colours, aspect="auto", origin="lower")
    delta = cube["anharmonicity"].values[:, 1]
    axes.set_xticks(range(len(delta)), [f"{x:.2g}" for x in delta], fontsize=8)
    axes.set_yticks(range(len(lead)), [f"{x:g}" for x in cube["tau_per_stage"].values], fontsize=8)
    axes.grid(visible=False)
    axes.set_ylabel(r"$\tau/s$ (rad)", labelpad=2)
