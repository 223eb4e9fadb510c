"""Runs of all ensembles, from one file per method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.store import method_coordinates, read


def read_runs(names: Sequence[str], paths: Mapping[str, str]) -> xr.Dataset:
    """Return the runs of the methods ``names`` from the path of the run file of each."""
    return stacked([integrators[name] for name in names], [read(paths[name]) for name in names])


def stacked(methods: Sequence[Tableau], runs: Sequence[xr.Dataset]) -> xr.Dataset:
    """Return the runs of each of ``methods`` along a new dimension ``integrator``, without their attributes."""
    cube = xr.concat(runs, "integrator", combine_attrs="override", data_vars="all", coords="all")
    cube.attrs = {}
    return cube.assign_coords(method_coordinates(methods))
