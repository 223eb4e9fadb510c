"""Runs of one method on one system of which reduced numbers alone are kept."""

from __future__ import annotations

from dataclasses import replace

from nearharmonic.engine.settings import Sweep
from nearharmonic.output.store import Contents, Variables, assembled, variables_of
from nearharmonic_paper.experiments.paper.plan import Run
from nearharmonic_paper.experiments.paper.reduce import STATES, joined, numbers
from nearharmonic_paper.experiments.paper.run import COORDINATES, Completion, contents, integrate_run
from nearharmonic_paper.experiments.paper.settings import PAPER

#: Samples of a run, from which its numbers are computed before it is dropped.
SAMPLES = 500
#: Runs that are held at once: 28 MB of planar trajectories.
AT_ONCE = 1000


def integrate_and_reduce(
    sweep: Sweep, integrator: str, shard: int, earlier: Completion | None = None
) -> dict[str, Contents]:
    """Integrate one shard with 500 samples, as :func:`integrate` does, and keep numbers over tau_per_stage alone."""
    return {"run": contents(sweep, integrator, shard, earlier, reduced_run)}


def reduced_run(run: Run) -> Variables:
    """Return the numbers of planned runs over tau_per_stage, a thousand runs at a time."""
    parts = []
    for begin in range(0, len(run.steps), AT_ONCE):
        among = slice(begin, begin + AT_ONCE)
        some = replace(run, tau_per_stage=run.tau_per_stage[among], steps=run.steps[among], samples=SAMPLES)
        notes = {"system": run.sweep.system, "integrator": run.integrator}
        trajectories = assembled(integrate_run(some), COORDINATES, notes)
        parts.append(numbers(trajectories.drop_vars(STATES if run.sweep.system in PAPER else (), errors="ignore")))
    return variables_of(joined(parts, "tau_per_stage"))
