"""Reductions of the runs of all methods on one system: measured numbers, and estimates for pure rounding errors.

A step makes 2 s + 1 updates y += c tau dy/dt, each rounded by up to u = 2^-53 of y (plain summation) or of the
increment (compensated), of either sign: N of them add up to sqrt(N) u times their root mean square as a random walk,
and to N u times it at the worst, if all push one way. The flow carries each error on: the sums are multiplied by the
root mean square over time of the tangent map's norm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from nearharmonic.integrators import integrators as registry
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import line_fit, norms
from nearharmonic.output.dataset import coordinate, described, method_coordinates
from nearharmonic.output.store import read
from nearharmonic.output.table import Table
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

#: Unit roundoff of a double, and relative error of a double-double operation (Hida, Li & Bailey 2001).
UNIT_ROUNDOFF = 2.0**-53
DOUBLE_DOUBLE_ROUNDOFF = 2.0**-104

#: Exact numbers of an array of floats.
_exact = np.frompyfunc(Fraction, 1, 1)


@reduction("neighbour")
def growth(runs: xr.Dataset) -> xr.DataArray:
    """Root mean square over the samples of the tangent map's norm, by differences of the nearest neighbours."""
    below, above = (runs.neighbour.isel(offset=i, drop=True) for i in (1, 2))
    maps = ((above - below) / (2 * _spacing(runs))).transpose("integrator", "sample", "axis", "component")
    text = "root mean square over the run of the tangent map's norm"
    return _described(_of_each(lambda one: _rms(norms(one)), maps), text)


@reduction("neighbour", "state", "state_low", "rate")
def return_errors(runs: xr.Dataset) -> xr.Dataset:
    """Distance from the start after the run and the backward run, in both summations, with estimates for rounding."""
    symmetric = [registry[name].symmetric for name in runs.integrator.values]
    found, carried = xr.Dataset(), UNIT_ROUNDOFF * growth(runs)
    for prefix, summation in (("", "compensated"), ("plain_", "plain")):
        one, (total, squares) = runs.sel(summation=summation, drop=True), _roundings(runs, summation)
        error = _of_each(_distance, one.state, one.state_low).where(runs.integrator.copy(data=symmetric))
        distance = "distance from the start after the run and the run back"
        for name, values, text in (
            ("error", error, f"{distance}, {summation} summation; NaN if asymmetric"),
            ("walk", carried * np.sqrt(2 * squares), "what rounding gives for it as a random walk"),
            ("bound", carried * 2 * total, "what rounding gives for it if all errors add up"),
        ):
            found[f"{prefix}return_{name}"] = _described(values, text)
    return found


@reduction("neighbour", "neighbour_low")
def symplectic_defect(runs: xr.Dataset) -> xr.DataArray:
    """Largest entry of J^T Omega J - Omega, J the tangent map of the run."""
    spacing = _spacing(runs)
    defects = _of_each(
        lambda high, low: defect(tangent_map(high[..., -1, :], low, spacing)),
        runs.neighbour, runs.neighbour_low,
    )  # fmt: skip
    return _described(defects, "largest entry of J^T Omega J - Omega, J the tangent map of the run in double-double")


@reduction("neighbour", "state")
def symplectic_walk(runs: xr.Dataset) -> xr.DataArray:
    """Rounding's share of the defect: J enters twice, and differences divide by the spacing."""
    norm, (_, squares) = growth(runs), _roundings(runs, "plain")
    walk = 2 * norm * norm * DOUBLE_DOUBLE_ROUNDOFF * (np.sqrt(squares) / _spacing(runs))
    return _described(walk, "what double-double rounding gives for it as a random walk")


@reduction("energy_error")
def energy_trend(runs: xr.Dataset) -> xr.Dataset:
    """Least squares through the means of the blocks of the long run; NaN if it left its energy surface.

    The interval assumes independent blocks. Blocks of a chaotic orbit are dependent, and its trend may exceed the
    interval two or three times.
    """
    x = (runs.block.values + 0.5) / runs.block.size - 0.5
    drift, interval = _of_each(lambda means: line_fit(x, means), runs.energy_error, outputs=2)
    return xr.Dataset({
        "energy_drift": _described(drift, "trend of the mean of (H - H0)/|H0| over the long run"),
        "energy_drift_interval": _described(interval, "half width of the 95 % interval of the trend"),
    })  # fmt: skip


