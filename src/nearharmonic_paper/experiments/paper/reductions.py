"""Reductions of runs: an ``xarray.Dataset`` of the runs of one method on one system in, numbers for the cube out.

A reduction is a function below ``@reduction(...)``, which names the variables of a run file that it needs, over
(tau_per_stage, sample, component). Attributes of the dataset name ``system`` and ``integrator``. With
``over="tau_per_stage"`` a reduction takes the whole curves of the cube instead.
No integration depends on this module, except one that keeps reduced numbers alone.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf, nan
from typing import Any

import numpy as np
import xarray as xr

from nearharmonic.engine.description import SINCE, drift_variables
from nearharmonic.engine.settings import Sweep
from nearharmonic.engine.setup import energy_at_start
from nearharmonic.integrators import integrators
from nearharmonic.numerics.portable import Floats, line_fit, trend_linearity, unwrapped
from nearharmonic.numerics.portable import observed_order as order_of_curve
from nearharmonic.output import store
from nearharmonic.output.store import Contents, Variable, Variables, assembled, described, variable, variables_of
from nearharmonic.systems import systems
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.paper.run import COORDINATES, PAPER, Completion, Run, integrate, integrate_run
from nearharmonic_paper.tasks.reduction import Reductions, exact_sum

reduction = Reductions()


@reduction("block_max_energy_error", "status")
def max_energy_error(runs: xr.Dataset) -> Variable:
    """Maximum over every step of |H - H0|/|H0|; infinite for a run that left its energy surface."""
    blocks = runs.block_max_energy_error
    return _over_every_step(runs, blocks, np.fmax.reduce(blocks.values, axis=1))


@reduction("block_mean_energy_error", "block_steps", "steps", "status")
def mean_energy_error(runs: xr.Dataset) -> Variable:
    """Mean over every step of |H - H0|/|H0|; infinite for a run that left its energy surface."""
    means = runs.block_mean_energy_error
    blocks = xr.DataArray(_of_whole_runs(runs, (means.values * runs.block_steps.values).T).T, dims=means.dims)
    return _over_every_step(runs, means, exact_sum(blocks, "sample").values / runs.steps.values)


def _over_every_step(runs: xr.Dataset, blocks: xr.DataArray, values: Floats) -> Variable:
    text = blocks.attrs["long_name"].replace(SINCE, "over every step, inf if diverged")
    found = np.where(runs.status.values == "diverged", inf, values)
    return variable("tau_per_stage", found, text, blocks.attrs["units"])


def _of_whole_runs(runs: xr.Dataset, values: Any) -> Floats:
    """``values`` (..., R) of R runs, NaN for a run that diverged."""
    return np.where(runs.status.values == "ok", values, nan)


@reduction("t", "perihelion_angle", "status")
def perihelion_advance(runs: xr.Dataset) -> xr.Dataset:
    """Advance of the perihelion per orbit by regression, signed, the half width of its 95 % interval, and linearity.

    The latter are the coefficient of determination of the regression, and the ratio of its two halves.
    """
    period = orbital_period(systems[runs.attrs["system"]])
    points = unwrapped(runs.t.values, runs.perihelion_angle.values)
    slope, width = (_of_whole_runs(runs, value) * period for value in line_fit(*points))
    determination, halves = (_of_whole_runs(runs, value) for value in trend_linearity(*points))
    interval = "half width of the 95 % interval of the perihelion advance per orbit"
    line = "coefficient of determination R^2 of the perihelion angle as a linear function of time"
    ratio = "perihelion advance in the second half of the samples over that in the first"
    return xr.Dataset({
        "perihelion_advance": variable("tau_per_stage", slope, "perihelion advance per orbit", "rad"),
        "perihelion_advance_interval": variable("tau_per_stage", width, interval, "rad"),
        "perihelion_advance_linearity": variable("tau_per_stage", determination, line),
        "perihelion_advance_halves": variable("tau_per_stage", halves, ratio),
    })  # fmt: skip


@reduction("tau", "perihelion_angle")
def evaluations_per_orbit(runs: xr.Dataset) -> Variable:
    """Force evaluations in one period of the exact orbit."""
    period, stages = orbital_period(systems[runs.attrs["system"]]), integrators[runs.attrs["integrator"]].stages
    return variable("tau_per_stage", period / runs.tau.values * stages, "force evaluations per orbit")


@reduction("q", "p", "status")
def invariant_drifts(runs: xr.Dataset) -> xr.Dataset:
    """Largest change of each invariant that the system declares, ``<invariant>_drift``."""
    system = systems[runs.attrs["system"]]
    diverged = (runs.status == "diverged").values
    found = drift_variables(system, runs.q.values, runs.p.values, diverged)
    return xr.Dataset({name: value for name, value in found.items() if value[0] == ("tau_per_stage",)})


@reduction("tau", "max_energy_error", over="tau_per_stage")
def observed_order(curves: xr.Dataset) -> xr.DataArray:
    """Slope of the maximum energy error against the step size, above round-off."""
    return order_of_curve(curves.tau, curves.max_energy_error)


def orbital_period(system: System) -> float:
    """Return the period of the exact orbit from the initial values of ``system``, in its unit of time; NaN if none."""
    return nan if system.period is None else system.period(*system.start(float), *system.constants(float))


# --- Assembly of cubes from run files: the reduced numbers of all methods.

#: Values of cells without a run; other variables are NaN.
NO_RUN: dict[Any, Any] = {"status": "skipped", "steps": 0, "evaluations": 0, "diverged_at": 0}
#: Variables that a cube copies from run files.
TAKEN_OVER = ("tau_per_stage", "tau", "steps", "evaluations", "status", "diverged_at")


def reduce(sweep: Sweep, integrators: Sequence[str], **runs: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``cube`` of a system, :func:`cube_of` the files of each method, by its name in ``runs``.

    They are its run files, or one file of reduced numbers. The methods are in the order of ``integrators``.
    """
    return {"cube": cube_of(sweep.system, {name: numbers_of(sweep.system, runs[name]) for name in integrators})}


