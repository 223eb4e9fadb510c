"""From run files to cubes: the reduced numbers of every method lined up, and the error terms of the oscillator."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.engine.settings import Sweep
from nearharmonic.engine.statistics import observed_order
from nearharmonic.experiments.paper.reductions import orbital_period
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.output import store
from nearharmonic.output.dataset import coordinate, described, method_coordinates, variable
from nearharmonic.systems import systems
from nearharmonic.systems.system import System

#: Datasets over tau_per_stage alone, one for each shard, by integrator and precision.
Shards = Mapping[str, Mapping[str, Sequence[xr.Dataset]]]


def reduce(sweep: Sweep, integrators: Sequence[str], **runs: Sequence[str]) -> dict[str, xr.Dataset]:
    """Assemble the cube of a system from its run files.

    Parameters
    ----------
    sweep : Sweep
        What is asked of the system.
    integrators : sequence of str
        Names of the methods, in the order of the cube.
    **runs
        Run files of each method, by its name.

    Returns
    -------
    dict
        ``cube``, as :func:`assembled` makes it.
    """
    return {"cube": assembled(sweep.system, {name: numbers_of(runs[name]) for name in integrators})}


def numbers_of(paths: Iterable[str]) -> dict[str, list[xr.Dataset]]:
    """Return what run files hold over tau_per_stage alone, by precision: kilobytes, trajectories stay on disk."""
    return store.read_precisions(paths, dimensions=("tau_per_stage",))


def assembled(system: str, parts: Shards) -> xr.Dataset:
    """Assemble the cube of a system from the reduced numbers of its shards.

    Parameters
    ----------
    system : str
        Name of the system.
    parts : mapping
        ``parts[integrator][precision]``: the numbers of each shard over tau_per_stage, in any order and number.

    Returns
    -------
    xr.Dataset
        Dimensions (integrator, tau_per_stage), and precision in front where a system has more than one. Runs that the
        plan left out have status "skipped" and NaN errors.
    """
    problem = systems[system]
    layers: dict[str, list[xr.Dataset]] = {}
    for name, by_precision in parts.items():
        for precision, shards in by_precision.items():
            whole = xr.concat(list(shards), "tau_per_stage", data_vars="all", join="outer").sortby("tau_per_stage")
            label = methods_by_name[name].label
            layers.setdefault(precision, []).append(whole.assign_coords(integrator=name, label=label))
    stacked = {precision: _stack(members, "integrator") for precision, members in layers.items()}
    if len(stacked) == 1:
        (dataset,) = stacked.values()
    else:
        dataset = _stack([d.assign_coords(precision=precision) for precision, d in stacked.items()], "precision")
    dataset = dataset.sel(integrator=list(parts))  # an outer join of precisions sorts by name
    best = dataset.isel(precision=0, drop=True) if "precision" in dataset.dims else dataset
    dataset["observed_order"] = observed_order(best.tau, best.max_energy_error)
    _describe(dataset, problem)
    attributes: dict[str, Any] = {"system": system, "system_label": problem.label}
    if problem.period is not None:
        attributes["orbital_period"] = orbital_period(problem)
    dataset.attrs = attributes  # not those of a shard, which are inherited
    return dataset


def _describe(dataset: xr.Dataset, problem: System) -> None:
    """Give the coordinates their units and long names, and ``status`` its third value if there are precisions."""
    if "precision" in dataset.dims:
        text = "; or skipped: the plan left the run out (tables/skipped.csv)"
        dataset.status.attrs["long_name"] = f"{dataset.status.attrs['long_name']}{text}"
    dataset.tau_per_stage.attrs |= {"units": problem.units["t"], "long_name": "step size per stage"}
    label = "name in the paper" if problem.name in systems.registered else "label"
    for name, text in (("integrator", "integrator"), ("label", label), ("precision", "precision")):
        if name in dataset.coords:
            dataset[name].attrs |= described(text)


def _stack(members: Iterable[xr.Dataset], dimension: str) -> xr.Dataset:
    """Concatenate on a new ``dimension``, filling what a member lacks: 0 counts, "skipped", NaN."""
    fill = {"status": "skipped", "steps": 0, "evaluations": 0, "diverged_at": 0}
    parts = list(members)
    names = {name for part in parts for name in part.data_vars}
    filling = {name: fill.get(str(name), np.nan) for name in names}
    return xr.concat(
        parts, dimension, data_vars="all", coords=[dimension, *(["label"] if dimension == "integrator" else [])],
        compat="override", join="outer", fill_value=filling, combine_attrs="override",
    )  # fmt: skip


def decompose(integrators: Sequence[str]) -> dict[str, xr.Dataset]:
    """Compute the position error terms of methods; the dataset ``cube`` is that of :func:`harmonic_terms`."""
    return {"cube": harmonic_terms(integrators)}


def harmonic_terms(methods: Sequence[str]) -> xr.Dataset:
    """Return the terms kappa over (integrator, first, order), as far as each composition's stages reach."""
    from nearharmonic.theory.oscillator import kappa, lambda_max

    tableaus = [methods_by_name[name] for name in methods]
    roles = ("drift", "kick")
    reach = {(t.name, first): lambda_max(t, first=first) for t in tableaus for first in roles}  # type: ignore[arg-type]
    highest = max(reach.values())
    values = np.full((len(tableaus), len(roles), highest), np.nan)
    for i, tableau in enumerate(tableaus):
        for j, first in enumerate(roles):
            terms = kappa(tableau, reach[tableau.name, first], first=first)  # type: ignore[arg-type]
            values[i, j, : len(terms)] = [float(term) for term in terms]
    text = "position error term kappa of the harmonic oscillator; kick first is BAB, drift first is ABA"
    return xr.Dataset(
        {"kappa": variable(("integrator", "first", "order"), values, text)},
        coords={
            **method_coordinates(tableaus),
            **coordinate("first", list(roles), "operator that comes first"),
            **coordinate("order", np.arange(1, highest + 1), "order lambda in tau"),
        },
    )
