"""The table of crossings: the amplitude up to which the exact oscillator pays, with its interval."""

from __future__ import annotations

from itertools import product
from math import sqrt
from typing import TYPE_CHECKING, Any

from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.exact_oscillator.reductions import CONFIDENCE

if TYPE_CHECKING:
    import xarray as xr

#: In place of a method: the best of those that split into T and V, at each energy.
BEST = "best of T + V"
CAPTION = (
    "Henon-Heiles system: energy H and amplitude sqrt(2H) up to which the median energy error of a method with the "
    "oscillator solved exactly is below that of one that splits into T and V, at equal cost; charge is the cost of an "
    f"evaluation with the exact oscillator over one without; {CONFIDENCE:.0%} intervals. 0: nowhere, inf: everywhere."
)


def crossing_table(cube: xr.Dataset) -> Table:
    """Return a row for each step size, charge and pair of methods."""
    values = {name: entry.values for name, entry in cube.variables.items()}
    header = ["tau_per_stage", "charge", "exact oscillator", "T + V", "energy", "energy_low", "energy_high"]
    header += ["amplitude", "amplitude_low", "amplitude_high"]
    rows: list[list[Any]] = []
    for (t, tau), (c, charge), (x, exact) in product(
        *(enumerate(values[name].tolist()) for name in ("tau_per_stage", "charge", "exact_label"))
    ):
        found = [(BEST, values["best_crossing"][t, c, x], values["best_crossing_interval"][t, c, x])]
        found += [
            (label, values["crossing"][t, c, x, p], values["crossing_interval"][t, c, x, p])
            for p, label in enumerate(values["label"].tolist())
        ]
        for label, energy, bounds in found:
            numbers = [float(energy), *map(float, bounds)]
            rows.append([tau, charge, exact, label, *numbers, *(sqrt(2 * H) for H in numbers)])
    return Table(header=header, rows=rows, caption=CAPTION)
