"""The table and the figure of docs/how_to/tangent_maps.md: chaos on the surface of section of Henon and Heiles.

Each point of the plane (y, p_y) with x = 0 and p_x > 0 is a start; its colour is the largest exponent of the orbit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.engine.tangent import tangent
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.page import filled_page, pipes
from nearharmonic.plotting.style import house_style, new_figure, panel_letter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SYSTEM, METHOD, TAU, T_END = "henon_heiles", "babps8o7h", 0.5, 1000
#: Energies of the panels, those of Figures 5 and 6 of Henon & Heiles (1964), doi:10.1086/109234.
ENERGIES = (Fraction(1, 8), Fraction(1, 6))
#: Points of a panel along each axis, and edges of both axes: all starts of the energy 1/6 are inside.
SIZE, EDGES = 512, ((-0.5, 1.0), (-0.6, 0.6))
#: MEGNO above which an orbit counts as chaotic. It is 2 for a regular orbit, with oscillations that decay like 1/t, and
#: exceeds 4 after eight Lyapunov times.
CHAOTIC = 4.0
#: Exponents at both ends of the colours. That of a regular orbit falls like (ln t)/t, which is 0.007 at the end.
SHOWN = (0.003, 0.15)
#: Number of colours: with those of a continuous map the picture of so many points is twice as large.
COLOURS = 17


class Chaos(NamedTuple):
    """Starts (N, 2) in the plane (y, p_y), with MEGNO (N,) and the largest exponent (N,) of their orbits."""

    plane: Floats
    megno: Floats
    exponent: Floats
    energy_error: float

    @property
    def chaotic(self) -> Any:
        """True for chaotic orbits (N,)."""
        return self.megno > CHAOTIC


def page(page: str, systems: Sequence[str], integrators: Sequence[str]) -> dict[str, Any]:
    """Fill the page, and draw its figure."""
    found = {energy: chaos(energy) for energy in ENERGIES}
    return {"page": filled_page(page, {"chaos": "\n".join(["", *table(found), ""])}), "figure": drawn(found)}


def grid() -> tuple[Floats, Floats]:
    """Return the centres (SIZE,) of the points along each axis."""
    centres = (np.arange(SIZE) + 0.5) / SIZE
    y, momentum = (low + (high - low) * centres for low, high in EDGES)
    return y, momentum


def chaos(energy: Fraction) -> Chaos:
    """Return the orbits of an energy that start on the grid."""
    y, momentum = (axis.ravel() for axis in np.meshgrid(*grid()))
    square = 2 * float(energy) - momentum**2 - y**2 + 2 * y**3 / 3
    inside = (square > 0) & (y < 1)  # beyond y = 1 the potential falls again
    y, momentum, square = y[inside], momentum[inside], square[inside]
    runs = tangent(
        SYSTEM, METHOD, TAU, t_end=T_END, samples=11, deviations=1, q0=np.stack([0 * y, y], axis=1),
        p0=np.stack([np.sqrt(square), momentum], axis=1),
    )  # fmt: skip
    error = runs.max_energy_error.values
    last = runs.isel(sample=-1)
    return Chaos(
        np.stack([y, momentum], axis=1), last.megno.values, last.lyapunov_exponent.values,
        float(error[np.isfinite(error)].max()),
    )  # fmt: skip


def table(found: Mapping[Fraction, Chaos]) -> list[str]:
    """Return a row for each energy: its starts, those of chaotic orbits, and quantiles of their exponents."""
    rows = []
    for energy, one in found.items():
        chaotic = one.chaotic
        share = round(100 * chaotic.sum() / chaotic.size)
        spread = np.quantile(one.exponent[chaotic], [0.1, 0.5, 0.9]) if chaotic.any() else [np.nan] * 3
        middle = np.median(one.megno[~chaotic]) if (~chaotic).any() else np.nan
        cells = [f"{x:.3f}" for x in spread]
        rows.append([str(energy), chaotic.size, f"{share} %", *cells, f"{middle:.2f}", f"{one.energy_error:.0e}"])
    names = ["H", "starts", "chaotic", "exponent, lowest tenth", "median", "highest tenth", "MEGNO of the others"]
    return pipes([*names, "largest energy error"], rows, align="lr")


@house_style
def drawn(found: Mapping[Fraction, Chaos]) -> Figure:
    """Draw the starts of each energy in a panel, coloured by the largest exponent on a logarithmic scale."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    figure = new_figure(7, 3.5)
    figure.subplots_adjust(left=0.09, right=0.865, top=0.92, bottom=0.14, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    low, high = np.array(EDGES).T
    for position, (axes, (energy, one)) in enumerate(zip(panels, found.items(), strict=True)):
        image = np.full((SIZE, SIZE), np.nan)
        columns, rows = np.rint((one.plane - low) / (high - low) * SIZE - 0.5).astype(int).T
        image[rows, columns] = np.clip(one.exponent, *SHOWN)
        shown = axes.imshow(
            image, origin="lower", extent=(*EDGES[0], *EDGES[1]), norm=LogNorm(*SHOWN),
            cmap=colormaps["viridis"].resampled(COLOURS),
            interpolation="nearest", aspect="auto",
        )  # fmt: skip
        axes.set(xlabel="$y$", xlim=EDGES[0], ylim=EDGES[1], xticks=[-0.25, 0, 0.25, 0.5, 0.75])
        axes.grid(visible=False)
        panel_letter(axes, position, f"$H = {energy}$")
    panels[0].set_ylabel("$p_y$")
    bar = figure.colorbar(shown, cax=figure.add_axes((0.88, 0.14, 0.018, 0.78)))
    bar.set_ticks(ticks := [0.003, 0.01, 0.03, 0.1], labels=list(map(str, ticks)))
    bar.minorticks_off()
    bar.set_label("Lyapunov exponent at t = 1000")
    return figure
