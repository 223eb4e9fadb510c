"""Reduction of the errors by amplitude: ``max_energy_error`` over (roles, amplitude, integrator, tau_per_stage)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from nearharmonic.output.store import described, read
from nearharmonic.output.table import Table
from nearharmonic.systems.relativistic_oscillator import SYSTEM
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

#: Step size per stage of the comparison: errors are far above rounding, and all step-size resonances are at larger
#: steps.
COMPARED_AT = 0.05
#: Reference method.
YARDSTICK = "ruth"


@reduction("max_energy_error", over="tau_per_stage")
def relative_error(runs: xr.Dataset) -> xr.DataArray:
    """Errors over the yardstick's at the same amplitude; NaN if that is not among the methods."""
    errors = runs.max_energy_error.sel(tau_per_stage=COMPARED_AT, method="nearest", drop=True)
    yardstick = errors.reindex(integrator=[YARDSTICK]).sel(integrator=YARDSTICK, roles="own", drop=True)
    text = f"max_energy_error at tau/s = {COMPARED_AT:g} over that of {YARDSTICK} in its own roles"
    ratio: xr.DataArray = errors / yardstick.reset_coords(drop=True)
    return ratio.assign_attrs(described(text))


CAPTION = "Relativistic oscillator: largest energy error at tau/s = 0.05 over that of Ruth's method, by amplitude A."


def kinetic_energy_table(cube: xr.Dataset) -> Table:
    """Return a row for each method and roles: its error relative to Ruth's at each amplitude, and the decline.

    The decline is the ratio at amplitude 1, where speeds reach 0.75 of the speed of light, divided by the ratio at the
    smallest amplitude: the factor by which the advantage over Ruth's method decreases.
    """
    ratio = cube.relative_error
    amplitudes = [float(a) for a in ratio.amplitude.values]
    rows: list[tuple[Any, ...]] = []
    for name in map(str, ratio.integrator.values):
        for roles in map(str, ratio.roles.values):
            values = [float(x) for x in ratio.sel(integrator=name, roles=roles).values]
            rows.append((name, roles, *values, values[amplitudes.index(1.0)] / values[0]))
    return Table(
        header=("integrator", "roles", *(f"error / Ruth's at A = {a:g}" for a in amplitudes), "decline to A = 1"),
        rows=rows,
        caption=CAPTION,
    )


def reduce(integrators: Sequence[str], run: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; the names ``integrators`` are stored in the files."""
    cube = kinetic_energy_cube(read(run))
    return {"cube": cube, "table": kinetic_energy_table(cube)}


def kinetic_energy_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return energy errors over (roles, amplitude, integrator, tau_per_stage), and their reductions."""
    cube = runs.assign(reduction.of(runs, over="tau_per_stage"))
    cube.attrs = {"system": SYSTEM.name, "system_label": SYSTEM.label, "compared_at": COMPARED_AT}
    return cube
