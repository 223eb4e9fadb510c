"""All planned runs of some sweeps, and what the plan omits."""

from nearharmonic_paper.experiments.paper import run as plan


def planned_runs(sweeps, methods):
    return [
        run
        for sweep in sweeps
        for name in methods
        for index in range(plan.shards_of(sweep, name))
        for run in plan.runs_of(sweep, name, index)
    ]


def omitted(sweeps, methods):
    return [row for sweep in sweeps for name in methods for row in plan.omissions(sweep, name)]
