"""The table of the Kepler maps: the work that an energy error takes at some eccentricities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.stability.kepler.reductions import CONTOUR

if TYPE_CHECKING:
    import xarray as xr

CAPTION = f"Kepler: force evaluations per orbit from which on the largest energy error stays below {CONTOUR:g}."
#: Eccentricities that are shown: the nearest of the grid to each.
TABULATED = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99)


def kepler_table(cube: xr.Dataset) -> Table:
    """Return a row for each method: force evaluations per orbit for the contour's error at some eccentricities."""
    nearest = cube.get_index("eccentricity").get_indexer(TABULATED, method="nearest")
    shown = cube.evaluations_for_contour.isel(eccentricity=np.unique(nearest))  # a coarse grid has one for several
    return Table(
        header=["integrator", *(f"e_{e:.3f}" for e in shown.eccentricity.values)],
        rows=[[str(name), *map(float, shown.sel(integrator=name).values)] for name in cube.integrator.values],
        caption=CAPTION,
    )
