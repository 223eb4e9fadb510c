"""Gain over Ruth's method: the energy error of Ruth's method, divided by the error of another method at equal cost.

Equal step sizes per stage, tau/s, cost equal work. The static and the interactive figure show the same numbers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from nearharmonic.output.store import double_runs

if TYPE_CHECKING:
    import xarray as xr

#: Method that others are compared with.
REFERENCE = "ruth"
#: Errors below ten roundings of a double contain rounding. Above an error of 1 %, Ruth's run is not a solution.
SMALLEST, LARGEST = 2e-15, 1e-2


def gains(cube: xr.Dataset, variable: str) -> xr.DataArray:
    """Return the gain of each method of ``cube`` in an energy error, over (integrator, tau_per_stage).

    It is NaN where one of the two errors is below :data:`SMALLEST`, where a run diverged, and from the first step size
    on at which Ruth's error is above :data:`LARGEST`.
    """
    errors = double_runs(cube)[variable]
    reference = errors.sel(integrator=REFERENCE).reset_coords(drop=True)
    useful = (reference > LARGEST).cumsum("tau_per_stage") == 0
    measured = errors.where((errors > SMALLEST) & (errors < float("inf")) & useful)
    return (measured.sel(integrator=REFERENCE).reset_coords(drop=True) / measured).transpose(*errors.dims)
