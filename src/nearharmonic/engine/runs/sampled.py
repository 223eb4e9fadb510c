"""Runs of a job as described variables: samples, blocks and counts, without loading xarray."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.engine.runs.description import block_variables, error_variables, tau_variable, trajectory_variables
from nearharmonic.engine.runs.problem import Problem
from nearharmonic.output.dataset import Variables


def sampled(problem: Problem, steps: Sequence[int], samples: int) -> Variables:
    """Integrate one run for each of ``steps``.

    Parameters
    ----------
    problem : Problem
        System of d coordinates, method and settings.
    steps : sequence of int
        Steps of each run.
    samples : int
        Most states that a run keeps.

    Returns
    -------
    Variables
        t, q, p, energy_error and the system's observables over (tau_per_stage, sample, component); the maximum, the
        mean and the number of the steps since the previous sample over (tau_per_stage, sample); tau, steps,
        evaluations, status and diverged_at over tau_per_stage, which has no coordinate. Runs with fewer samples than
        the longest are padded: NaN, and 0 steps.
    """
    paths = problem.run(steps, samples)
    path = trajectory_variables(problem, paths, problem.system.constants(float))
    # The order of variables is that of the files.
    leading = {name: path.pop(name) for name in ("t", "q", "p", "energy_error")}
    counts = error_variables(paths, problem)
    del counts["max_energy_error"], counts["mean_energy_error"]  # reductions of the blocks
    return {**leading, **block_variables(problem, paths), **path, **counts, **tau_variable(problem, paths)}
