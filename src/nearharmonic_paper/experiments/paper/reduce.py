"""Assembly of cubes from run files: the reduced numbers of all methods."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.engine.settings import Sweep
from nearharmonic.engine.setup import energy_at_start
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.output import store
from nearharmonic.output.dataset import described
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper.reductions import orbital_period, reduction
from nearharmonic_paper.experiments.paper.settings import PAPER

#: Values of cells without a run; other variables are NaN.
NO_RUN: dict[Any, Any] = {"status": "skipped", "steps": 0, "evaluations": 0, "diverged_at": 0}
#: States, the largest part of a run file. Only drifts of invariants need them, and the systems of the paper do without.
STATES = ("q", "p", "q_low", "p_low")
#: Variables that a cube copies from run files.
TAKEN_OVER = ("tau_per_stage", "tau", "steps", "evaluations", "status", "diverged_at")


def reduce(sweep: Sweep, integrators: Sequence[str], **runs: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``cube`` of a system, :func:`cube_of` the files of each method, by its name in ``runs``.

    They are its run files, or one file of reduced numbers.
    The methods are in the order of ``integrators``.
    """
    leave_out = STATES if sweep.system in PAPER else ()
    return {"cube": cube_of(sweep.system, {name: numbers_of(runs[name], leave_out) for name in integrators})}


def reduce_method(sweep: Sweep, integrator: str, runs: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``reduced`` numbers of the run files of a method: a cube of many files is made in constant memory."""
    found = numbers_of(runs, STATES if sweep.system in PAPER else ())
    return {"reduced": found.assign_attrs(system=sweep.system, integrator=integrator)}


def numbers_of(paths: Iterable[str], leave_out: Collection[str] = ()) -> xr.Dataset:
    """Return the counts and the reduced numbers of one method's runs over (precision, tau_per_stage).

    One file is read at a time, without the variables in ``leave_out`` and the reductions that need them.
    """
    shards: dict[str, list[xr.Dataset]] = {}
    for path in paths:
        for precision, runs in store.read_precisions(path, leave_out=leave_out).items():
            if "precision" in runs.dims:
                return runs  # those of all files of a method
            shards.setdefault(precision, []).append(numbers(runs))
    curves = {name: joined(parts, "tau_per_stage").sortby("tau_per_stage") for name, parts in shards.items()}
    whole = joined([one.expand_dims(precision=[name]) for name, one in curves.items()], "precision")
    whole["precision"].attrs |= described("precision")
    return whole


def numbers(runs: xr.Dataset) -> xr.Dataset:
    """Return the numbers of ``runs`` over tau_per_stage: those of the file, and the results of the reductions."""
    if "sample" not in runs.dims:
        return runs  # reduced already
    runs = runs.reset_coords()  # xarray compares auxiliary coordinates at every operation
    return runs[list(TAKEN_OVER)].assign(reduction.of(runs))


def cube_of(system: str, methods: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the cube of a system, over (precision, integrator, tau_per_stage).

    ``methods`` has the numbers of each method over (precision, tau_per_stage), by its name. Runs that the plan omits
    have the status "skipped" and NaN errors. A reader can run one again: the attributes ``q0``, ``p0`` and
    ``parameters`` are JSON of exact digits, as the arguments of :func:`nearharmonic.integrate` are.
    """
    problem = systems[system]
    labels = [methods_by_name[name].label for name in methods]
    cube = joined([numbers.expand_dims(integrator=[name]) for name, numbers in methods.items()], "integrator")
    cube = cube.transpose("precision", "integrator", "tau_per_stage").assign_coords(label=("integrator", labels))
    cube = cube.assign(reduction.of(cube, over="tau_per_stage"))
    stages = np.array([methods_by_name[name].stages for name in methods])
    cube["stages"] = ("integrator", stages, described("stages s: tau is s times the step size per stage"))
    cube.tau_per_stage.attrs |= described("step size per stage", problem.units["t"])
    label = "name in the paper" if problem.name in systems.registered else "label"
    for name, text in (("integrator", "integrator"), ("label", label), ("precision", "precision")):
        cube[name].attrs |= described(text)
    attributes: dict[str, Any] = {"system": system, "system_label": problem.label}
    if system not in systems.registered:
        attributes |= {"energy_at_start": energy_at_start(problem), "energy_unit": problem.units["energy"]}
    constants = {name: parameter.value for name, parameter in problem.parameters.items()}
    start = {"q0": problem.q0, "p0": problem.p0, "parameters": constants}
    attributes |= {name: json.dumps(value) for name, value in start.items()}
    if problem.period is not None:
        attributes["orbital_period"] = orbital_period(problem)
    if "energy_floor" in cube.attrs:  # of the run files
        attributes["energy_floor"] = cube.attrs["energy_floor"]
    cube.attrs = attributes
    return cube


def joined(parts: Sequence[xr.Dataset], dimension: str) -> xr.Dataset:
    """Return ``parts`` along ``dimension``, with fill values for missing variables of a part."""
    names = {name for part in parts for name in part.data_vars}
    return xr.concat(
        parts, dimension, data_vars="all", coords="minimal", compat="override", join="outer",
        fill_value={name: NO_RUN.get(name, np.nan) for name in names}, combine_attrs="override",
    )  # fmt: skip
