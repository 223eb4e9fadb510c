"""From the runs on each system to one cube and its table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import coordinate, method_coordinates
from nearharmonic.output.store import read
from nearharmonic.reproduction.experiments.stability.conservation.reductions import reduction
from nearharmonic.reproduction.experiments.stability.conservation.tables import structure_table

if TYPE_CHECKING:
    import xarray as xr


def reduce(integrators: Sequence[str], t_end: Mapping[str, str], runs: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``.

    Parameters
    ----------
    integrators : sequence of str
        Names of the methods.
    t_end : mapping
        Length of the interval of each system by its name.
    runs : sequence of str
        Path of the run file of each system.
    """
    methods = [registry[name] for name in integrators]
    cube = structure_cube(methods, dict(zip(t_end, map(read, runs), strict=True)))
    return {"cube": cube, "table": structure_table(cube)}


def structure_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the reductions over (system, integrator), NaN where a method does not fit a system.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        The runs on each system by its name.
    """
    import xarray as xr

    axes = {**coordinate("system", list(runs), "system"), **method_coordinates(methods)}
    parts = [
        one[["tau_per_stage", "steps"]].assign(reduction.of(one)).reindex(integrator=axes["integrator"][1])
        for one in runs.values()
    ]
    joined = xr.concat(parts, "system", combine_attrs="override")
    return xr.Dataset({name: joined[name].variable for name in joined.data_vars}, axes)
