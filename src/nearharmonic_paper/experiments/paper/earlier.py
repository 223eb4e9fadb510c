"""Runs that an earlier config has made, which are taken over in place of integrating them again.

A run is determined by its code, its coefficients, its settings and its number of steps. Other ends and another density
of the grid, other shards and other precisions leave each run as it is. Snakemake deletes the outputs of a job before it
starts, so the files are kept beside the logs until the workflow has ended without an error.

What integrates does not import this module: an edit of the reader of files leaves its results valid.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.engine.settings import Sweep, tau_range
from nearharmonic.errors import NearharmonicError
from nearharmonic.output.store import Variables, claimed_attributes, complaint, read_precisions, variables_of
from nearharmonic_paper.experiments.paper.run import Run, gathered, shard_range

#: Folder of the files that are kept, in the folder of results.
PLACE = "logs/earlier"
#: Settings of a sweep that choose among runs and leave each as it is.
CHOOSING = ("lowest", "highest", "points_per_decade", "shards", "precision")

#: Runs of one file, in one precision: its variables, and the row of each number of steps.
Kept = tuple[Variables, dict[int, int]]


def keep(folder: Path, outputs: Iterable[str | os.PathLike[str]]) -> None:
    """Keep all result files in the folders of ``outputs``, which jobs may write, in a folder of results."""
    for place in sorted({Path(output).parent for output in outputs}):
        for path in place.glob("*.h5"):
            kept = folder / PLACE / place.relative_to(folder) / f"{path.stem}-{path.stat().st_mtime_ns}.h5"
            if not kept.exists():
                kept.parent.mkdir(parents=True, exist_ok=True)
                try:
                    kept.hardlink_to(path)
                except OSError:  # a file system without links
                    shutil.copyfile(path, kept)


def forget(folder: Path) -> None:
    """Delete what was kept."""
    shutil.rmtree(folder / PLACE, ignore_errors=True)


class Earlier:
    """Runs of kept files with the code, the coefficients, the users' definitions and the settings of a job.

    The job is about to write the run file ``output`` in a folder of results, with the provenance attributes ``origin``.
    """

    def __init__(self, folder: Path, output: str | os.PathLike[str], origin: Mapping[str, str]) -> None:
        self._place = folder / PLACE / Path(output).parent.relative_to(folder)
        self._origin, self._settings = origin, json.loads(origin["settings"])

    def __call__(self, run: Run, function: Callable[[Run], Variables]) -> Variables:
        """Return what ``function`` returns for ``run``, bit for bit; it is called for the runs that no file holds."""
        parts = self._kept.get(run.precision, [])
        known = {steps for _, rows in parts for steps in rows}
        missing = [i for i, steps in enumerate(run.steps) if steps not in known]
        if len(missing) == len(run.steps):
            return function(run)
        print(f"{run.precision}: {len(run.steps) - len(missing)} of {len(run.steps)} runs are of an earlier plan")
        if missing:
            steps = tuple(run.steps[i] for i in missing)
            made = function(replace(run, tau_per_stage=tuple(run.tau_per_stage[i] for i in missing), steps=steps))
            parts = [(made, {n: row for row, n in reversed(list(enumerate(steps)))}), *parts]
        pieces, left = [], list(enumerate(run.steps))
        for variables, rows in parts:
            mine = [(i, steps) for i, steps in left if steps in rows]
            left = [(i, steps) for i, steps in left if steps not in rows]
            pieces.append((variables, [i for i, _ in mine], [rows[steps] for _, steps in mine]))
        return gathered(pieces, run.tau_per_stage, max(2, min(run.samples, max(run.steps) + 1)))

    @cached_property
    def _kept(self) -> dict[str, list[Kept]]:
        """The runs of the kept files by precision."""
        found: dict[str, list[Kept]] = {}
        for path in sorted(self._place.glob("*.h5")):
            if complaint(path):
                continue  # the HDF5 library may crash on a damaged file
            try:
                contents = read_precisions(path) if self._is_of_use(claimed_attributes(path)) else {}
            except (NearharmonicError, AttributeError, KeyError, TypeError, ValueError, RecursionError):
                continue  # a file that does not say what it is
            for precision, runs in contents.items():
                whole, steps = np.flatnonzero(runs.status.values != "skipped").tolist(), runs.steps.values.tolist()
                if whole:
                    rows = {steps[row]: row for row in reversed(whole)}
                    found.setdefault(precision, []).append((variables_of(runs), rows))
        return found

    def _is_of_use(self, attributes: Mapping[str, Any]) -> bool:
        """Return True if a file of these attributes may hold runs of the job."""
        theirs, ours = json.loads(attributes["settings"]), self._settings
        same = all(attributes[key] == self._origin[key] for key in ("code_digest", "coefficients_digest"))
        if not same or any(theirs.get(key) != ours.get(key) for key in ("integrator", "definitions")):
            return False
        if any(theirs["sweep"][key] != value for key, value in ours["sweep"].items() if key not in CHOOSING):
            return False
        (begin, end), (first, last) = map(_ends_of, (theirs, ours))
        return begin <= last and first <= end


def _ends_of(settings: Mapping[str, Any]) -> tuple[float, float]:
    """Return the smallest and the largest step size per stage of a shard; the second is the smaller if it is empty."""
    sweep = Sweep(**settings["sweep"] | {"precision": tuple(settings["sweep"]["precision"])})
    mine = shard_range(sweep, settings["integrator"], settings["shard"])
    first, last = (tau_range(sweep.lowest, sweep.points_per_decade, i, i + 1)[0] for i in (mine.start, mine.stop - 1))
    return first, last
