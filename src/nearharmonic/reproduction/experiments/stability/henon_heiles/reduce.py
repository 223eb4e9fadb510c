"""From the ensembles of each method to one cube and its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.experiments.stability.ensembles import cube_and_table, stacked
from nearharmonic.reproduction.experiments.stability.henon_heiles.reductions import reduction
from nearharmonic.reproduction.experiments.stability.henon_heiles.tables import henon_heiles_table

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.reproduction.experiments.stability.settings import EnsembleSettings


def reduce(integrators: Sequence[str], settings: EnsembleSettings, **runs: str) -> dict[str, Any]:
    """Return what :func:`cube_and_table` does; ``settings`` go into the files beside the numbers."""
    return cube_and_table(henon_heiles_cube, henon_heiles_table, integrators, runs)


def henon_heiles_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return maps over (integrator, energy, tau_per_stage), and their reductions.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        What :func:`~nearharmonic.reproduction.experiments.stability.henon_heiles.run.ensemble_map` found of each, by
        name.
    """
    cube = stacked(methods, runs)
    return cube.assign(reduction.of(cube, over="tau_per_stage"))
