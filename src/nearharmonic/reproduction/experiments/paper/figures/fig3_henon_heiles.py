"""Figure 3: energy error of the Henon-Heiles system against tau/s."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile
from nearharmonic.reproduction.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@figure(
    cube="henon_heiles",
    target="fig3",
    profile=True,
    caption=(
        "Benchmark profile for the Hénon-Heiles system at H = 1/8, t in [0, 500]: largest (A) and mean (B) relative "
        "energy error over every step of a run, against step size per stage tau/s; each point is a whole run in "
        "double precision with compensated summation. Where the steps are large, methods solved for the harmonic "
        "oscillator (filled markers) fall faster than their order 4, as the system is then close to an oscillator. A"
        " curve ends where runs leave their energy surface."
    ),
)
def fig3_henon_heiles(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of ``cube``."""
    return draw_profile(cube)
