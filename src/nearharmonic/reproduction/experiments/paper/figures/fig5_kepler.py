"""Figure 5: energy error of the Sun-Mercury system over ten years against tau/s in hours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile
from nearharmonic.reproduction.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@figure(
    cube="kepler",
    target="fig5",
    profile=True,
    caption=(
        "Benchmark profile for the planar Sun-Mercury system over ten years (87 660 h): largest (A) and mean (B) "
        "relative energy error over every step of a run, against step size per stage tau/s in hours; each point is a"
        " whole run in double precision with compensated summation. The largest error comes at perihelion passages, "
        "so the two panels rank the methods differently. A curve ends where runs leave their energy surface."
    ),
)
def fig5_kepler(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of ``cube``."""
    return draw_profile(cube)
