"""From the errors by rounding of each method to one cube and its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.reproduction.experiments.stability.ensembles import cube_and_table, stacked
from nearharmonic.reproduction.experiments.stability.rounding.reductions import reduction
from nearharmonic.reproduction.experiments.stability.rounding.tables import rounding_table

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.reproduction.experiments.stability.settings import RoundingSettings


def reduce(integrators: Sequence[str], settings: RoundingSettings, **runs: str) -> dict[str, Any]:
    """Return what :func:`cube_and_table` does; ``settings`` go into the files beside the numbers."""
    return cube_and_table(rounding_cube, rounding_table, integrators, runs)


def rounding_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return errors over (integrator, source, orbit, sample), and their reductions.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        What :func:`~nearharmonic.reproduction.experiments.stability.rounding.run.rounding_errors` found of each, by
        name.
    """
    cube = stacked(methods, runs)
    return cube.assign(reduction.of(cube, over="orbit"))
