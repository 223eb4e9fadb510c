"""Reductions of the Henon-Heiles ensembles: an ``xarray.Dataset`` of all methods in, numbers for the cube out.

It has ``escaped`` over (integrator, energy, tau_per_stage), and ``energy_error`` over quantile as well. These two are
distributions over the trajectories, taken in the jobs that integrate: the errors of all trajectories would be 34 MB a
method. No integration depends on this module.
"""

from __future__ import annotations

import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.output.dataset import described
from nearharmonic.reproduction.tasks.reduction import Reductions
from nearharmonic.theory.linear_stability import stability_limit

reduction = Reductions()

#: A step size is trusted as long as at most this fraction escapes at it.
TOLERATED = 0.01


@reduction("escaped", over="tau_per_stage")
def trusted_up_to(cube: xr.Dataset) -> xr.DataArray:
    """Largest step size per stage up to which, over the grid, no more than :data:`TOLERATED` escapes; NaN if none."""
    kept = (cube.escaped <= TOLERATED).cumulative("tau_per_stage").min().astype(bool)
    limit: xr.DataArray = cube.tau_per_stage.where(kept).max("tau_per_stage")
    return limit.assign_attrs(described(f"largest step size per stage up to which at most {TOLERATED:g} escapes"))


@reduction("integrator", over="tau_per_stage")
def linear_limit(cube: xr.Dataset) -> xr.DataArray:
    """Step size per stage at which the harmonic oscillator is first unstable."""
    methods = [integrators[name] for name in cube.integrator.values]
    limits = [float(stability_limit(method)) / method.stages for method in methods]
    text = "step size per stage at which the harmonic oscillator is first unstable"
    found: xr.DataArray = cube.integrator.copy(data=limits)
    return found.assign_attrs(described(text))
