"""The table of the growth of round-off: the power laws beside Brouwer's."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Table

if TYPE_CHECKING:
    import xarray as xr

CAPTION = "Growth of round-off along Kepler orbits, against time: energy over |H0|, and lag in mean anomaly (rad)."
#: Exponents of independent errors, by quantity (Brouwer 1937, doi:10.1086/105423).
BROUWER = {"energy_error": 0.5, "lag": 1.5}


def rounding_table(cube: xr.Dataset) -> Table:
    """Return a row for each method, arithmetic and quantity: the power law beside Brouwer's, and bias against rms."""
    header = ["integrator", "source", "quantity", "exponent", "interval_95", "brouwer", "rms_at_end", "bias_over_rms"]
    rows: list[list[Any]] = []
    for name, source, quantity in product(cube.integrator.values, cube.source.values, BROUWER):
        one = cube.sel(integrator=name, source=source)
        rms = one[f"{quantity}_rms"].values[-1]
        law = [one[f"{quantity}_{key}"].item() for key in ("exponent", "interval")]
        # Rounded coefficients are no random walk.
        brouwer = "" if source == "coefficients" else BROUWER[quantity]
        bias = one[f"{quantity}_bias"].item() / rms
        rows.append([str(name), str(source), quantity, *law, brouwer, float(rms), bias])
    return Table(header=header, rows=rows, caption=CAPTION)
