"""Runs that an earlier config has made, which are taken over in place of integrating them again.

A run is determined by its code, its coefficients, its settings and its number of steps. Other ends and another density
of the grid, other shards and other precisions leave each run as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from nearharmonic.engine.settings import Sweep
from nearharmonic.output.dataset import Variable, Variables
from nearharmonic_paper.experiments.paper.grid.plan import Run
from nearharmonic_paper.experiments.paper.grid.shards import ends_of

#: Settings of a sweep that choose among runs and leave each as it is.
CHOOSING = ("lowest", "highest", "points_per_decade", "shards", "precision")

#: Runs of one file, in one precision: its variables, and the row of each number of steps.
Kept = tuple[Variables, dict[int, int]]


class EarlierFile(Protocol):
    """A run file that jobs made in place of this one before."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """The settings that it states."""

    def contents(self) -> dict[str, Variables]:
        """Its variables by precision; none if it is damaged."""


class Earlier:
    """Runs of earlier files with the settings of a shard.

    Parameters
    ----------
    sweep, integrator, shard
        The plan of the runs that are wanted.
    files : sequence of EarlierFile
        Run files of the same code and coefficients, of any plan.
    """

    def __init__(self, sweep: Sweep, integrator: str, shard: int, files: Sequence[EarlierFile] = ()) -> None:
        self._plan = (sweep, integrator, shard)
        self._files = files

    def completed(self, run: Run, function: Callable[[Run], Variables]) -> Variables:
        """Return what ``function`` returns for ``run``, bit for bit; it is called for the runs that no file holds."""
        parts = [(variables, rows) for variables, rows in self._kept.get(run.precision, ()) if rows]
        known = {steps for _, rows in parts for steps in rows}
        missing = [i for i, steps in enumerate(run.steps) if steps not in known]
        if len(missing) == len(run.steps):
            return function(run)
        print(f"{run.precision}: {len(run.steps) - len(missing)} of {len(run.steps)} runs are of an earlier plan")
        if missing:
            steps = tuple(run.steps[i] for i in missing)
            made = function(replace(run, tau_per_stage=tuple(run.tau_per_stage[i] for i in missing), steps=steps))
            parts.insert(0, (made, {n: row for row, n in reversed(list(enumerate(steps)))}))
        return _assembled(run, parts)

    @cached_property
    def _kept(self) -> dict[str, list[Kept]]:
        """The runs of the earlier files by precision."""
        found: dict[str, list[Kept]] = {}
        for file in self._files:
            for precision, variables in file.contents().items() if self._is_of_use(file.settings) else ():
                whole = np.flatnonzero(variables["status"][1] != "skipped").tolist()
                steps = variables["steps"][1].tolist()
                found.setdefault(precision, []).append((variables, {steps[row]: row for row in reversed(whole)}))
        return found

    def _is_of_use(self, settings: Mapping[str, Any]) -> bool:
        """Return True if a file of these settings may hold wanted runs."""
        sweep, integrator, shard = self._plan
        try:
            theirs = Sweep(**settings["sweep"] | {"precision": tuple(settings["sweep"]["precision"])})
            begin, end = ends_of(theirs, settings["integrator"], settings["shard"])
        except (KeyError, TypeError, ValueError):
            return False
        first, last = ends_of(sweep, integrator, shard)
        same = {key: value for key, value in asdict(theirs).items() if key not in CHOOSING} == {
            key: value for key, value in asdict(sweep).items() if key not in CHOOSING
        }
        return same and settings["integrator"] == integrator and begin <= last and first <= end


def _assembled(run: Run, parts: Sequence[Kept]) -> Variables:
    """Return the variables of ``run``, each row from the part that has it."""
    template = parts[0][0]
    places = [next((part, rows[n]) for part, rows in parts if n in rows) for n in run.steps]
    sizes = {"tau_per_stage": len(run.steps)}
    if "sample" in template:
        sizes["sample"] = max(2, min(run.samples, max(run.steps) + 1))
    return {name: _column(name, one, places, sizes, run) for name, one in template.items()}


def _column(
    name: str, one: Variable, places: Sequence[tuple[Variables, int]], sizes: dict[str, int], run: Run
) -> Variable:
    """Return one variable of the rows at ``places``; rows of fewer samples are padded."""
    dims, values, notes = one
    if name == "tau_per_stage":
        return dims, np.array(run.tau_per_stage), notes
    if name == "sample":
        return dims, np.arange(sizes["sample"], dtype=values.dtype), notes
    if "tau_per_stage" not in dims:
        return one
    filled = vacant(name, values, [sizes.get(d, n) for d, n in zip(dims, values.shape, strict=True)])
    for row, (part, place) in enumerate(places):
        theirs = part[name][1][place]
        if "sample" in dims:
            common = min(sizes["sample"], theirs.shape[0])
            filled[row, :common] = theirs[:common]
        else:
            filled[row] = theirs
    return dims, filled, notes


def vacant(name: str, values: Any, shape: Sequence[int]) -> Any:
    """Return an array for a variable without runs: NaN, 0 or the word "skipped"."""
    filler = "skipped" if name == "status" else np.nan if values.dtype.kind == "f" else 0
    return np.full(shape, filler, values.dtype)
