"""Runs of a job: their samples and errors as described variables, without loading xarray."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.engine.description import block_variables, error_variables, tau_variable, trajectory_variables
from nearharmonic.engine.problem import Problem
from nearharmonic.engine.settings import KINETIC_POTENTIAL
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.output.dataset import Variables
from nearharmonic.systems.system import System


def sampled(
    system: str | System,
    integrator: str | Tableau,
    steps: Sequence[int],
    *,
    t_end: str,
    precision: str,
    summation: str,
    first: str | None,
    samples: int,
    split: str = KINETIC_POTENTIAL,
) -> Variables:
    """Integrate one run for each of ``steps``.

    Settings are those of :func:`nearharmonic.engine.trajectory.integrate`.

    Returns
    -------
    Variables
        t, q, p, energy_error and the system's observables over (tau_per_stage, sample, component); the maximum, the
        mean and the number of the steps since the previous sample over (tau_per_stage, sample); tau, steps,
        evaluations, status and diverged_at over tau_per_stage, which has no coordinate.
    """
    problem = Problem(
        system, integrator, t_end=t_end, precision=precision, summation=summation, first=first, split=split
    )
    paths = problem.run(steps, samples)
    path = trajectory_variables(problem, paths, problem.system.constants(float))
    # The order of variables is that of the files.
    leading = {name: path.pop(name) for name in ("t", "q", "p", "energy_error")}
    errors = {
        name: value for name, value in error_variables(paths, problem).items() if not name.endswith("energy_error")
    }
    return {**leading, **block_variables(paths), **path, **errors, **tau_variable(problem, paths)}
