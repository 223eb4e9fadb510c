"""Runs of one method on one system.

:mod:`nearharmonic_paper.experiments.paper.reductions` derives further quantities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nearharmonic.engine.description import kernel_in_words, sampled
from nearharmonic.engine.settings import Sweep
from nearharmonic.engine.solution import Problem
from nearharmonic.output.dataset import Contents, Variable, Variables, coordinate, counted
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper.grid.plan import Run, runs_of

#: Auxiliary coordinates of a run file.
COORDINATES = ("t",)
#: The variables of runs; and what completes those of an earlier plan with what such a function returns for the others.
Integration = Callable[[Run], Variables]
Completion = Callable[[Run, Integration], Variables]


def integrate(sweep: Sweep, integrator: str, shard: int, earlier: Completion | None = None) -> dict[str, Contents]:
    """Integrate one shard, numbered from 0, of the step sizes of a method on a system, as the contents ``run``.

    Runs in double precision are in the root of a file, those in extended precision in a group. If there are runs in
    double precision, the group has their step sizes and samples, so that ``xarray.open_datatree`` opens both; runs that
    the plan omits have the status "skipped". ``earlier`` takes runs over from the files of an earlier config.
    """
    return {"run": contents(sweep, integrator, shard, earlier, integrate_run)}


def contents(sweep: Sweep, integrator: str, shard: int, earlier: Completion | None, function: Integration) -> Contents:
    """Return the contents of a run file: what ``function`` returns for the runs that ``earlier`` does not hold."""
    planned = runs_of(sweep, integrator, shard)
    problems = {run.precision: problem_of(run) for run in planned}
    parts = {run.precision: earlier(run, function) if earlier else function(run) for run in planned}
    attributes: dict[str, object] = {
        "system": sweep.system,
        "integrator": integrator,
        "precision": " ".join(parts),
        "kernel": "; ".join(map(kernel_in_words, problems.values())),
    }
    attributes |= {} if not problems else next(iter(problems.values())).standard_floor()
    made = sum(map(_evaluations, parts.values()))
    root = parts.pop("double", {})
    groups = {name: _padded(part, root) if root else part for name, part in parts.items()}
    return Contents(variables=root, attributes=attributes, coordinates=COORDINATES, groups=groups, evaluations=made)


def _evaluations(variables: Variables) -> int:
    """Return the force evaluations of runs; step sizes with equal numbers of steps share a run."""
    _, first = np.unique(variables["steps"][1], return_index=True)
    return int(np.asarray(variables["evaluations"][1])[first].sum())


def integrate_run(run: Run) -> Variables:
    """Return trajectories over (tau_per_stage, sample, component), blocks over the first two, and counts of runs.

    ``block_max_energy_error`` and ``block_mean_energy_error`` cover the ``block_steps`` steps since the previous
    sample, so that they determine maximum and mean over all steps.
    """
    problem = problem_of(run)
    grid = coordinate("tau_per_stage", run.tau_per_stage, "step size per stage", problem.system.units["t"])
    variables = grid | sampled(problem, run.steps, run.samples)
    return variables | counted(variables)


def problem_of(run: Run) -> Problem:
    """Return the system, method and settings of planned runs."""
    sweep = run.sweep
    system = systems[sweep.system]
    return Problem(system, run.integrator, t_end=sweep.t_end, precision=run.precision, **sweep.shared_settings)


def _padded(part: Variables, whole: Mapping[str, Variable]) -> Variables:
    """Return the runs of ``part``, padded to all step sizes and samples of ``whole``."""
    grid = np.asarray(whole["tau_per_stage"][1])
    rows = np.searchsorted(grid, np.asarray(part["tau_per_stage"][1]))
    sizes = {name: len(whole[name][1]) for name in ("tau_per_stage", "sample") if name in whole}
    found: Variables = {}
    for name, (dims, values, notes) in part.items():
        if name in whole and name in dims:
            found[name] = whole[name]
            continue
        filled = vacant(name, values, [sizes.get(d, n) for d, n in zip(dims, values.shape, strict=True)])
        filled[np.ix_(rows, *map(np.arange, values.shape[1:]))] = values
        found[name] = dims, filled, notes
    return found


def vacant(name: str, values: Any, shape: Sequence[int]) -> Any:
    """Return an array for a variable without runs: NaN, 0 or the word "skipped"."""
    filler = "skipped" if name == "status" else np.nan if values.dtype.kind == "f" else 0
    return np.full(shape, filler, values.dtype)
