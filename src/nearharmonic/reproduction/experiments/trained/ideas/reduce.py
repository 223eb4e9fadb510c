"""From the errors on all potentials to one cube of ideas and its table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nearharmonic.output.store import read
from nearharmonic.reproduction.experiments.trained.ideas.reductions import reduction
from nearharmonic.reproduction.experiments.trained.ideas.tables import ideas_table
from nearharmonic.reproduction.experiments.trained.proof.settings import ProofSettings


def reduce(methods: Sequence[str], exact: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of ideas over step size and strength, and the ``table`` of which is ahead.

    Parameters
    ----------
    methods, exact : sequence of str
        Names of the methods, which go into the files beside the numbers.
    settings : ProofSettings
        The seed of the resamples.
    run : str
        Path of the run file.
    """
    best = reduction.of(read(run).assign_attrs(seed=settings.seed), over="problem")
    cube = best.drop_dims("resample").assign(reduction.of(best, over="resample"))
    return {"cube": cube, "table": ideas_table(cube)}
