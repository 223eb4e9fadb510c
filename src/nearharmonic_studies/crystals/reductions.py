"""Reductions over the starts of each crystal, the leader at each temperature and step size, drift and averages."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import product
from math import isfinite, nan
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.integrators import integrators
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.crystals.settings import TRAINED_ON_CRYSTALS, CrystalsSettings
from nearharmonic_studies.crystals.solids import BOLTZMANN

reduction = Reductions()

#: Kinds of methods by the beginnings of their sources; all others are general.
KINDS = {"paper": ("Nielsen", "found by"), "trained": ("trained by",)}
GENERAL, UNREGISTERED = "general", "trained on crystals"
QUANTILES = (0.1, 0.5, 0.9)
#: An energy error above this part of the mean kinetic energy is useless: no method leads there.
USELESS = 0.1
#: The window of step sizes in the note of a trained method.
_WINDOW = re.compile(r"tau/s ([\d.]+) to ([\d.]+)")
#: Bins of the density of phonons from 0 to the highest frequency.
BINS = 60


@reduction("max_energy_error", over="start")
def max_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the starts of the maximum energy error."""
    return _quantiles(runs.max_energy_error)


@reduction("mean_energy_error", over="start")
def mean_energy_error(runs: xr.Dataset) -> xr.DataArray:
    """Quantiles over the starts of the mean energy error."""
    return _quantiles(runs.mean_energy_error)


@reduction("max_energy_error", over="start")
def leaders(runs: xr.Dataset) -> xr.Dataset:
    """The registered method of the smallest median error, and its lead in decades over the best of another kind."""
    runs = runs.drop_sel(integrator=TRAINED_ON_CRYSTALS.name, errors="ignore")
    median = _quantiles(runs.max_energy_error).sel(quantile=0.5, drop=True)
    error = median.transpose(..., "integrator").values
    kinds = np.array([kind_of(str(name)) for name in runs.integrator.values])
    leader = error.argmin(axis=-1)
    best = np.take_along_axis(error, leader[..., None], -1)[..., 0]
    others = np.where(kinds[leader][..., None] == kinds, np.inf, error).min(axis=-1)
    useful = best < USELESS
    with np.errstate(divide="ignore", invalid="ignore"):
        lead = np.where(useful, log(np.minimum(others, 1.0) / best) / log(10.0), np.nan)
    over = median.isel(integrator=0, drop=True)
    names = runs.integrator.values[leader].astype(object)
    return xr.Dataset({
        "leader": over.copy(data=np.where(useful, names, "")).assign_attrs(
            described("method of the smallest median of the maximum error; none if no error is below a tenth")
        ),
        "lead": over.copy(data=lead).assign_attrs(
            described("log10 of the error of the best method of another kind over that of the leader", "1")
        ),
    })  # fmt: skip


def kind_of(name: str) -> str:
    """Return the kind of a method: of the paper and its harmonic conditions, trained, general, or not registered."""
    if name == TRAINED_ON_CRYSTALS.name:
        return UNREGISTERED
    source = integrators[name].source
    return next((kind for kind, begins in KINDS.items() if source.startswith(begins)), GENERAL)


def window_of(name: str) -> tuple[float, float]:
    """Return the window of step sizes per stage that a method was trained for, NaN for other methods."""
    found = _WINDOW.search(integrators[name].note or "") if kind_of(name) == "trained" else None
    return (float(found[1]), float(found[2])) if found else (nan, nan)


def density(frequencies: Floats) -> Floats:
    """Return the density (bins,) of phonons over frequency divided by the highest; its mean is 1."""
    places = np.minimum((frequencies / frequencies.max() * BINS).astype(int), BINS - 1)
    return np.bincount(places[frequencies > 0], minlength=BINS) * BINS / np.count_nonzero(frequencies > 0)


def _quantiles(errors: xr.DataArray) -> xr.DataArray:
    ranks = [min(errors.sizes["start"] - 1, int(q * errors.sizes["start"])) for q in QUANTILES]
    ascending = xr.apply_ufunc(np.sort, errors, input_core_dims=[["start"]], output_core_dims=[["start"]])
    found: xr.DataArray = ascending.isel(start=xr.DataArray(ranks, dims="quantile")).drop_vars("start", errors="ignore")
    fractions = coordinate("quantile", list(QUANTILES), "fraction of the starts that err less")
    text = f"quantile over the starts of the {errors.attrs['long_name']}"
    return found.assign_coords(fractions).assign_attrs(described(text))


