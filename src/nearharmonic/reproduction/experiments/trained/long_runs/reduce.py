"""From the long runs to their table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from nearharmonic.integrators import integrators
from nearharmonic.output.store import read
from nearharmonic.output.table import Table
from nearharmonic.reproduction.experiments.trained.long_runs.reductions import reduction
from nearharmonic.reproduction.experiments.trained.proof.settings import ProofSettings

if TYPE_CHECKING:
    import xarray as xr

CAPTION = (
    "Runs from starts on the energy surfaces of the proof. Largest error at any step; trend of (H - H0)/|H0| over the "
    "whole run with the half width of its 95 % interval over the starts; distance from the start after a hundredth of "
    "the steps and as many back, median over the starts, relative to the largest coordinate and momentum; and the "
    "energy error by rounding alone, against double-double with the same coefficients, after equally many evaluations "
    "with a fifth of the step, median over the starts and the second half of the run, and with plain sums over that "
    "of the first method."
)


def reduce(methods: Sequence[str], beside: str, settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``table`` of long runs; the names and ``settings`` go into the files beside the numbers."""
    return {"table": long_table(read(run))}


def long_table(runs: xr.Dataset) -> Table:
    """Return a row for each system and method of ``runs``, with their reductions."""
    reduced, steps, tau = reduction.of(runs, over="problem"), int(runs.step[-1]), float(runs.tau_per_stage)
    sums, rows = runs.summation.values.tolist(), []
    for system in map(str, runs.system.values):
        known = float(reduced.rounding.sel(system=system, summation="plain")[0])
        for name in map(str, runs.integrator.values):
            one, method = reduced.sel(system=system, integrator=name), integrators[name]
            total = sum(abs(float(c)) for row in (method.kick, method.drift) for c in row)
            largest, slope, width = (float(one[key]) for key in ("max_energy_error", "trend", "trend_half_width"))
            drift = "no" if abs(slope) <= width else "yes" if abs(slope) > width else "lost"
            numbers = [float(values.sel(summation=each)) for values in (one.way_back, one.rounding) for each in sums]
            rows.append([system, name, steps, tau, total, largest, slope, width, drift, *numbers, numbers[-1] / known])
    header = ["system", "method", "steps", "tau_per_stage", "sum of coefficients", "max_energy_error", "trend"]
    header += ["trend_half_width", "drift", *(f"{what}_{each}" for what in ("return", "rounding") for each in sums)]
    return Table(header=[*header, "rounding_ratio"], rows=rows, caption=CAPTION)
