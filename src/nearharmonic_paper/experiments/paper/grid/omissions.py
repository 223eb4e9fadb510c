"""Omitted runs, with reasons and saved force evaluations: as CSV, and in one line."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from nearharmonic.engine.settings import PRECISIONS, Sweep, steps_over, tau_grid
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators as methods_by_name
from nearharmonic.output.store import read
from nearharmonic.output.table import Table, from_csv
from nearharmonic_paper.experiments.paper.grid.plan import Omission, omissions

if TYPE_CHECKING:
    import xarray as xr

#: Entry for system, integrator and precision in the rows of totals.
ALL = "all"
#: The rows of totals, by their ``what``.
DONE, FULL, SAVED = "done", "full grid", "saved"
FULL_GRID = "every step size in double and extended, each observable in a pass of its own, no early stop"
#: Smallest share of the full grid whose reason is named in the summary.
TOLD = 0.01
NOT_ASKED = "the config does not ask for this precision"


def skipped(sweeps: Sequence[Sweep], methods: Sequence[str], cubes: Mapping[str, xr.Dataset]) -> list[Omission]:
    """Return the omissions of the plan, and those of runs in ``cubes`` (by system) that ended early."""
    not_asked = (row for sweep in sweeps for name in methods for row in _not_asked(sweep, name))
    ended = (row for system, cube in cubes.items() for row in _ended_early(system, cube))
    planned = (row for sweep in sweeps for name in methods for row in omissions(sweep, name))
    return [*planned, *not_asked, *ended]


def totals(rows: Sequence[Omission], cubes: Mapping[str, xr.Dataset]) -> list[Omission]:
    """Return totals over all systems: work done, work of the full grid, and savings by reason, largest first.

    The full grid is every step size in both precisions to the end of its interval. It also counts work that the actual
    runs share: the second pass over Kepler orbits, and forces that a step takes over from the previous one.
    """
    done = [run for cube in cubes.values() for _, _, runs in _distinct(cube) for run in runs]
    saved: dict[str, tuple[int, int]] = {}
    for row in rows:
        because = f"{row.what}: {row.reason}"
        runs, evaluations = saved.get(because, (0, 0))
        saved[because] = runs + row.runs, evaluations + row.evaluations
    made = sum(evaluations for _, evaluations, _ in done)
    ordered = sorted(saved.items(), key=lambda entry: -entry[1][1])
    planned = len(done) + sum(row.runs for row in rows if row.what.startswith("runs "))
    return [
        _total(DONE, "", len(done), made),
        _total(FULL, FULL_GRID, planned, made + sum(row.evaluations for row in rows)),
        *(_total(SAVED, reason, *counts) for reason, counts in ordered),
    ]


class Totals(NamedTuple):
    """Totals of the table: ``runs`` and evaluations ``done``, those of the ``full`` grid, those ``saved`` by reason."""

    runs: int
    done: int
    full: int
    saved: dict[str, int]


def totals_in(text: str) -> Totals:
    """Return the totals of the table whose CSV is ``text``; a NearharmonicError says that it lacks one."""
    try:
        rows = {(row["what"], row["reason"]): row for row in from_csv(text).records() if row["system"] == ALL}
        done, full = rows[DONE, ""], rows[FULL, FULL_GRID]
        saved = {reason: int(row["evaluations"]) for (what, reason), row in rows.items() if what == SAVED}
        return Totals(int(done["runs"]), int(done["evaluations"]), int(full["evaluations"]), saved)
    except (NearharmonicError, KeyError, ValueError) as error:
        raise NearharmonicError("the table of what was skipped holds no totals") from error


def summary_line(path: str | os.PathLike[str]) -> str:
    """Return the totals of the table at ``path`` in one line; reasons for less than 1 % are counted."""
    _, done, full, saved = totals_in(Path(path).read_text(encoding="utf-8"))
    shares = [f"{number / full:.0%} {reason}" for reason, number in saved.items() if number / full >= TOLD]
    rest = len(saved) - len(shares)
    shares += [f"{rest} more below {TOLD:.0%} each"] * (rest > 0)
    return (
        f"{done / full:.0%} of the full grid of {full:.2g} force evaluations was needed; skipped, as it changes no "
        f"result: {'; '.join(shares)}. Details: {os.fspath(path)}"
    )


def table(sweeps: Sequence[Sweep], integrators: Sequence[str], **cubes: str) -> dict[str, Table]:
    """Return the ``table`` of omissions, then totals over all systems, from the file of the cube of each system."""
    found = {system: read(path) for system, path in cubes.items()}
    rows = skipped(sweeps, integrators, found)
    return {"table": table_of([*rows, *totals(rows, found)])}


def table_of(rows: Sequence[Omission]) -> Table:
    """Return ``rows`` under the names of their members."""
    caption = "Omitted runs, the reason, and the number of force evaluations saved."
    return Table(header=Omission._fields, rows=rows, caption=caption)


def _not_asked(sweep: Sweep, name: str) -> Iterator[Omission]:
    """Yield one row for each precision that ``sweep`` does not use."""
    tableau = methods_by_name[name]
    grid = np.array(tau_grid(sweep.lowest, sweep.highest, sweep.points_per_decade))
    evaluations = int(tableau.evaluations(steps_over(grid, sweep.t_end, tableau)).sum())
    for precision in PRECISIONS:
        if precision not in sweep.precision:
            what = f"runs in {precision} precision"
            yield Omission(sweep.system, name, precision, what, NOT_ASKED, grid.size, evaluations)


def _ended_early(system: str, cube: xr.Dataset) -> Iterator[Omission]:
    """Yield one row for each integrator and precision with diverged runs."""
    for precision, name, runs in _distinct(cube):
        left = [(steps, evaluations) for steps, evaluations, status in runs if status == "diverged"]
        if left:
            saved = sum(methods_by_name[name].evaluations(steps) - made for steps, made in left)
            yield Omission(system, name, precision, "the rest of a run", "it left its energy surface", len(left), saved)


def _distinct(cube: xr.Dataset) -> Iterator[tuple[str, str, list[tuple[int, int, str]]]]:
    """Yield (precision, integrator, [(steps, evaluations, status)]) of the runs: one for equal numbers of steps."""
    for precision in cube.precision.values:
        for name in cube.integrator.values:
            runs: Any = cube.sel(precision=precision, integrator=name)
            kept = np.flatnonzero(runs.status.values != "skipped")
            _, first = np.unique(runs.steps.values[kept], return_index=True)
            columns = (runs[key].values[kept][first].tolist() for key in ("steps", "evaluations", "status"))
            yield str(precision), str(name), list(zip(*columns, strict=True))


def _total(what: str, reason: str, runs: int, evaluations: int) -> Omission:
    return Omission(ALL, ALL, ALL, what, reason, runs, evaluations)
