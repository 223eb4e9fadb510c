"""The cube and the table of structure: each method on each system, beside what rounding alone would give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.structure import Structure, structure
from nearharmonic.systems import systems
from nearharmonic.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

Rows = tuple[tuple[str, ...], list[tuple[Any, ...]]]

MEANINGS = {
    "tau_per_stage": "step size per stage, in the system's unit of time",
    "steps": "steps of the run forwards",
    "growth": "root mean square over the run of the tangent map's norm",
    "return_error": "distance from the start after the run and the run back, compensated summation",
    "return_walk": "what rounding gives for it as a random walk",
    "return_bound": "what rounding gives for it if all errors add up",
    "plain_return_error": "distance from the start after the run and the run back, plain summation",
    "plain_return_walk": "what rounding gives for it as a random walk",
    "plain_return_bound": "what rounding gives for it if all errors add up",
    "symplectic_defect": "largest entry of J^T Omega J - Omega, J the tangent map of the run in double-double",
    "symplectic_walk": "what double-double rounding gives for it as a random walk",
    "energy_drift": "trend of the mean of (H - H0)/|H0| over the long run",
    "energy_drift_interval": "half width of the 95 % interval of the trend",
    "energy_walk": "what rounding gives for the energy as a random walk",
}


def structure_cube(tableaus: Sequence[Tableau], problems: Sequence[tuple[str, str]]) -> xr.Dataset:
    """:class:`Structure` over (system, integrator) for ``problems``, pairs (system, t_end).

    NaN where a method needs a quadratic T and the system has another.
    """
    import xarray as xr

    numbers = {field.name: np.full((len(problems), len(tableaus)), np.nan) for field in fields(Structure)}
    for i, (name, t_end) in enumerate(problems):
        for j, tableau in enumerate(tableaus):
            if tableau.requires is None or systems[name].quadratic_kinetic_energy:
                found = structure(name, tableau, t_end=t_end)
                for key, values in numbers.items():
                    values[i, j] = getattr(found, key)
    return xr.Dataset(
        {key: (("system", "integrator"), values, _notes(MEANINGS[key])) for key, values in numbers.items()},
        coords={"system": ("system", [name for name, _ in problems], _notes("system")), **_methods(tableaus)},
    )


def structure_table(cube: xr.Dataset) -> Rows:
    """One row for each system and integrator, every number of :class:`Structure`."""
    keys = [field.name for field in fields(Structure)]
    rows: list[tuple[Any, ...]] = []
    for system in map(str, cube.system.values):
        for name in map(str, cube.integrator.values):
            one = cube.sel(system=system, integrator=name)
            if np.isfinite(one.steps):
                rows.append((system, name, *(int(one[k]) if k == "steps" else float(one[k]) for k in keys)))
    return ("system", "integrator", *(key.replace("_", " ") for key in keys)), rows


def _methods(tableaus: Sequence[Tableau]) -> dict[str, Any]:
    return {
        "integrator": ("integrator", [t.name for t in tableaus], _notes("integrator")),
        "label": ("integrator", [t.label for t in tableaus], _notes("name in the paper")),
    }


def _notes(text: str) -> dict[str, str]:
    return {"units": "1", "long_name": text}
