"""Reductions of the errors by rounding: an ``xarray.Dataset`` of all methods in, numbers for the cube out.

It has ``energy_error`` and ``lag`` over (integrator, source, orbit, sample), and the coordinate ``time`` over
(integrator, sample).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, dot, jackknife_interval, mean
from nearharmonic.output.dataset import described
from nearharmonic.output.table import Table
from nearharmonic_paper.experiments.stability.ensembles import read_runs
from nearharmonic_paper.experiments.stability.settings import RoundingSettings
from nearharmonic_paper.tasks.reduction import Reductions

reduction = Reductions()

QUANTITIES = {"energy_error": "energy error", "lag": "lag along the track"}


@reduction(*QUANTITIES, over="orbit")
def root_mean_squares(cube: xr.Dataset) -> xr.Dataset:
    """Root mean square over the orbits of each quantity at each sample, ``<quantity>_rms``."""
    found = xr.Dataset()
    for name, text in QUANTITIES.items():
        notes = described(f"root mean square of the {text} over the orbits", cube[name].attrs["units"])
        rms = xr.apply_ufunc(np.sqrt, (cube[name] * cube[name]).mean("orbit"))
        found[f"{name}_rms"] = rms.assign_attrs(notes)
    return found


@reduction(*QUANTITIES, "time", over="orbit")
def power_laws(cube: xr.Dataset) -> xr.Dataset:
    """Power law of the root mean square of each quantity in time: ``<quantity>_exponent``, ``<quantity>_interval``."""
    found = xr.Dataset()
    for name, text in QUANTITIES.items():
        exponent, interval = xr.apply_ufunc(
            growth, cube[name], cube.time, input_core_dims=[["orbit", "sample"], ["sample"]],
            output_core_dims=[[], []], vectorize=True,
        )  # fmt: skip
        found[f"{name}_exponent"] = exponent.assign_attrs(described(f"exponent of the growth of the {text}"))
        meaning = f"half width of the 95 % interval of the exponent of the {text}"
        found[f"{name}_interval"] = interval.assign_attrs(described(meaning))
    return found


@reduction(*QUANTITIES, over="orbit")
def biases(cube: xr.Dataset) -> xr.Dataset:
    """Absolute mean over the orbits of each quantity at the last sample, ``<quantity>_bias``."""
    found = xr.Dataset()
    for name, text in QUANTITIES.items():
        bias = abs(cube[name].reset_coords(drop=True).isel(sample=-1, drop=True).mean("orbit", skipna=False))
        notes = described(f"absolute mean of the {text} over the orbits at the end", cube[name].attrs["units"])
        found[f"{name}_bias"] = bias.assign_attrs(notes)
    return found


def growth(errors: Floats, time: Floats) -> tuple[float, float]:
    """Return the exponent of a power law in time (t,) of the root mean square of errors (orbits, t), and its interval.

    That is the slope of log rms against log time, and the half width of its 95 % interval by the jackknife over orbits,
    because the times of one orbit are not independent.
    """
    squares, x = errors * errors, log(time)
    x = x - mean(x)

    def slope(rms: Floats) -> Floats:
        return np.array([dot(row, x) for row in log(rms)]) / dot(x, x)

    n = len(errors)
    total = squares.sum(axis=0)
    exponent = float(slope(np.sqrt(total / n)[None])[0])
    return exponent, jackknife_interval(slope(np.sqrt((total - squares) / (n - 1))))


CAPTION = "Growth of round-off along Kepler orbits, against time: energy over |H0|, and lag in mean anomaly (rad)."
#: Exponents of independent errors, by quantity (Brouwer 1937, doi:10.1086/105423).
BROUWER = {"energy_error": 0.5, "lag": 1.5}


def rounding_table(cube: xr.Dataset) -> Table:
    """Return a row for each method, arithmetic and quantity: power law, Brouwer's, and bias relative to rms."""
    header = ["integrator", "source", "quantity", "exponent", "interval_95", "brouwer", "rms_at_end", "bias_over_rms"]
    rows: list[list[Any]] = []
    for name, source, quantity in product(cube.integrator.values, cube.source.values, BROUWER):
        one = cube.sel(integrator=name, source=source)
        rms = one[f"{quantity}_rms"].values[-1]
        law = [one[f"{quantity}_{key}"].item() for key in ("exponent", "interval")]
        # The error due to rounded coefficients is no random walk.
        brouwer = "" if source == "coefficients" else BROUWER[quantity]
        bias = one[f"{quantity}_bias"].item() / rms
        rows.append([str(name), str(source), quantity, *law, brouwer, float(rms), bias])
    return Table(header=header, rows=rows, caption=CAPTION)


def reduce(integrators: Sequence[str], settings: RoundingSettings, **runs: str) -> dict[str, Any]:
    """Return the ``cube`` and its ``table``; ``settings`` are stored in the files."""
    cube = rounding_cube(read_runs(integrators, runs))
    return {"cube": cube, "table": rounding_table(cube)}


def rounding_cube(runs: xr.Dataset) -> xr.Dataset:
    """Return errors over (integrator, source, orbit, sample), and their reductions."""
    return runs.assign(reduction.of(runs, over="orbit"))
