"""From the trajectories of all methods to one cube and the table of crossings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from nearharmonic.output.store import read
from nearharmonic.reproduction.experiments.exact_oscillator.reductions import reduction
from nearharmonic.reproduction.experiments.exact_oscillator.settings import ExactOscillatorSettings
from nearharmonic.reproduction.experiments.exact_oscillator.tables import crossing_table


def reduce(split: Sequence[str], exact: Sequence[str], settings: ExactOscillatorSettings, run: str) -> dict[str, Any]:
    """Return the ``cube`` of quantiles and crossings, and its ``table``.

    Parameters
    ----------
    split, exact : sequence of str
        Names of the methods, which go into the files beside the numbers.
    settings : ExactOscillatorSettings
        The seed of the resamples.
    run : str
        Path of the run file.
    """
    runs = read(run)
    runs.attrs = {"seed": settings.seed}
    cube = reduction.of(runs, over="trajectory")
    return {"cube": cube, "table": crossing_table(cube)}
