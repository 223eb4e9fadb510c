"""The table of the kinetic energy: errors over Ruth's by amplitude, in a method's own roles and exchanged."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Table

if TYPE_CHECKING:
    import xarray as xr

CAPTION = "Relativistic oscillator: largest energy error at tau/s = 0.05 over that of Ruth's method, by amplitude A."


def kinetic_energy_table(cube: xr.Dataset) -> Table:
    """Return a row for each method and roles: its error over Ruth's at each amplitude, and the decline.

    The decline is the ratio at amplitude 1, where speeds reach 0.75 of light's, over that at the least amplitude: by
    what factor the method's lead over Ruth's shrinks.
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
