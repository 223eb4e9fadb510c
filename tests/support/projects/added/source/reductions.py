"""Numbers of the cube."""

from __future__ import annotations

import xarray as xr

from nearharmonic.output.store import described
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()


@reduction("q", "p", over="tau")
def energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Energy error of one step, relative to H = 1/2."""
    return abs(runs.q**2 + runs.p**2 - 1).assign_attrs(described("|H - H0|/|H0| after one step"))
