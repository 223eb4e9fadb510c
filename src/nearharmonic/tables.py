"""Tables as CSV: what was left out of the computation, why, and how many force evaluations that saved."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING

from nearharmonic.integrators import integrators
from nearharmonic.plan import Omission, evaluations_of, plan
from nearharmonic.settings import Config

if TYPE_CHECKING:
    import xarray as xr


def skipped(config: Config, cubes: Mapping[str, xr.Dataset]) -> list[Omission]:
    """What the plan of ``config`` left out, and what its runs in ``cubes`` (by system) spared by ending early."""
    return [*plan(config).omissions, *(row for system, cube in cubes.items() for row in _ended_early(system, cube))]


def _ended_early(system: str, cube: xr.Dataset) -> Iterator[Omission]:
    """One row for each integrator and precision with runs that left their energy surface."""
    layered = cube if "precision" in cube.dims else cube.expand_dims(precision=["double"])
    for precision in layered.precision.values:
        for name in layered.integrator.values:
            runs = layered.sel(precision=precision, integrator=name)
            left = runs.where(runs.status == "diverged", drop=True)
            planned = sum(evaluations_of(integrators[str(name)], int(steps)) for steps in left.steps.values)
            if left.steps.size:
                yield Omission(
                    system=system,
                    integrator=str(name),
                    precision=str(precision),
                    what="the rest of a run",
                    reason="it left its energy surface",
                    runs=left.steps.size,
                    evaluations=planned - int(left.evaluations.sum()),
                )


def write_csv(path: str | os.PathLike[str], rows: Sequence[Omission]) -> None:
    """Write ``rows`` under a line of column names; the file appears whole or not at all."""
    place = Path(path)
    part = place.with_name(f".{place.name}.part")
    with part.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [field.name for field in fields(Omission)], lineterminator="\n")
        table.writeheader()
        table.writerows(map(asdict, rows))
    part.replace(place)
