"""Reductions over the trajectories: quantiles of the energy error, and the energies at which methods cross.

The dataset has ``energy_error`` over (tau_per_stage, integrator, energy, trajectory), ``exact_energy_error`` over
(tau_per_stage, charge, exact_integrator, energy, trajectory), and the attribute ``seed``, which chooses the resamples.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from math import sqrt
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from nearharmonic.math import exp, log
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import bounds_coordinate, coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic_paper.experiments.exact_oscillator.settings import ExactOscillatorSettings
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

Values = TypeVar("Values", xr.DataArray, xr.Dataset)

QUANTILES = (0.05, 0.5, 0.95)
#: Number of resamples of the trajectories, and coverage of the interval.
RESAMPLES, CONFIDENCE = 200, 0.95
#: Number of resamples that are computed together, to limit the memory.
TOGETHER = 10
TAILS = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)


@reduction("energy_error", over="trajectory")
def energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the trajectories of the energy error with T and V."""
    return _quantiles(runs.energy_error)


@reduction("exact_energy_error", over="trajectory")
def exact_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the trajectories of the energy error with the oscillator solved exactly."""
    return _quantiles(runs.exact_energy_error)


@reduction("energy_error", "exact_energy_error", over="trajectory")
def crossings(runs: xr.Dataset) -> xr.Dataset:
    """Energies up to which the exact oscillator errs less: than each method, and than the best, with intervals."""
    count = runs.sizes["trajectory"]
    draws = np.random.default_rng(runs.attrs["seed"]).integers(0, count, (RESAMPLES, count))
    places = [xr.DataArray(some, dims=("resample", "trajectory")) for some in np.split(draws, RESAMPLES // TOGETHER)]
    parts = [crossings_of_medians(runs.isel(trajectory=some)) for some in places]
    resamples = xr.concat(parts, "resample", coords="minimal", compat="override")
    found = crossings_of_medians(runs)
    bounds = ranked(resamples, "resample", TAILS, "bound").assign_coords(bounds_coordinate())
    for name, what in (
        ("crossing", "an integrator that splits into T and V"),
        ("best_crossing", "the best integrator that splits into T and V, chosen at each energy"),
    ):
        text = f"energy H up to which the median error with the exact oscillator is below that of {what}"
        interval = f"{text}: {CONFIDENCE:.0%} interval by resampling the trajectories"
        found[name] = found[name].assign_attrs(described(f"{text}; 0 if never, inf if always"))
        found[f"{name}_interval"] = bounds[name].assign_attrs(described(interval))
    return found


def crossings_of_medians(runs: xr.Dataset) -> xr.Dataset:
    """Return ``crossing`` (tau_per_stage, charge, exact_integrator, integrator) and ``best_crossing``, by medians."""
    medians = runs[["energy_error", "exact_energy_error"]].median("trajectory", skipna=False)
    split, exact = (xr.apply_ufunc(log, one) for one in medians.data_vars.values())

    def crossed(other: xr.DataArray) -> xr.DataArray:
        found: xr.DataArray = xr.apply_ufunc(
            crossing, exact - other, input_core_dims=[["energy"]], kwargs={"energies": runs.energy.values}
        )
        return found

    return xr.Dataset({"crossing": crossed(split), "best_crossing": crossed(split.min("integrator"))})


def crossing(logarithms: Floats, energies: Floats) -> Floats:
    """Return the energies (...) up to which the error with the exact oscillator is smaller.

    ``logarithms`` (..., E) are those of its error over that of the other method, at each of the ascending ``energies``.
    The result is the first energy at which the logarithm exceeds 0, interpolated in the logarithm of the energy; 0 if
    it exceeds 0 at the first energy, infinite if it never does.
    """
    log_energy, worse = log(energies), logarithms > 0
    first = worse.argmax(axis=-1)
    behind = np.maximum(first, 1)
    low, high = (np.take_along_axis(logarithms, (behind - k)[..., None], -1)[..., 0] for k in (1, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.clip(np.where(np.isfinite(high), -low / (high - low), 0.0), 0.0, 1.0)
    found = exp(log_energy[behind - 1] + part * (log_energy[behind] - log_energy[behind - 1]))
    return np.where(worse.any(axis=-1), np.where(first > 0, found, 0.0), np.inf)


def ranked(values: Values, over: str, fractions: Sequence[float], name: str) -> Values:
    """Return the quantiles of ``values`` along ``over`` as a new dimension ``name``, without interpolation.

    Interpolation would fail because errors of diverged trajectories are infinite.
    """
    count = values.sizes[over]
    ranks = xr.DataArray([min(count - 1, int(fraction * count)) for fraction in fractions], dims=name)
    ascending: Values = xr.apply_ufunc(np.sort, values, input_core_dims=[[over]], output_core_dims=[[over]])
    return ascending.isel({over: ranks}).drop_vars(over, errors="ignore")


def _quantiles(errors: xr.DataArray) -> xr.DataArray:
    fractions = coordinate("quantile", list(QUANTILES), "fraction of the trajectories that err less")
    found = ranked(errors, "trajectory", QUANTILES, "quantile").assign_coords(fractions)
    text = f"quantile over the trajectories of the {errors.attrs['long_name']}"
    return found.assign_attrs(described(text))


#: Entry in place of a method name: the best method for T and V at each energy.
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


def reduce(split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of quantiles and crossings, and its ``table``, from the path of the file ``run``.

    ``settings`` have the seed of the resamples; names of methods go into the files beside the numbers.
    """
    runs = read(run)
    runs.attrs = {"seed": settings.seed}
    cube = reduction.of(runs, over="trajectory")
    return {"cube": cube, "table": crossing_table(cube)}
