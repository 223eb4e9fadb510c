"""Repetition of recorded runs: equal settings give bitwise identical results."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.engine.settings import Sweep
from nearharmonic.output import store
from nearharmonic.output.store import Variables
from nearharmonic_paper.experiments.paper.reductions import reduced_run
from nearharmonic_paper.experiments.paper.run import integrate_run, runs_of
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.manifest import check_files_of
from nearharmonic_paper.record.query import SKIPPED, settings_of
from nearharmonic_paper.tasks.provenance import defined, read_definitions

#: Tasks that write run files.
REPEATED = (
    "nearharmonic_paper.experiments.paper.run:integrate",
    "nearharmonic_paper.experiments.paper.reductions:integrate_and_reduce",
)


@dataclass(frozen=True, kw_only=True)
class Rerun:
    """One repeated run.

    Attributes
    ----------
    file : str
        Name of its run file in the folder of results.
    precision : str
        Arithmetic of the run.
    tau_per_stage : float
        Step size per stage, in the unit of time of the system.
    differs : tuple of str
        Sorted names of the variables that are not bitwise identical.
    """

    file: str
    precision: str
    tau_per_stage: float
    differs: tuple[str, ...]


def rerun(folder: Path, number: int, seed: int = 1) -> list[Rerun]:
    """Repeat random runs from all run files of ``folder``, and compare them bitwise."""
    entries = {n: entry for n, entry in manifest.read(folder)["files"].items() if entry["function"] in REPEATED}
    cells = [cell for name in entries for cell in _cells(folder, name)]
    drawn = [cells[i] for i in sorted(random.Random(seed).sample(range(len(cells)), min(number, len(cells))))]
    check_files_of(entries[name] for name, _, _ in drawn)
    return [_again(folder, *cell) for cell in drawn]


def _cells(folder: Path, name: str) -> Iterator[tuple[str, str, int]]:
    """Yield file, precision and index of every run of a file."""
    for precision, runs in store.read_precisions(folder / name).items():
        with store.as_written(folder / name):
            yield from ((name, precision, i) for i in np.flatnonzero(runs.status.values != SKIPPED).tolist())


def _again(folder: Path, name: str, precision: str, index: int) -> Rerun:
    kept = store.read(folder / name, None if precision == "double" else precision)
    settings = settings_of(folder / name, kept.attrs)
    with store.as_written(folder / name), defined(read_definitions(settings.get("definitions", {}))):
        return _compared(name, precision, index, kept, settings)


def _compared(name: str, precision: str, index: int, kept: Any, settings: Mapping[str, Any]) -> Rerun:
    """Repeat run ``index`` of the ``kept`` runs of a file."""
    sweep = Sweep(**settings["sweep"] | {"precision": tuple(settings["sweep"]["precision"])})
    planned = runs_of(sweep, settings["integrator"], settings["shard"])
    (run,) = (run for run in planned if run.precision == precision)
    repeated = integrate_run if sweep.samples else reduced_run
    place = run.tau_per_stage.index(float(kept.tau_per_stage[index]))
    one = replace(run, tau_per_stage=run.tau_per_stage[place : place + 1], steps=run.steps[place : place + 1])
    return Rerun(
        file=name,
        precision=precision,
        tau_per_stage=one.tau_per_stage[0],
        differs=tuple(sorted(_differing(repeated(one), kept, index))),
    )


def _differing(made: Variables, kept: Any, index: int) -> Iterator[str]:
    """Return the names of variables that are not bitwise identical to run ``index`` of ``kept``."""
    for name in made.keys() | set(kept.variables):
        if name not in made or name not in kept.variables:
            yield name
            continue
        dimensions, values, _ = made[name]
        before = kept[name].values[index : index + 1] if dimensions[:1] == ("tau_per_stage",) else kept[name].values
        after = np.asarray(values)
        if name == "sample":
            before = before[: after.size]
        elif "sample" in dimensions:
            # The samples of a short run are padded if the file has longer runs.
            before, filling = np.split(before, [after.shape[1]], axis=1)
            if not (np.isnan(filling) | (filling == 0)).all():
                yield name
                continue
        if after.shape != before.shape or not _same_bits(after, before):
            yield name


def _same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    if a.dtype.kind in "UO":
        return bool(np.array_equal(a.astype(str), b.astype(str)))
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()
