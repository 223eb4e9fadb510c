"""From the runs of each method to one cube an item, and the rows of its table."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.linear_stability import stability_limit
from nearharmonic.stability.henon_heiles_ensemble import TOLERATED, trusted_up_to
from nearharmonic.stability.kepler_maps import CONTOUR
from nearharmonic.stability.rounding_growth import growth

#: Eccentricities that the table of the Kepler maps shows: the nearest of the grid to each.
TABULATED = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99)

Rows = list[Sequence[Any]]


def stacked(parts: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """``parts``, by integrator, along a new dimension ``integrator`` with their labels."""
    cube = xr.concat(list(parts.values()), "integrator", combine_attrs="override", data_vars="all")
    labels = [integrators[name].label for name in parts]
    return cube.assign_coords(
        integrator=("integrator", list(parts), {"units": "1", "long_name": "integrator"}),
        label=("integrator", labels, {"units": "1", "long_name": "name in the paper"}),
    )


def henon_heiles_cube(parts: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Maps over (integrator, energy, tau_per_stage); with them the trusted step sizes and the linear limits."""
    cube = stacked(parts)
    cube["trusted_up_to"] = trusted_up_to(cube)
    limits = [float(stability_limit(name)) / integrators[name].stages for name in parts]
    text = "step size per stage at which the harmonic oscillator is first unstable"
    cube["linear_limit"] = (("integrator",), limits, {"units": "1", "long_name": text})
    return cube


def henon_heiles_rows(cube: xr.Dataset) -> tuple[list[str], Rows]:
    """Header and rows: per method and surface, the largest trusted step size and the errors there."""
    header = [
        "integrator", "energy", "linear_limit_tau_per_stage", f"tau_per_stage_escaped_up_to_{TOLERATED:g}",
        "median_energy_error_there", "worst_energy_error_there", "share_of_linear_limit",
    ]  # fmt: skip
    rows: Rows = []
    for name, energy in product(cube.integrator.values, cube.energy.values):
        one = cube.sel(integrator=name, energy=energy)
        limit, trusted = one.linear_limit.item(), one.trusted_up_to.item()
        errors = [np.nan, np.nan]
        if np.isfinite(trusted):
            errors = [one.energy_error.sel(tau_per_stage=trusted, quantile=q).item() for q in (0.5, 1.0)]
        rows.append([str(name), float(energy), limit, trusted, *errors, trusted / limit])
    return header, rows


def kepler_cube(parts: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Maps over (integrator, tau_per_stage, eccentricity), and the contour over (integrator, eccentricity)."""
    cube = stacked(parts)
    stages = [integrators[name].stages for name in parts]
    text = "force evaluations per orbit"
    cube["evaluations_per_orbit"] = (cube.steps_per_orbit * xr.DataArray(stages, dims="integrator")).assign_attrs(
        units="1", long_name=text
    )
    return cube


def kepler_rows(cube: xr.Dataset) -> tuple[list[str], Rows]:
    """Header and rows: per method, force evaluations per orbit for the contour's error at some eccentricities."""
    shown = cube.evaluations_for_contour.sel(eccentricity=list(TABULATED), method="nearest")
    header = ["integrator", *(f"e_{e:.3f}" for e in shown.eccentricity.values)]
    return header, [[str(name), *map(float, shown.sel(integrator=name).values)] for name in cube.integrator.values]


def rounding_cube(parts: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Errors by rounding over (integrator, source, orbit, sample), their root mean squares, and their power laws."""
    cube = stacked(parts)
    quantities = {"energy_error": "energy error", "lag": "lag along the track"}
    for variable, text in quantities.items():
        unit = cube[variable].attrs["units"]
        rms: xr.DataArray = (cube[variable] ** 2).mean("orbit") ** 0.5
        cube[f"{variable}_rms"] = rms.assign_attrs(
            units=unit, long_name=f"root mean square of the {text} over the orbits"
        )
        errors = cube[variable].transpose("integrator", "source", "orbit", "sample").values
        laws = [[growth(one, time) for one in row] for row, time in zip(errors, cube.time.values, strict=True)]
        for key, unit_of, meaning in (
            ("exponent", "1", f"exponent of the growth of the {text}"),
            ("interval", "1", f"half width of the 95 % interval of the exponent of the {text}"),
            ("bias", unit, f"absolute mean of the {text} over the orbits at the end"),
        ):
            values = np.array([[law[key] for law in row] for row in laws])
            cube[f"{variable}_{key}"] = (("integrator", "source"), values, {"units": unit_of, "long_name": meaning})
    return cube


def rounding_rows(cube: xr.Dataset) -> tuple[list[str], Rows]:
    """Header and rows: per method, arithmetic and quantity, the power law beside Brouwer's and bias against rms."""
    header = ["integrator", "source", "quantity", "exponent", "interval_95", "brouwer", "rms_at_end", "bias_over_rms"]
    rows: Rows = []
    expected = {"energy_error": 0.5, "lag": 1.5}
    for name, source, variable in product(cube.integrator.values, cube.source.values, expected):
        one = cube.sel(integrator=name, source=source)
        rms = one[f"{variable}_rms"].values[-1]
        law = [one[f"{variable}_{key}"].item() for key in ("exponent", "interval")]
        brouwer = "" if source == "coefficients" else expected[variable]
        rows.append([str(name), str(source), variable, *law, brouwer, float(rms), one[f"{variable}_bias"].item() / rms])
    return header, rows


@dataclass(frozen=True)
class Reduction:
    """How one ensemble becomes a ``cube`` and the ``rows`` of its table, under ``note``."""

    cube: Callable[[Mapping[str, xr.Dataset]], xr.Dataset]
    rows: Callable[[xr.Dataset], tuple[list[str], Rows]]
    note: str


REDUCTIONS = {
    "henon_heiles": Reduction(
        henon_heiles_cube,
        henon_heiles_rows,
        f"Henon-Heiles ensembles: largest tau/s up to which at most {TOLERATED:.0%} of the trajectories escape.",
    ),
    "kepler": Reduction(
        kepler_cube,
        kepler_rows,
        f"Kepler: force evaluations per orbit from which on the largest energy error stays below {CONTOUR:g}.",
    ),
    "rounding": Reduction(
        rounding_cube,
        rounding_rows,
        "Growth of round-off along Kepler orbits, against time: energy over |H0|, and lag in mean anomaly (rad).",
    ),
}
