"""From the Kepler maps of each method to one cube and its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.experiments.stability.ensembles import cube_and_table, stacked
from nearharmonic.reproduction.experiments.stability.kepler.reductions import reduction
from nearharmonic.reproduction.experiments.stability.kepler.tables import kepler_table

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.reproduction.experiments.stability.settings import MapSettings


def reduce(integrators: Sequence[str], settings: MapSettings, **runs: str) -> dict[str, Any]:
    """Return what :func:`cube_and_table` does; ``settings`` go into the files beside the numbers."""
    return cube_and_table(kepler_cube, kepler_table, integrators, runs)


def kepler_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return maps over (integrator, tau_per_stage, eccentricity), and their reductions; states are left out.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        What :func:`~nearharmonic.reproduction.experiments.stability.kepler.run.orbit_map` found of each, by name.
    """
    states = stacked(methods, runs)
    cube = states.drop_dims(["sample", "component"]).assign(reduction.of(states))
    return cube.assign(reduction.of(cube, over="tau_per_stage"))
