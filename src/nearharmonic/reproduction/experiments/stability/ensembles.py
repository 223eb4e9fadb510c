"""Common parts of all ensembles: runs in one file per method, then one cube."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import method_coordinates
from nearharmonic.output.store import read
from nearharmonic.output.table import Table


def cube_and_table(
    assemble: Callable[[Sequence[Tableau], Mapping[str, xr.Dataset]], xr.Dataset],
    tabulate: Callable[[xr.Dataset], Table],
    names: Sequence[str],
    runs: Mapping[str, str],
) -> dict[str, Any]:
    """Return the ``cube`` of an ensemble and its ``table``.

    Parameters
    ----------
    assemble : callable
        Makes the cube from the methods and from the runs of each, by name.
    tabulate : callable
        Makes the table from the cube.
    names : sequence of str
        Names of the methods, in the order of the cube.
    runs : mapping
        Path of the run file of each method.
    """
    cube = assemble([integrators[name] for name in names], {name: read(path) for name, path in runs.items()})
    return {"cube": cube, "table": tabulate(cube)}


def stacked(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the runs of ``methods`` along a new dimension ``integrator``, with the names and labels of the methods.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        The runs of each by its name; attributes of the files that they come from are left out.
    """
    parts = [runs[method.name] for method in methods]
    cube = xr.concat(parts, "integrator", combine_attrs="override", data_vars="all", coords="all")
    cube.attrs = {}
    return cube.assign_coords(method_coordinates(methods))
