"""The benchmark profile of every system that has no figure of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile
from nearharmonic.reproduction.tasks.declarations import figure

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


@figure(
    cube="{system}",
    profile=True,
    caption=(
        "Benchmark profile: largest (A) and mean (B) relative energy error over every step of a run, against step "
        "size per stage tau/s; each point is a whole run. Dashed lines, if any, are in extended precision. A curve "
        "ends where runs leave their energy surface. Filled markers are the methods of Nielsen (2015)."
    ),
)
def energy_error(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of any system."""
    return draw_profile(cube)
