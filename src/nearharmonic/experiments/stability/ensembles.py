"""What all ensembles have in common: runs in one file a method, then one cube."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import method_coordinates

if TYPE_CHECKING:
    import xarray as xr


def stacked(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the runs of ``methods`` along a new dimension ``integrator``, with the names and labels of the methods.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        The runs of each by its name; attributes of the files that they come from are left out.
    """
    import xarray as xr

    parts = [runs[method.name] for method in methods]
    cube = xr.concat(parts, "integrator", combine_attrs="override", data_vars="all")
    cube.attrs = {}
    return cube.assign_coords(method_coordinates(methods))