def reduce_method(sweep: Sweep, integrator: str, runs: Sequence[str]) -> dict[str, xr.Dataset]:
    """Return the ``reduced`` numbers of the run files of a method: a cube of many files is made in constant memory."""
    return {"reduced": numbers_of(sweep.system, runs).assign_attrs(system=sweep.system, integrator=integrator)}


def numbers_of(system: str, paths: Iterable[str]) -> xr.Dataset:
    """Return the counts and the reduced numbers of one method's runs over (precision, tau_per_stage).

    One file is read at a time, without the variables that no reduction of the system needs.
    """
    shards: dict[str, list[xr.Dataset]] = {}
    for path in paths:
        for precision, runs in store.read_precisions(path, leave_out=_left_out(system)).items():
            if "precision" in runs.dims:
                return runs  # runs of all files of a method
            shards.setdefault(precision, []).append(numbers(runs))
    for parts in shards.values():  # each has increasing step sizes
        parts.sort(key=lambda runs: runs.tau_per_stage.values.tolist())
    curves = {name: joined(parts, "tau_per_stage") for name, parts in shards.items()}
    whole = joined([one.expand_dims(precision=[name]) for name, one in curves.items()], "precision")
    whole["precision"].attrs |= described("precision")
    return whole


def _left_out(system: str) -> tuple[str, ...]:
    """States, the largest part of a run file: only drifts of invariants need them, and the paper does without."""
    return ("q", "p", "q_low", "p_low") if system in PAPER else ()


def numbers(runs: xr.Dataset) -> xr.Dataset:
    """Return the numbers of ``runs`` over tau_per_stage: from the file, and from the reductions."""
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
    labels = [integrators[name].label for name in methods]
    cube = joined([numbers.expand_dims(integrator=[name]) for name, numbers in methods.items()], "integrator")
    cube = cube.transpose("precision", "integrator", "tau_per_stage").assign_coords(label=("integrator", labels))
    cube = cube.assign(reduction.of(cube, over="tau_per_stage"))
    stages = np.array([integrators[name].stages for name in methods])
    cube["stages"] = ("integrator", stages, described("stages s: tau is s times the step size per stage"))
    cube.tau_per_stage.attrs |= described("step size per stage", problem.units["t"])
    label = "name in the paper" if problem.name in systems.registered else "label"
    for name, text in (("integrator", "integrator"), ("label", label), ("precision", "precision")):
        cube[name].attrs |= described(text)
    attributes: dict[str, Any] = {"system": system, "system_label": problem.label}
    if system not in systems.registered:
        attributes |= {"energy_at_start": energy_at_start(problem), "energy_unit": problem.units["energy"]}
    constants = {name: parameter.value for name, parameter in problem.parameters.items()}
    for name, value in (("q0", problem.q0), ("p0", problem.p0), ("parameters", constants)):
        attributes[name] = json.dumps(value)
    if problem.period is not None:
        attributes["orbital_period"] = orbital_period(problem)
    if "energy_floor" in cube.attrs:  # of the run files
        attributes["energy_floor"] = cube.attrs["energy_floor"]
    cube.attrs = attributes
    return cube


def joined(parts: Sequence[xr.Dataset], dimension: str) -> xr.Dataset:
    """Return ``parts`` along ``dimension``, with fill values for missing variables of a part."""
    if len(parts) == 1 and all(dimension in one.dims for one in parts[0].data_vars.values()):
        return parts[0]
    return xr.concat(
        parts, dimension, data_vars="all", coords="minimal", compat="override", join="outer", combine_attrs="override",
        fill_value={name: NO_RUN.get(name, np.nan) for part in parts for name in part.data_vars},
    )  # fmt: skip


# --- Runs of which reduced numbers alone are kept.

#: Samples of a run, from which its numbers are computed before it is dropped.
SAMPLES = 500
#: Runs that are held at once: 28 MB of planar trajectories.
AT_ONCE = 1000


def integrate_and_reduce(
    sweep: Sweep, integrator: str, shard: int, earlier: Completion | None = None
) -> dict[str, Contents]:
    """Integrate one shard with 500 samples, as :func:`integrate` does, and keep numbers over tau_per_stage alone."""
    return integrate(sweep, integrator, shard, earlier, reduced_run)


def reduced_run(run: Run) -> Variables:
    """Return the numbers of planned runs over tau_per_stage, a thousand runs at a time."""
    parts = []
    for begin in range(0, len(run.steps), AT_ONCE):
        among = slice(begin, begin + AT_ONCE)
        some = replace(run, tau_per_stage=run.tau_per_stage[among], steps=run.steps[among], samples=SAMPLES)
        notes = {"system": run.sweep.system, "integrator": run.integrator}
        trajectories = assembled(integrate_run(some), COORDINATES, notes)
        parts.append(numbers(trajectories.drop_vars(_left_out(run.sweep.system), errors="ignore")))
    return variables_of(joined(parts, "tau_per_stage"))
