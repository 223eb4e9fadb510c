"""Reductions of the Henon-Heiles ensembles: an ``xarray.Dataset`` of all methods in, numbers for the cube out.

It has ``escaped`` over (integrator, energy, tau_per_stage), and ``energy_error`` over quantile as well. These two are
distributions over the trajectories, taken in the jobs that integrate: the errors of all trajectories would be 34 MB a
method.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.output.store import described
from nearharmonic.output.table import Table
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic_paper.experiments.stability.ensembles import read_runs
from nearharmonic_paper.experiments.stability.settings import EnsembleSettings
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

#: A step size is trusted if at most this fraction of trajectories escapes.
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


def reduce(integrators: Sequence[str], settings: EnsembleSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = henon_heiles_cube(read_runs(integrators, runs))
    return {"cube": cube, "table": henon_heiles_table(cube)}


def henon_heiles_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return maps over (integrator, energy, tau_per_stage), and their reductions."""
    return runs.assign(reduction.of(runs, over="tau_per_stage"))
