"""From the errors on all problems to one cube and the tables of gains and of trained methods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nearharmonic.output.store import read
from nearharmonic.reproduction.experiments.trained.proof.reductions import reduction
from nearharmonic.reproduction.experiments.trained.proof.settings import ProofSettings
from nearharmonic.reproduction.experiments.trained.proof.tables import gain_table, method_table


def reduce(methods: Sequence[str], settings: ProofSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of mean errors and gains, the table of ``gains``, and that of trained ``methods``.

    Parameters
    ----------
    methods : sequence of str
        Names of all methods that are compared, which go into the files beside the numbers.
    settings : ProofSettings
        The seed of the resamples.
    run : str
        Path of the run file.
    """
    runs = read(run).assign_attrs(seed=settings.seed)
    cube = runs.drop_dims("problem").assign(reduction.of(runs, over="problem"))
    cube.attrs = {}
    return {"cube": cube, "gains": gain_table(cube), "methods": method_table(cube)}
