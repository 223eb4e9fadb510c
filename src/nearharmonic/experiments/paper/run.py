"""The runs of one method on one system, and one number of each for every step size."""

from __future__ import annotations

import numpy as np

from nearharmonic.engine.sampled import sampled
from nearharmonic.engine.settings import Sweep
from nearharmonic.experiments.paper.plan import Run, runs_of
from nearharmonic.experiments.paper.reductions import Runs, reduced
from nearharmonic.integrators import integrators
from nearharmonic.output.dataset import Contents, Variables, coordinate
from nearharmonic.systems import systems


def integrate(sweep: Sweep, integrator: str, shard: int) -> dict[str, Contents]:
    """Integrate one shard of the step sizes of a method on a system.

    Parameters
    ----------
    sweep : Sweep
        What is asked of the system.
    integrator : str
        Name of the method.
    shard : int
        Number of the shard, from 0.

    Returns
    -------
    dict
        ``run``: the runs in double precision in the root of a file, those in extended precision in a group.
    """
    parts = {run.precision: integrate_run(run) for run in runs_of(sweep, integrator, shard)}
    made = sum(_evaluations(variables) for variables in parts.values())
    return {"run": Contents(variables=parts.pop("double", {}), groups=parts, evaluations=made)}


def _evaluations(variables: Variables) -> int:
    """Force evaluations of runs; step sizes that round to one number of steps share a run."""
    _, first = np.unique(variables["steps"][1], return_index=True)
    return int(np.asarray(variables["evaluations"][1])[first].sum())


def integrate_run(run: Run) -> Variables:
    """Integrate a planned run.

    Returns
    -------
    Variables
        Trajectories over (tau_per_stage, sample, component), blocks over (tau_per_stage, sample), and the results of
        the reductions over tau_per_stage. ``block_max_energy_error`` and ``block_mean_energy_error`` cover the
        ``block_steps`` steps since the sample before, so that maximum and mean over every step follow from them.
    """
    system, tableau = systems[run.system], integrators[run.integrator]
    unit = system.units["t"]
    variables = sampled(
        system,
        tableau,
        run.steps,
        t_end=run.t_end,
        precision=run.precision,
        summation=run.summation,
        first=run.first,
        samples=run.samples,
        split=run.split,
    )
    grid = coordinate("tau_per_stage", run.tau_per_stage, "step size per stage", unit)
    return {**grid, **variables, **reduced(Runs(variables=variables, system=system, tableau=tableau))}