@reduction("power")
def energy_walk(runs: xr.Dataset) -> xr.DataArray:
    """Rounding's random walk: an update rounded by u c tau (dy/dt) changes the energy by that times dH/dy.

    For q and p alike, that is u c tau |dT/dp dV/dq|.
    """
    tableaus = [registry[name] for name in runs.integrator.values]
    rows = [[float(Fraction(c)) for c in (*tableau.drift, *tableau.kick)] for tableau in tableaus]
    norm = runs.integrator.copy(data=[float(np.sqrt(np.sum(np.square(row)))) for row in rows])
    each = runs.tau * runs.power * norm
    walk = UNIT_ROUNDOFF * each * np.sqrt(runs.long_steps * (runs.component.size // 2))
    return _described(walk, "what rounding gives for the energy as a random walk")


def tangent_map(high: Any, low: Any, spacing: float) -> NDArray[Any]:
    """Return the derivatives (2 d, 2 d) of a state by its start, by the five-point rule in exact arithmetic.

    ``high``, ``low`` (2 d, 4, 2 d): states as pairs of doubles, from starts at -2, -1, 1 and 2
    spacings along each axis. ``spacing``: distance of neighbouring starts.
    """
    far_below, below, above, far_above = np.moveaxis(_exact(high) + _exact(low), 1, 0)
    map_: NDArray[Any] = ((8 * (above - below) - (far_above - far_below)) / (12 * Fraction(spacing))).T
    return map_


def defect(J: NDArray[Any]) -> float:
    """Return the largest entry of J^T Omega J - Omega for a matrix (2 d, 2 d) of Fraction, rounded once."""
    d = len(J) // 2
    areas = J[:d].T @ J[d:]
    omega = np.eye(2 * d, k=d, dtype=int) - np.eye(2 * d, k=-d, dtype=int)
    return float(abs(areas - areas.T - omega).max())


def _distance(state: Any, low: Any) -> float:
    """Return the largest distance of a component of states (direction, sample, 2 d) from its start, rounded once."""
    exact = _exact(state[:, [0, -1]]) + _exact(low[:, [0, -1]])
    return float(abs(exact[1, 1] - exact[0, 0]).max())


def _roundings(runs: xr.Dataset, summation: str) -> Any:
    """Return sum and sum of squares, over all updates of the run, of the rounded numbers in units of the scale."""
    compensated, d = summation == "compensated", runs.component.size // 2
    values = runs.rate if compensated else runs.state.sel(summation="compensated", direction="forwards", drop=True)
    sizes = [_of_each(_rms, values.isel(component=half)) for half in (slice(d), slice(d, None))]

    def sums(name: str, steps: float, tau: float, drifted: float, kicked: float) -> tuple[float, float]:
        rows = (registry[str(name)].drift, drifted), (registry[str(name)].kick, kicked)
        each = np.array(
            [(abs(float(Fraction(c))) * tau if compensated else 1) * size for row, size in rows for c in row]
        )
        return steps * d * each.sum(), steps * d * (each**2).sum()

    return _of_each(sums, runs.integrator, runs.steps, runs.tau, *sizes, outputs=2)


def _described(values: Any, text: str) -> xr.DataArray:
    result: xr.DataArray = values.assign_attrs(described(text))
    return result


def _spacing(runs: xr.Dataset) -> float:
    return float(runs.offset.values[2])


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _of_each(function: Callable[..., Any], *columns: xr.DataArray, outputs: int = 1) -> Any:
    """Apply a function to the arrays of each method, without padded samples; return an array for each output."""
    methods, found = columns[0].integrator, []
    for i in range(methods.size):
        parts = [column.isel(integrator=i) for column in columns]
        kept = [part.dropna("sample", how="all") if "sample" in part.dims else part for part in parts]
        # In the order of C, on which the last bits of sums depend.
        found.append(function(*(part.values.copy(order="C") for part in kept)))
    if outputs == 1:
        return methods.copy(data=np.array(found, dtype=float))
    return [methods.copy(data=np.array(column, dtype=float)) for column in zip(*found, strict=True)]


CAPTION = "Reversibility, symplecticity and mean energy, relative, each beside what rounding alone would give."


def structure_table(cube: xr.Dataset) -> Table:
    """Return a row for each system and each method measured on it, with all variables of ``cube``."""
    keys = [str(key) for key in cube.data_vars]
    rows: list[tuple[Any, ...]] = []
    for system in map(str, cube.system.values):
        for name in map(str, cube.integrator.values):
            one = cube.sel(system=system, integrator=name)
            if np.isfinite(one.steps):
                rows.append((system, name, *(int(one[k]) if k == "steps" else float(one[k]) for k in keys)))
    return Table(header=("system", "integrator", *(key.replace("_", " ") for key in keys)), rows=rows, caption=CAPTION)


def reduce(integrators: Sequence[str], t_end: Mapping[str, str], runs: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``, from the path of the run file of each system in the order of ``t_end``."""
    cube = structure_cube([registry[name] for name in integrators], dict(zip(t_end, map(read, runs), strict=True)))
    return {"cube": cube, "table": structure_table(cube)}


def structure_cube(methods: Sequence[Tableau], runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the reductions of the runs on each system over (system, integrator), NaN where a method does not fit."""
    axes = {**coordinate("system", list(runs), "system"), **method_coordinates(methods)}
    parts = [
        one[["tau_per_stage", "steps"]].assign(reduction.of(one)).reindex(integrator=axes["integrator"][1])
        for one in runs.values()
    ]
    joined = xr.concat(parts, "system", combine_attrs="override")
    return xr.Dataset({name: joined[name].variable for name in joined.data_vars}, axes)