def trend(energy: xr.DataArray) -> xr.DataArray:
    """Return the change of the energy (..., run) over the whole run, by a straight line of least squares."""
    look = energy.look - energy.look.mean()
    slope: xr.DataArray = (energy * look).sum("look") / (look * look).sum("look")
    rise: xr.DataArray = slope * (energy.look[-1] - energy.look[0])
    return rise


def reduce(
    names: Sequence[str], settings: CrystalsSettings, averages: str, errors: Sequence[str], drifts: Sequence[str]
) -> dict[str, Any]:
    """Return the ``cube`` of all crystals and its ``table`` of leaders, from run files of the methods ``names``.

    ``averages``: path of the runs with a thermostat. ``errors``, ``drifts``: paths of the runs and of the long runs of
    each crystal.
    """
    crystal_names = list(settings.crystals)
    parts, trends = [], []
    for path, long in zip(errors, drifts, strict=True):
        runs = read(path)
        part = reduction.of(runs, over="start")
        part["delta"] = runs["delta"]
        part["density"] = ("bin", density(runs.frequency.values), described("density of phonons, mean 1", "1"))
        part["coordinates"] = ((), runs.attrs["coordinates"], described("number of coordinates", "1"))
        kelvin = runs.attrs["melting"] / BOLTZMANN if isfinite(runs.attrs["unit_of_time_fs"]) else nan
        part["melting"] = ((), kelvin, described("melting point; none for a model without units", "K"))
        parts.append(part)
        trends.append(trend(read(long).energy))
    crystals = xr.Dataset(coords=coordinate("crystal", crystal_names, "crystal")).crystal
    cube = xr.concat(parts, crystals, coords="minimal", compat="override")
    cube["drift"] = xr.concat(trends, crystals, coords="minimal", compat="override").assign_attrs(
        described("change of H over a long run, by a straight line, in units of the mean kinetic energy", "1")
    )
    kinds = [kind_of(str(name)) for name in cube.integrator.values]
    cube.coords["kind"] = ("integrator", kinds, described("kind of the method"))
    cube["window"] = (
        ("integrator", "bound"), [window_of(str(name)) for name in cube.integrator.values],
        described("step sizes per stage that the method was trained for, times the frequency", "1"),
    )  # fmt: skip
    return {"cube": with_averages(cube, read(averages)), "table": table_of(cube)}


def with_averages(cube: xr.Dataset, runs: xr.Dataset) -> xr.Dataset:
    """Add the averages of ``potential`` and ``kinetic`` energy, and their standard errors from blocks."""
    for name in ("potential", "kinetic"):
        values = runs[name]
        error = values.std("block", ddof=1) / np.sqrt(values.sizes["block"])
        cube[name] = values.mean("block").assign_attrs(values.attrs)
        cube[f"{name}_error"] = error.assign_attrs(described(f"standard error of the {name} energy", "1"))
    return cube


def table_of(cube: xr.Dataset) -> Table:
    """Return a row for each crystal, temperature and number of forces: leader, error, and lead."""
    rows = []
    for crystal, temperature, forces in product(*(cube[one].values for one in ("crystal", "temperature", "forces"))):
        one = cube.sel(crystal=crystal, temperature=temperature, forces=forces)
        leader = str(one["leader"].item())
        if leader:
            error = one["max_energy_error"].sel(quantile=0.5, integrator=leader).item()
            rows.append(
                [str(crystal), float(temperature), float(forces), leader, kind_of(leader), error, one["lead"].item()]
            )
    caption = (
        "Methods with the smallest median of the maximum energy error, in units of the mean kinetic energy, by "
        "crystal, temperature over that of the melting point, and forces in a period of the fastest phonon; lead in "
        "decades over the best method of another kind."
    )
    return Table(
        header=["crystal", "temperature", "forces", "leader", "kind", "max_energy_error", "lead"], rows=rows,
        caption=caption,
    )  # fmt: skip
