"""From the measured structure of each method on each system to one cube."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import coordinate, method_coordinates, variable

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.experiments.stability.conservation.run import Structure

#: Members of a Structure, in its order, and what they are.
MEANINGS = {
    "tau_per_stage": "step size per stage, in the system's unit of time",
    "steps": "steps of the run forwards",
    "growth": "root mean square over the run of the tangent map's norm",
    "return_error": "distance from the start after the run and the run back, compensated summation; NaN if asymmetric",
    "return_walk": "what rounding gives for it as a random walk",
    "return_bound": "what rounding gives for it if all errors add up",
    "plain_return_error": "distance from the start after the run and the run back, plain summation; NaN if asymmetric",
    "plain_return_walk": "what rounding gives for it as a random walk",
    "plain_return_bound": "what rounding gives for it if all errors add up",
    "symplectic_defect": "largest entry of J^T Omega J - Omega, J the tangent map of the run in double-double",
    "symplectic_walk": "what double-double rounding gives for it as a random walk",
    "energy_drift": "trend of the mean of (H - H0)/|H0| over the long run",
    "energy_drift_interval": "half width of the 95 % interval of the trend",
    "energy_walk": "what rounding gives for the energy as a random walk",
}


def structure_cube(
    names: Sequence[str], tableaus: Sequence[Tableau], found: Mapping[tuple[str, str], Structure]
) -> xr.Dataset:
    """Return what was ``found`` over (system, integrator), NaN where nothing was.

    Parameters
    ----------
    names : sequence of str
        The systems.
    tableaus : sequence of Tableau
        The methods.
    found : mapping
        The structure of a method on a system, by the names of the system and the method.
    """
    import xarray as xr

    numbers = {key: np.full((len(names), len(tableaus)), np.nan) for key in MEANINGS}
    for (system, method), one in found.items():
        place = names.index(system), [tableau.name for tableau in tableaus].index(method)
        for key, values in numbers.items():
            values[place] = getattr(one, key)
    return xr.Dataset(
        {key: variable(("system", "integrator"), values, MEANINGS[key]) for key, values in numbers.items()},
        coords={**coordinate("system", list(names), "system"), **method_coordinates(tableaus)},
    )
