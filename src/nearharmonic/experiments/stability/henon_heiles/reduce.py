"""From the ensembles of each method to one cube: the trusted step sizes, and the linear limits beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.experiments.stability.ensembles import stacked
from nearharmonic.experiments.stability.henon_heiles.run import TOLERATED
from nearharmonic.experiments.stability.henon_heiles.tables import henon_heiles_table
from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import described, variable
from nearharmonic.output.store import read
from nearharmonic.theory.linear_stability import stability_limit

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.experiments.stability.settings import EnsembleSettings


def reduce(integrators: Sequence[str], settings: EnsembleSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` of the ensembles and its ``table``.

    Parameters
    ----------
    integrators : sequence of str
        Names of the methods, in the order of the cube.
    settings : EnsembleSettings
        What the runs were asked; it goes into the files beside the numbers.
    **runs : str
        Path of the run file of each method.
    """
    methods = [registry[name] for name in integrators]
    cube = henon_heiles_cube(methods, {name: read(path) for name, path in runs.items()})
    return {"cube": cube, "table": henon_heiles_table(cube)}


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
