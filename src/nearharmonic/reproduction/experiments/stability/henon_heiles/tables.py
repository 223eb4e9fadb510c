"""The table of the Henon-Heiles ensembles: how large a step may be trusted, and the errors there."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.stability.henon_heiles.reductions import TOLERATED

if TYPE_CHECKING:
    import xarray as xr

CAPTION = f"Henon-Heiles ensembles: largest tau/s up to which at most {TOLERATED:.0%} of the trajectories escape."


def henon_heiles_table(cube: xr.Dataset) -> Table:
    """Return a row for each method and energy surface: the largest trusted step size and the errors there."""
    header = [
        "integrator", "energy", "linear_limit_tau_per_stage", f"tau_per_stage_escaped_up_to_{TOLERATED:g}",
        "median_energy_error_there", "worst_energy_error_there", "share_of_linear_limit",
    ]  # fmt: skip
    rows: list[list[Any]] = []
    for name, energy in product(cube.integrator.values, cube.energy.values):
        one = cube.sel(integrator=name, energy=energy)
        limit, trusted = one.linear_limit.item(), one.trusted_up_to.item()
        errors = [np.nan, np.nan]
        if np.isfinite(trusted):
            errors = [one.energy_error.sel(tau_per_stage=trusted, quantile=q).item() for q in (0.5, 1.0)]
        rows.append([str(name), float(energy), limit, trusted, *errors, trusted / limit])
    return Table(header=header, rows=rows, caption=CAPTION)
