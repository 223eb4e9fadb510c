"""The table of structure: every number beside what rounding alone would give."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.output.table import Table

if TYPE_CHECKING:
    import xarray as xr

CAPTION = "Reversibility, symplecticity and mean energy, relative, each beside what rounding alone would give."


def structure_table(cube: xr.Dataset) -> Table:
    """Return a row for each system and each method that was measured on it, with every variable of ``cube``."""
    keys = [str(key) for key in cube.data_vars]
    rows: list[tuple[Any, ...]] = []
    for system in map(str, cube.system.values):
        for name in map(str, cube.integrator.values):
            one = cube.sel(system=system, integrator=name)
            if np.isfinite(one.steps):
                rows.append((system, name, *(int(one[k]) if k == "steps" else float(one[k]) for k in keys)))
    return Table(header=("system", "integrator", *(key.replace("_", " ") for key in keys)), rows=rows, caption=CAPTION)
