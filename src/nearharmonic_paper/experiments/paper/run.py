"""Runs of one method on one system.

:mod:`nearharmonic_paper.experiments.paper.reductions` derives further quantities.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from nearharmonic.engine.description import kernel_in_words, sampled
from nearharmonic.engine.settings import Sweep
from nearharmonic.engine.trajectory import Problem
from nearharmonic.output.dataset import Contents, Variable, Variables, coordinate, counted
from nearharmonic.systems import systems
from nearharmonic_paper.experiments.paper.plan import Run, runs_of

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
    taus, own = (np.asarray(one["tau_per_stage"][1]) for one in (whole, part))
    rows = np.searchsorted(taus, own).tolist()
    return gathered([(part, rows, range(own.size))], taus, len(whole["sample"][1]) if "sample" in whole else 0)


def gathered(pieces: Sequence[tuple[Variables, Sequence[int], Sequence[int]]], taus: Any, samples: int) -> Variables:
    """Return the variables of runs with step sizes ``taus``, from ``pieces``: variables, rows to fill, and their rows.

    Runs of fewer samples are padded, and rows of no piece are vacant: NaN, 0 or the status "skipped".
    """
    found: Variables = {}
    sizes = {"tau_per_stage": len(taus), "sample": samples}
    for name, (dims, values, notes) in pieces[0][0].items():
        filled = values
        if name == "tau_per_stage":
            filled = np.array(taus)
        elif name == "sample":
            filled = np.arange(samples, dtype=values.dtype)
        elif "tau_per_stage" in dims:
            vacant = "skipped" if name == "status" else np.nan if values.dtype.kind == "f" else 0
            shape = [sizes.get(dim, size) for dim, size in zip(dims, values.shape, strict=True)]
            filled = np.full(shape, vacant, values.dtype)
            for variables, rows, theirs in pieces:
                taken = variables[name][1][list(theirs)]
                if "sample" in dims:
                    taken = taken[:, :samples]
                    filled[list(rows), : taken.shape[1]] = taken
                else:
                    filled[list(rows)] = taken
        found[name] = dims, filled, notes
    return found
