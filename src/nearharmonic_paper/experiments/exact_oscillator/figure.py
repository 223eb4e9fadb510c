"""Figures of energy error against amplitude: exactly solved oscillator, and splitting into T and V."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from nearharmonic.plotting.profile import problem_of
from nearharmonic.plotting.style import (
    house_style,
    lettered,
    log_scale,
    method_handles,
    new_figure,
    panel_letter,
    style_of,
)

DASHES = (0, (4, 1.6))
SHADE = "#e3e3e3"


@house_style
def exact_oscillator_error(cube: xr.Dataset) -> Figure:
    """Draw ``energy_error`` and ``exact_energy_error`` (median, charge 1) of ``cube`` against energy."""
    taus = cube["tau_per_stage"].values
    drawn, grid = _panels(len(taus), max(7.8, 1.2 + 3.3 * len(taus)), 5.1, top=0.9, bottom=0.27)
    for i, (axes, tau) in enumerate(zip(grid, taus, strict=True)):
        _draw(axes, cube.sel(tau_per_stage=tau, charge=1.0, quantile=0.5))
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}
        title = lettered(i, _title(cube, tau))
        axes.text(0.025, 0.97, title, transform=axes.transAxes, va="top", fontsize=9, bbox=box, zorder=4)
    grid[0].set_ylabel(r"median of $\max\,|\Delta H/H_0|$")
    _legend(drawn, cube)
    return drawn


def _title(cube: xr.Dataset, tau: float) -> str:
    return ", ".join(filter(None, (rf"$\tau/s = {tau:g}$", "Hénon-Heiles system", problem_of(cube))))


def _panels(count: int, width: float, height: float, **margins: float) -> tuple[Figure, Any]:
    """A figure with a row of panels that share their y axis."""
    drawn = new_figure(width, height)
    drawn.subplots_adjust(left=0.62 / width, right=0.985, wspace=0.06, **margins)
    return drawn, drawn.subplots(1, count, sharey=True, squeeze=False)[0]


def _draw(axes: Axes, one: xr.Dataset) -> None:
    energy = one["energy"].values
    for x in range(one["exact_integrator"].size):
        bounds = one["best_crossing_interval"].values[x]
        if np.isfinite(bounds).all() and (bounds > 0).all():
            axes.axvspan(*bounds, color=SHADE, linewidth=0, zorder=0)
            colour = style_of(str(one["exact_integrator"].values[x])).colour
            axes.axvline(one["best_crossing"].values[x], color=colour, linewidth=0.8, linestyle=":", zorder=1)
    for dimension, errors, changes in (
        ("integrator", "energy_error", {}),
        ("exact_integrator", "exact_energy_error", {"linestyle": DASHES}),
    ):
        for i, name in enumerate(one[dimension].values):
            axes.plot(energy, one[errors].values[i], **style_of(str(name)).line(markersize=3.6, **changes))
    log_scale(axes, "xy")
    axes.set_xlim(energy[0] / 1.15, energy[-1] * 1.15)
    axes.set_xlabel(r"energy $H$")
    amplitude_and_energy: Any = (lambda H: np.sqrt(2 * np.abs(H)), lambda a: a * a / 2)
    above = axes.secondary_xaxis("top", functions=amplitude_and_energy)
    above.set_xlabel(r"amplitude $\sqrt{2H}$", labelpad=3)
    axes.tick_params(axis="x", which="both", top=False)


def _legend(drawn: Figure, cube: xr.Dataset) -> None:
    """Draw the legend with solid methods on the left, dashed ones on the right."""
    split = method_handles(cube["integrator"].values, cube["label"].values)
    exact = method_handles(cube["exact_integrator"].values, cube["exact_label"].values, linestyle=DASHES)
    for handles, title, at, columns in (
        (split, "split into T + V", 0.3, 4),
        ([*exact, Patch(color=SHADE, label="95 % interval of a crossing")], "oscillator solved exactly", 0.79, 2),
    ):
        drawn.legend(
            handles=handles, title=title, loc="upper center", bbox_to_anchor=(at, 0.175), ncols=columns,
            columnspacing=1.0, handlelength=2.1, borderaxespad=0, fontsize=8, title_fontsize=9,
        )  # fmt: skip


@house_style
def exact_oscillator_charge(cube: xr.Dataset) -> Figure:
    """Draw ``best_crossing`` of ``cube`` as amplitudes against the charge, a panel for each step size."""
    taus = cube["tau_per_stage"].values
    drawn, grid = _panels(len(taus), 1.2 + 3.0 * len(taus), 3.6, top=0.91, bottom=0.25)
    for i, (axes, tau) in enumerate(zip(grid, taus, strict=True)):
        one = cube.sel(tau_per_stage=tau)
        for x, name in enumerate(one["exact_integrator"].values):
            energy, bounds = one["best_crossing"].values[:, x], one["best_crossing_interval"].values[:, x]
            amplitude = np.where((energy > 0) & np.isfinite(energy), np.sqrt(2 * energy), np.nan)
            look = style_of(str(name))
            inside = np.where(np.isfinite(bounds) & (bounds > 0), np.sqrt(2 * np.abs(bounds)), np.nan)
            axes.fill_between(one["charge"].values, *inside.T, color=look.colour, alpha=0.22, linewidth=0)
            axes.plot(one["charge"].values, amplitude, **look.line(linestyle=DASHES))
        log_scale(axes, "y")
        axes.set_xlim(float(one["charge"].values[0]) - 0.04, float(one["charge"].values[-1]) + 0.04)
        axes.set_xlabel("cost of an evaluation over T + V")
        panel_letter(axes, i, _title(cube, tau))
    grid[0].set_ylabel(r"amplitude of crossing, $\sqrt{2H}$")
    crossing = cube["best_crossing"].values
    seen = cube.isel(exact_integrator=np.any((crossing > 0) & np.isfinite(crossing), axis=(0, 1)))
    exact = method_handles(seen["exact_integrator"].values, seen["exact_label"].values, linestyle=DASHES)
    drawn.legend(handles=exact, loc="lower center", ncols=5, columnspacing=1.4, handlelength=2.6)
    return drawn
