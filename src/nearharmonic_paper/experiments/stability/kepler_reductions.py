"""Reductions of the Kepler maps: an ``xarray.Dataset`` of all methods in, numbers for the cube out.

It has ``q`` and ``p``, once a period, over (integrator, tau_per_stage, eccentricity, sample, component), and what the
cube takes over, over (integrator, tau_per_stage, eccentricity). With ``over="tau_per_stage"`` a reduction takes whole
curves of the cube instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nearharmonic.integrators import integrators
from nearharmonic.math import exp, log
from nearharmonic.numerics.portable import Floats, dot
from nearharmonic.output.store import described
from nearharmonic.output.table import Table
from nearharmonic.systems.kepler import perihelion_angle
from nearharmonic_paper.experiments.stability.ensembles import read_runs
from nearharmonic_paper.experiments.stability.settings import MapSettings
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

#: Energy error of the contour in figure and table.
CONTOUR = 1e-6


@reduction("steps_per_orbit")
def evaluations_per_orbit(runs: xr.Dataset) -> xr.DataArray:
    """Force evaluations in one period of the exact orbit."""
    stages = runs.integrator.copy(data=[integrators[name].stages for name in runs.integrator.values])
    evaluations: xr.DataArray = runs.steps_per_orbit * stages
    return evaluations.assign_attrs(described("force evaluations per orbit"))


@reduction("q", "p", "energy_error")
def perihelion_advance(runs: xr.Dataset) -> xr.DataArray:
    """Rotation of the Laplace-Runge-Lenz vector per orbit; NaN for lost orbits and for circles."""
    advance: xr.DataArray = xr.apply_ufunc(
        rotation_per_sample, runs.q, runs.p, input_core_dims=[["sample", "component"]] * 2
    )
    advance = advance.where(np.isfinite(runs.energy_error) & (runs.eccentricity > 0))
    return advance.assign_attrs(described("rotation of the Laplace-Runge-Lenz vector per orbit", "rad"))


@reduction("evaluations_per_orbit", "energy_error", over="tau_per_stage")
def evaluations_for_contour(cube: xr.Dataset) -> xr.DataArray:
    """Force evaluations per orbit from which on the energy error stays below :data:`CONTOUR`."""
    contour: xr.DataArray = xr.apply_ufunc(
        evaluations_below, cube.evaluations_per_orbit, cube.energy_error, kwargs={"level": CONTOUR},
        input_core_dims=[["tau_per_stage"]] * 2, vectorize=True,
    )  # fmt: skip
    text = f"force evaluations per orbit from which on the energy error stays below {CONTOUR:g}"
    return contour.assign_attrs(described(text))


def rotation_per_sample(q: Floats, p: Floats) -> Floats:
    """Return the mean rotation per sample (rad) of the Laplace-Runge-Lenz vector of orbits, by least squares.

    ``q``, ``p`` (..., samples, 2): states of each orbit. The result (...) is NaN if a sample is missing, or if the
    vector rotates by more than a quarter turn between two samples, so that the sense of rotation is ambiguous.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        angle = perihelion_angle((q[..., 0], q[..., 1]), (p[..., 0], p[..., 1]), 1.0)
    turns = np.diff(angle)
    turns -= 2 * np.pi * np.round(turns / (2 * np.pi))
    turns[np.abs(turns) > np.pi / 2] = np.nan
    path = np.concatenate([np.zeros_like(turns[..., :1]), np.cumsum(turns, axis=-1)], axis=-1)
    index = np.arange(path.shape[-1]) - (path.shape[-1] - 1) / 2
    return np.apply_along_axis(dot, -1, path, index) / dot(index, index)


def evaluations_below(evaluations: NDArray[Any], error: Floats, level: float) -> float:
    """Return the number of evaluations from which on an error stays below ``level``.

    ``evaluations`` (n,): ascending; neighbours may be equal if their errors are. ``error`` (n,): NaN without a run,
    which counts as below. It is interpolated in the logarithms; NaN if the last error is not below.
    """
    above = np.flatnonzero(error >= level)
    last = above[-1] if above.size else len(evaluations)
    if last + 1 >= len(evaluations):
        return np.nan
    (x0, x1), (y0, y1) = log(evaluations[last : last + 2].astype(float)), log(error[last : last + 2])
    inside = np.isfinite([y0, y1]).all()
    return float(exp(x0 + (x1 - x0) * (y0 - log(level)) / (y0 - y1)) if inside else exp(x1))


CAPTION = f"Kepler: force evaluations per orbit from which on the largest energy error stays below {CONTOUR:g}."
#: Eccentricities of the table; the nearest value of the grid is used.
TABULATED = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99)


def kepler_table(cube: xr.Dataset) -> Table:
    """Return a row for each method: force evaluations per orbit for the error of the contour at some eccentricities."""
    nearest = cube.get_index("eccentricity").get_indexer(TABULATED, method="nearest")
    shown = cube.evaluations_for_contour.isel(eccentricity=np.unique(nearest))  # a coarse grid has one for several
    return Table(
        header=["integrator", *(f"e_{e:.3f}" for e in shown.eccentricity.values)],
        rows=[[str(name), *map(float, shown.sel(integrator=name).values)] for name in cube.integrator.values],
        caption=CAPTION,
    )


def reduce(integrators: Sequence[str], settings: MapSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = kepler_cube(read_runs(integrators, runs))
    return {"cube": cube, "table": kepler_table(cube)}


def kepler_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return maps over (integrator, tau_per_stage, eccentricity) without the states, and their reductions."""
    cube = runs.drop_dims(["sample", "component"]).assign(reduction.of(runs))
    return cube.assign(reduction.of(cube, over="tau_per_stage"))
