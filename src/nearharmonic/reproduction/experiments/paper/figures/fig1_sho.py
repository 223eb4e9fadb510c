"""Figure 1: energy error of the simple harmonic oscillator against tau/s, in double and extended precision."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile
from nearharmonic.reproduction.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@figure(
    cube="sho",
    target="fig1",
    profile=True,
    caption=(
        "Benchmark profile for the simple harmonic oscillator, t in [0, 500]: largest (A) and mean (B) relative "
        "energy error over every step of a run, against step size per stage tau/s; each point is a whole run. Solid "
        "lines with markers: double precision with compensated summation; dashed lines of the same colour: extended "
        "precision (double-double), which goes on below the rounding floor of a double. Filled markers are the "
        "methods of Nielsen (2015): their slope is 6, although their general order is 4. A curve ends where the "
        "method becomes unstable."
    ),
)
def fig1_sho(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of ``cube``."""
    return draw_profile(cube)
