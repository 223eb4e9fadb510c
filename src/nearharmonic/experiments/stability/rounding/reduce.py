"""From the errors by rounding of each method to one cube: their root mean squares and their power laws in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.engine.portable import dot
from nearharmonic.engine.statistics import Floats, jackknife_interval, mean
from nearharmonic.experiments.stability.ensembles import cube_and_table, stacked
from nearharmonic.experiments.stability.rounding.tables import rounding_table
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import log
from nearharmonic.output.dataset import described, variable

if TYPE_CHECKING:
    import xarray as xr

    from nearharmonic.experiments.stability.settings import RoundingSettings

QUANTITIES = {"energy_error": "energy error", "lag": "lag along the track"}


def reduce(integrators: Sequence[str], settings: RoundingSettings, **runs: str) -> dict[str, Any]:
    """Return what :func:`cube_and_table` does; ``settings`` go into the files beside the numbers."""
    return cube_and_table(rounding_cube, rounding_table, integrators, runs)


def rounding_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return errors over (integrator, source, orbit, sample), their root mean squares, and their power laws.

    Parameters
    ----------
    methods : sequence of Tableau
        The methods in the order of the cube.
    runs : mapping
        What :func:`~nearharmonic.experiments.stability.rounding.run.rounding_errors` found of each, by name.
    """
    cube = stacked(methods, runs)
    over = ("integrator", "source")
    for name, text in QUANTITIES.items():
        unit = cube[name].attrs["units"]
        square: xr.DataArray = (cube[name] * cube[name]).mean("orbit")
        rms = square.copy(data=np.sqrt(square.values))
        cube[f"{name}_rms"] = rms.assign_attrs(described(f"root mean square of the {text} over the orbits", unit))
        errors = cube[name].transpose(*over, "orbit", "sample").values
        laws = [[growth(one, time) for one in row] for row, time in zip(errors, cube.time.values, strict=True)]
        for key, unit_of, meaning in (
            ("exponent", "1", f"exponent of the growth of the {text}"),
            ("interval", "1", f"half width of the 95 % interval of the exponent of the {text}"),
            ("bias", unit, f"absolute mean of the {text} over the orbits at the end"),
        ):
            values = np.array([[law[key] for law in row] for row in laws])
            cube[f"{name}_{key}"] = variable(over, values, meaning, unit_of)
    return cube


def growth(errors: Floats, time: Floats) -> dict[str, float]:
    """Return the power law of the root mean square of an ensemble's errors in time.

    Parameters
    ----------
    errors : array of shape (orbits, t)
        Errors of each orbit.
    time : array of shape (t,)
        Times above 0.

    Returns
    -------
    dict
        ``exponent``: slope of log rms against log time. ``interval``: half width of its 95 % interval by the jackknife
        over orbits, since the times of one orbit are not independent. ``rms`` and ``bias`` (the absolute mean) at the
        last time.
    """
    squares, x = errors * errors, log(time)
    x = x - mean(x)

    def slope(rms: Floats) -> Floats:
        return np.array([dot(row, x) for row in log(rms)]) / dot(x, x)

    n = len(errors)
    total = squares.sum(axis=0)
    return {
        "exponent": float(slope(np.sqrt(total / n)[None])[0]),
        "interval": jackknife_interval(slope(np.sqrt((total - squares) / (n - 1)))),
        "rms": float(np.sqrt(total[-1] / n)),
        "bias": float(abs(errors[:, -1].mean())),
    }
