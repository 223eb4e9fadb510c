"""Gains of methods over leapfrog, with intervals over the chains, and of trained methods over the best known one."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.math import exp
from nearharmonic.numerics.portable import Floats
from nearharmonic.output.store import coordinate, described, read
from nearharmonic.output.table import Table
from nearharmonic_paper.tasks.reduction import Reductions
from nearharmonic_studies.samplers.chains import error_of, student
from nearharmonic_studies.samplers.settings import SamplersSettings

reduction = Reductions()

#: Beginning of the names of the methods that the experiment trains.
SEARCHED = "searched_"
#: Where the fewest gradients are: variables of each target.
PLACE = ("acceptance", "tau", "length")


@reduction("cost", over="part")
def cost(runs: xr.Dataset) -> xr.Dataset:
    """Gradients per effective sample, and the gain over the first method."""
    values = runs.cost.transpose(..., "integrator", "part").values
    return xr.Dataset({
        **_with_interval(runs, "cost", values, "gradients per effective sample of the slowest observable"),
        **_with_interval(runs, "gain", values[..., :1, :] - values, "gradients of the first method over those of one"),
    })  # fmt: skip


@reduction("cost", over="part")
def over_best(runs: xr.Dataset) -> xr.Dataset:
    """Gain over the best of the methods that the experiment does not train."""
    values = runs.cost.transpose(..., "integrator", "part").values
    known = np.array([not str(name).startswith(SEARCHED) for name in runs.integrator.values])
    best = np.where(known[:, None], values, np.inf)[..., :, 0].argmin(axis=-1)
    reference = np.take_along_axis(values, best[..., None, None], axis=-2)
    found = _with_interval(
        runs, "over_best", reference - values, "gradients of the best known method over those of one"
    )
    names = xr.DataArray(runs.integrator.values[best], dims=runs.cost.dims[:-2]).assign_attrs(
        described("method that is not trained here with the fewest gradients per effective sample")
    )
    return xr.Dataset({**found, "best": names})


def _with_interval(runs: xr.Dataset, name: str, logs: Floats, text: str) -> dict[str, xr.DataArray]:
    """Return exp of logs (..., chains + 1) and their 95 % intervals, by name."""
    over = runs.cost.transpose(..., "integrator", "part").isel(part=0, drop=True)
    half = np.apply_along_axis(error_of, -1, logs) * student(logs.shape[-1] - 2)
    middle, found = logs[..., 0], {}
    for end, value, which in (("", middle, ""), ("_low", middle - half, "lower"), ("_high", middle + half, "upper")):
        notes = described(f"{which} end of the 95 % interval of the {text}" if which else text)
        found[name + end] = over.copy(data=np.array(exp(np.clip(value, -50, 50)))).assign_attrs(notes)
    return found


def reduce(settings: SamplersSettings, gaussians: str, limits: str, chains: Sequence[str]) -> dict[str, Any]:
    """Return the ``cube`` of all targets and its ``table``, from run files.

    ``gaussians``, ``limits``: paths of the runs on Gaussians, and of methods trained for one strength. ``chains``:
    paths of the runs on each other target.
    """
    runs = [read(path) for path in chains]
    names = xr.Dataset(coords=coordinate("target", list(settings.targets), "target")).target
    parts = [reduction.of(one, over="part").assign(one[["acceptance", "tau", "length"]]) for one in runs]
    cube = xr.concat(parts, names, coords="minimal", compat="override")
    cube["target_label"] = ("target", [one.attrs["target_label"] for one in runs], described("name of the target"))
    exact = read(gaussians)
    for name in ("gradients", "acceptance", "tau", "length"):
        cube[f"gaussian_{name}"] = exact[name]
    first = exact["gradients"].isel(integrator=0, drop=True)
    text = "gradients of the first method over those of one, on a Gaussian"
    cube["gaussian_gain"] = (first / exact["gradients"]).assign_attrs(described(text))
    special = read(limits)
    cube["training_objective"] = special["known_objective"]
    gains = special["special_gain"]
    cube["special_gain"] = gains.mean("set").assign_attrs(gains.attrs)
    half = gains.std("set", ddof=1) / np.sqrt(gains.sizes["set"]) * student(gains.sizes["set"] - 1)
    cube["special_half"] = half.assign_attrs(described("half of the 95 % interval of the gain, over sets of starts"))
    return {"cube": cube.set_coords(["target_label"]), "table": table_of(cube)}


def table_of(cube: xr.Dataset) -> Table:
    """Return a row for each target and method: gradients, gain with its interval, acceptance, step size, length."""
    gains = [f"{what}{end}" for what in ("gain", "over_best") for end in ("", "_low", "_high")]
    rows = []
    for target, name in product(cube.target.values, cube.integrator.values):
        one = cube.sel(target=target, integrator=name)
        rows.append([str(target), str(name), *(float(one[what]) for what in ("cost", *gains, *PLACE))])
    for n, name in product(cube.dimension.values, cube.integrator.values):
        one = cube.sel(dimension=n, integrator=name)
        known = {"cost": one.gaussian_gradients, "gain": one.gaussian_gain}
        known |= {what: one[f"gaussian_{what}"] for what in PLACE}
        values = (float(known.get(what, np.nan)) for what in ("cost", *gains, *PLACE))
        rows.append([f"Gaussian, n = {n:g}", str(name), *values])
    caption = (
        "Gradients per effective sample of Hamiltonian Monte Carlo with each method, gains over leapfrog and over the "
        "best method that is not trained here, with 95 % intervals, at the best step size (per stage) and length."
    )
    header = ["target", "method", "cost", *gains, "acceptance", "tau_per_stage", "length"]
    return Table(header=header, rows=rows, caption=caption)
