"""From the errors of all methods by amplitude to the cube and its table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.output.store import read
from nearharmonic.reproduction.experiments.stability.kinetic_energy.reductions import COMPARED_AT, reduction
from nearharmonic.reproduction.experiments.stability.kinetic_energy.tables import kinetic_energy_table
from nearharmonic.systems.relativistic_oscillator import SYSTEM

if TYPE_CHECKING:
    import xarray as xr


def reduce(integrators: Sequence[str], run: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; the names ``integrators`` go into the files beside the numbers."""
    cube = kinetic_energy_cube(read(run))
    return {"cube": cube, "table": kinetic_energy_table(cube)}


def kinetic_energy_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return energy errors over (roles, amplitude, integrator, tau_per_stage), and their reductions."""
    cube = runs.assign(reduction.of(runs, over="tau_per_stage"))
    cube.attrs = {"system": SYSTEM.name, "system_label": SYSTEM.label, "compared_at": COMPARED_AT}
    return cube
