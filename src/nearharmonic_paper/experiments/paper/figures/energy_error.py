"""Benchmark profiles: energy errors against tau/s of any system, and of the systems of Figures 1, 3 and 5."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.plotting.energy_error import draw_profile

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def energy_error(cube: xr.Dataset) -> Figure:
    """Draw the energy errors of any system."""
    return draw_profile(cube)
