"""Reduction of the errors by amplitude: ``max_energy_error`` over (roles, amplitude, integrator, tau_per_stage).

No integration depends on this module.
"""

from __future__ import annotations

import xarray as xr

from nearharmonic.output.dataset import described
from nearharmonic.reproduction.tasks.reduction import Reductions

reduction = Reductions()

#: Step size per stage at which methods are compared: errors far above rounding, and below all step-size resonances.
COMPARED_AT = 0.05
#: The method that others are measured by.
YARDSTICK = "ruth"


@reduction("max_energy_error", over="tau_per_stage")
def relative_error(runs: xr.Dataset) -> xr.DataArray:
    """Errors over the yardstick's at the same amplitude; NaN if that is not among the methods."""
    errors = runs.max_energy_error.sel(tau_per_stage=COMPARED_AT, method="nearest", drop=True)
    yardstick = errors.reindex(integrator=[YARDSTICK]).sel(integrator=YARDSTICK, roles="own", drop=True)
    text = f"max_energy_error at tau/s = {COMPARED_AT:g} over that of {YARDSTICK} in its own roles"
    ratio: xr.DataArray = errors / yardstick.reset_coords(drop=True)
    return ratio.assign_attrs(described(text))
