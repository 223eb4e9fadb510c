"""Single runs of the cubes of systems as rows of a table, selected by a condition and sorted."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.errors import ResultFileError, unknown_name
from nearharmonic.output import store

#: Columns of every system, in the displayed order; columns of single systems follow.
COLUMNS = (
    "system", "integrator", "precision", "tau", "tau_per_stage", "steps", "evaluations", "max_energy_error",
    "mean_energy_error", "status", "diverged_at", "label",
)  # fmt: skip
#: Columns of text among them.
TEXTS = {"result", "system", "integrator", "precision", "status", "label"}
#: Dimensions of a cube of runs.
DIMENSIONS = ("integrator", "precision", "tau_per_stage")
#: Status of a cell without a run.
SKIPPED = "skipped"

Columns = dict[str, np.ndarray]


@dataclass(frozen=True)
class RunTable:
    """Table of runs, one per row.

    Attributes
    ----------
    columns : dict of str to ndarray
        Numbers or texts of each run, all of the same length; NaN or an empty text if a system has no such quantity.
    units : dict
        ``units[system][column]``: the unit of a column, if it has one.
    """

    columns: Columns
    units: dict[str, dict[str, str]]

    @property
    def rows(self) -> int:
        """Number of runs."""
        return len(self.columns["system"])

    def taken(self, rows: Any) -> RunTable:
        """Return the rows of a mask or of indices."""
        return RunTable({name: values[rows] for name, values in self.columns.items()}, self.units)


def run_table(folders: Mapping[str, Path]) -> RunTable:
    """Return every run of some results, sorted by result, system, integrator, precision and step size.

    Parameters
    ----------
    folders : mapping of str to Path
        Folders of results by name; if there are several, the first column is ``result`` with their names.

    Returns
    -------
    RunTable
        One row for each step size of each cube of a system. Step sizes that round to the same number of steps share one
        run. Cells without a run are omitted.

    Raises
    ------
    ResultFileError
        A cube that cannot be read.
    """
    parts: list[Columns] = []
    units: dict[str, dict[str, str]] = {}
    for result, folder in folders.items():
        for path in system_cubes(folder):
            part, its_units = runs_of_cube(path)
            rows = len(part["system"])
            parts.append({"result": np.full(rows, result), **part} if len(folders) > 1 else part)
            units |= dict.fromkeys(part["system"][:1].tolist(), its_units)
    leading = ("result", *COLUMNS) if len(folders) > 1 else COLUMNS
    extra = sorted({name for part in parts for name in part} - set(leading))
    return RunTable({name: _stacked(name, parts) for name in (*leading, *extra)}, units)


def system_cubes(folder: Path) -> Iterator[Path]:
    """Yield the sorted files in ``folder`` with the runs of a system: those named after it.

    Other cubes, such as that of the kinetic energies, also name a system, but have no single runs.
    """
    for path in sorted(folder.glob("cubes/*.h5")):
        if store.attributes_of(path).get("system") == path.stem:
            yield path


def settings_of(attributes: Any) -> dict[str, Any]:
    """Return the settings of a file from its attributes; empty if it has none."""
    try:
        found = json.loads(attributes.get("settings", "{}"))
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}


def runs_of_cube(path: Path) -> tuple[Columns, dict[str, str]]:
    """Return the columns of the runs in the cube of one system, and their units.

    Raises
    ------
    ResultFileError
        The cube cannot be read, or is incomplete.
    """
    cube = store.read(path)
    missing = [name for name in COLUMNS if name not in cube.variables and name != "system"]
    if missing:
        message = f"{path} has no {' and no '.join(missing)}. Make it again: {store.command_for(path)}"
        raise ResultFileError(message)
    cube = cube.sortby(["integrator", "precision", "tau_per_stage"])
    shape = tuple(cube.sizes[dimension] for dimension in DIMENSIONS)
    names = [name for name in cube.data_vars if set(cube[name].dims) == set(DIMENSIONS)]
    arrays = {str(name): cube[name].transpose(*DIMENSIONS).values for name in names}
    ran = (arrays["status"] != SKIPPED) & (arrays["steps"] > 0)
    columns: Columns = {}
    for axis, name in enumerate(DIMENSIONS):
        # xarray stores the texts of an index as objects, whose comparison is a hundred times slower.
        values = cube[name].values.astype(str) if name in TEXTS else cube[name].values
        columns[name] = _along(axis, values, shape)[ran]
    columns["label"] = _along(0, cube["label"].values, shape)[ran]
    columns["system"] = np.full(int(ran.sum()), cube.attrs["system"])
    columns |= {name: values[ran] for name, values in arrays.items()}
    columns |= {name: values.astype(str, copy=False) for name, values in columns.items() if name in TEXTS}
    units = {name: str(cube[name].attrs.get("units", "1")) for name in (*arrays, "tau_per_stage")}
    return columns, {name: unit for name, unit in units.items() if unit != "1"}


def _along(axis: int, values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return ``values`` of one dimension, repeated over the others."""
    return np.broadcast_to(values.reshape([-1 if i == axis else 1 for i in range(len(shape))]), shape)


def _stacked(name: str, parts: Sequence[Columns]) -> np.ndarray:
    """Concatenate the column ``name`` of all ``parts``."""
    held = [part[name] for part in parts if name in part]
    if not held:
        return np.array([], dtype=str if name in TEXTS else float)
    empty: Any = "" if held[0].dtype.kind == "U" else np.nan
    return np.concatenate([part[name] if name in part else np.full(len(part["system"]), empty) for part in parts])


def order_by(key: str, columns: Columns) -> np.ndarray:
    """Return the indices of the rows in a stable sort by a column.

    Parameters
    ----------
    key : str
        Name of a column; a minus sign before it means descending order. NaN is last in both directions.
    columns : dict of str to ndarray
        All columns.

    Raises
    ------
    UnknownNameError
        There is no such column.
    """
    name = key.removeprefix("-")
    values = column_of(name, columns)
    if name == key:
        return np.argsort(values, kind="stable")
    if values.dtype.kind == "U":
        _, values = np.unique(values, return_inverse=True)
    return np.argsort(-values, kind="stable")


def column_of(name: str, columns: Columns) -> np.ndarray:
    """Return the column ``name``.

    Raises
    ------
    UnknownNameError
        There is no such column; the message has the nearest match.
    """
    if name not in columns:
        raise unknown_name("column", name, columns)
    return columns[name]
