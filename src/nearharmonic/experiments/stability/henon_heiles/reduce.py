"""From the ensembles of each method to one cube: the trusted step sizes, and the linear limits beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.experiments.stability.ensembles import cube_and_table, stacked
from nearharmonic.experiments.stability.henon_heiles.run import TOLERATED
from nearharmonic.experiments.stability.henon_heiles.tables import henon_heiles_table
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import described, variable
from nearharmonic.theory.linear_stability import stability_limit

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.experiments.stability.settings import EnsembleSettings


def reduce(integrators: Sequence[str], settings: EnsembleSettings, **runs: str) -> dict[str, Any]:
    """Return what :func:`cube_and_table` does; ``settings`` go into the files beside the numbers."""
    return cube_and_table(henon_heiles_cube, henon_heiles_table, integrators, runs)


def henon_heiles_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return maps over (integrator, energy, tau_per_stage), the trusted step sizes and the linear limits.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        What :func:`~nearharmonic.experiments.stability.henon_heiles.run.ensemble_map` found of each, by name.
    """
    cube = stacked(methods, runs)
    cube["trusted_up_to"] = trusted_up_to(cube)
    limits = [float(stability_limit(method)) / method.stages for method in methods]
    text = "step size per stage at which the harmonic oscillator is first unstable"
    cube["linear_limit"] = variable("integrator", limits, text)
    return cube


def trusted_up_to(cube: xr.Dataset) -> xr.DataArray:
    """Return the largest step size per stage up to which, over the grid, no more than :data:`TOLERATED` escapes.

    Parameters
    ----------
    cube : xarray.Dataset
        ``escaped`` over tau_per_stage and any other dimensions.

    Returns
    -------
    xarray.DataArray
        NaN where too many escape at the smallest step size.
    """
    kept = (cube.escaped <= TOLERATED).cumulative("tau_per_stage").min().astype(bool)
    limit: xr.DataArray = cube.tau_per_stage.where(kept).max("tau_per_stage")
    return limit.assign_attrs(described(f"largest step size per stage up to which at most {TOLERATED:g} escapes"))
