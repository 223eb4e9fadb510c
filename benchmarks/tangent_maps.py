"""Chaos on the surface of section of Henon and Heiles: quantiles of exponents, and a map of them.

Run: ``python benchmarks/tangent_maps.py``; ``--page`` writes table and figure to ``docs/how_to/tangent_maps.md``.
Nothing is timed.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np
from timing import fill

from nearharmonic.engine.tangent import tangent
from nearharmonic.numerics.portable import Floats
from nearharmonic.plotting.style import house_style, new_figure, panel_letter
from nearharmonic_paper.pages.filling import table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, PICTURE = "docs/how_to/tangent_maps.md", "tangent_maps.svg"
#: Energies of the panels, as in Figures 5 and 6 of Henon & Heiles (1964), doi:10.1086/109234.
ENERGIES = (Fraction(1, 8), Fraction(1, 6))
#: Points of a panel along each axis, edges of both axes (all starts of the energy 1/6 are inside), and the time.
SIZE, EDGES, T_END = 512, ((-0.5, 1.0), (-0.6, 0.6)), 1000
#: MEGNO above which an orbit counts as chaotic. It is 2 for a regular orbit, with oscillations that decay like 1/t, and
#: exceeds 4 after eight Lyapunov times.
CHAOTIC = 4.0
#: Exponents at both ends of the colours; a regular orbit's falls like (ln t)/t, which is 0.007 at the end. The
#: number of colours: with a continuous map the picture of so many points is twice as large.
EXPONENTS, COLOURS = (0.003, 0.15), 17


def parts():
    """Chaos on the surface of section of Henon and Heiles: quantiles of exponents, and a map of them."""
    rows, images = [], {}
    for energy in ENERGIES:
        runs, images[energy] = chaos(energy)
        last, errors = runs.isel(sample=-1), runs.max_energy_error.values
        exponent, chaotic = last.lyapunov_exponent.values, last.megno.values > CHAOTIC
        spread = np.quantile(exponent[chaotic], [0.1, 0.5, 0.9])
        regular, error = np.median(last.megno.values[~chaotic]), errors[np.isfinite(errors)].max()
        share = f"{round(100 * chaotic.sum() / chaotic.size)} %"
        rows.append((energy, chaotic.size, share, *(f"{x:.3f}" for x in spread), f"{regular:.2f}", f"{error:.0e}"))
    heads = ("H", "starts", "chaotic", "exponent, lowest tenth", "median", "highest tenth", "MEGNO of the others")
    return {"chaos": table((*heads, "largest energy error"), rows), "figure": chaos_drawn(images)}


def chaos(energy: Fraction) -> tuple[Any, Floats]:
    """Orbits of an energy from a grid of y and p_y with x = 0 and p_x > 0, and the exponents on it, NaN outside."""
    y, momentum = np.meshgrid(*(low + (high - low) * (np.arange(SIZE) + 0.5) / SIZE for low, high in EDGES))
    square = 2 * float(energy) - momentum**2 - y**2 + 2 * y**3 / 3
    inside = (square > 0) & (y < 1)  # beyond y = 1 the potential falls again
    q0 = np.stack([0 * y[inside], y[inside]], axis=1)
    p0 = np.stack([np.sqrt(square[inside]), momentum[inside]], axis=1)
    runs = tangent("henon_heiles", "babps8o7h", 0.5, t_end=T_END, samples=11, deviations=1, q0=q0, p0=p0)
    image = np.full(y.shape, np.nan)
    image[inside] = np.clip(runs.lyapunov_exponent.values[:, -1], *EXPONENTS)
    return runs, image


@house_style
def chaos_drawn(images: Mapping[Fraction, Floats]) -> Figure:
    """Draw the starts of each energy in a panel, coloured by the largest exponent on a logarithmic scale."""
    from matplotlib import colormaps
    from matplotlib.colors import LogNorm

    figure = new_figure(7, 3.5)
    figure.subplots_adjust(left=0.09, right=0.865, top=0.92, bottom=0.14, wspace=0.08)
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for position, (axes, (energy, image)) in enumerate(zip(panels, images.items(), strict=True)):
        drawn = axes.imshow(
            image, origin="lower", extent=(*EDGES[0], *EDGES[1]), norm=LogNorm(*EXPONENTS),
            cmap=colormaps["viridis"].resampled(COLOURS), interpolation="nearest", aspect="auto",
        )  # fmt: skip
        axes.set(xlabel="$y$", xlim=EDGES[0], ylim=EDGES[1], xticks=[-0.25, 0, 0.25, 0.5, 0.75])
        axes.grid(visible=False)
        panel_letter(axes, position, f"$H = {energy}$")
    panels[0].set_ylabel("$p_y$")
    bar = figure.colorbar(drawn, cax=figure.add_axes((0.88, 0.14, 0.018, 0.78)))
    bar.set_ticks(ticks := [0.003, 0.01, 0.03, 0.1], labels=list(map(str, ticks)))
    bar.minorticks_off()
    bar.set_label("Lyapunov exponent at t = 1000")
    return figure


if __name__ == "__main__":
    fill(__doc__, parts, PAGE, PICTURE)
