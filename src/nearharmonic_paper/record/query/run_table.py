"""Single runs of the cubes of systems as rows of a table, selected by a condition and sorted."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from pandas.api.types import is_numeric_dtype

from nearharmonic.errors import ResultFileError, unknown_name
from nearharmonic.output import store
from nearharmonic_paper.record.files import manifest
from nearharmonic_paper.tasks.receipts.schema import complaint

if TYPE_CHECKING:
    import xarray as xr

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

Units = dict[str, dict[str, str]]


def run_table(folders: Mapping[str, Path]) -> tuple[pd.DataFrame, Units]:
    """Return every run of some results, sorted by result, system, integrator, precision and step size.

    ``folders`` are those of the results by name; if there are several, the first column is ``result`` with their names.

    Returns
    -------
    DataFrame
        One row for each step size of each cube of a system that the config has; NaN or an empty text if a system has
        no such quantity. Step sizes that round to the same number of steps share one run. Cells without a run are
        omitted. A cube that cannot be read is a ResultFileError.
    dict
        ``units[system][column]``: the unit of a column, if it has one.
    """
    leading = ["result", *COLUMNS] if len(folders) > 1 else list(COLUMNS)
    parts: list[pd.DataFrame] = []
    units: Units = {}
    for result, folder in folders.items():
        left_out = former_systems(folder)
        for path in (path for path in system_cubes(folder) if path.stem not in left_out):
            part, units[path.stem] = runs_of_cube(path)
            parts.append(part.assign(result=result) if len(folders) > 1 else part)
    if not parts:
        return pd.DataFrame({name: pd.Series(dtype=str if name in TEXTS else float) for name in leading}), units
    stacked = pd.concat(parts, ignore_index=True)
    texts = [name for name in stacked if not is_numeric_dtype(stacked[name])]
    return stacked.fillna(dict.fromkeys(texts, ""))[[*leading, *sorted({*stacked} - {*leading})]], units


def system_cubes(folder: Path) -> Iterator[Path]:
    """Yield the sorted files in ``folder`` with the runs of a system: those named after it.

    Other cubes, such as that of the kinetic energies, also name a system, but have no single runs.
    """
    for path in sorted(folder.glob("cubes/*.h5")):
        if str(store.attributes_of(path).get("system")) == path.stem:
            yield path


def former_systems(folder: Path) -> list[str]:
    """Return the systems in ``folder`` that the config of its last run does not have; none without a manifest."""
    try:
        former = manifest.read(folder)["former"]
    except ResultFileError:
        return []
    return [path.stem for path in system_cubes(folder) if path.relative_to(folder).as_posix() in former]


def settings_of(path: Path, attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a file from its attributes; {} if it has none, ResultFileError if they are no JSON."""
    try:
        found = json.loads(attributes.get("settings", "{}"))
    except (TypeError, ValueError, RecursionError):
        fault = "are no JSON"
    else:
        fault = complaint("settings", found)
    if fault:
        raise store.unusable(path, f"has settings that cannot be read: the text {fault}")
    return dict(found)


def system_cube(path: Path) -> xr.Dataset:
    """Return the cube of one system.

    A cube that cannot be read, is incomplete, or has a variable of another type or shape than this package writes, is
    a ResultFileError.
    """
    cube = store.read(path)
    missing = [name for name in COLUMNS if name not in cube.variables and name != "system"]
    if missing:
        raise store.unusable(path, f"has no {' and no '.join(missing)}")
    for name in COLUMNS[1:]:
        dims = {name} if name in DIMENSIONS else {"integrator"} if name == "label" else {*DIMENSIONS}
        if {*cube[name].dims} != dims or (cube[name].dtype.kind in "OU") != (name in TEXTS):
            raise store.unusable(path, f"has {name} of another type or shape")
    return cube


def runs_of_cube(path: Path) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return the runs in the cube of one system, one per row, and the units of the columns; errors are those above."""
    cube = system_cube(path)
    names = [name for name in cube.data_vars if set(cube[name].dims) == set(DIMENSIONS)]
    frame = cube.set_coords("label")[names].sortby(list(DIMENSIONS)).to_dataframe(DIMENSIONS).reset_index()
    frame = frame[(frame["status"] != SKIPPED) & (frame["steps"] > 0)].assign(system=cube.attrs["system"])
    units = {str(name): str(cube[name].attrs.get("units", "1")) for name in (*names, "tau_per_stage")}
    described = {name: unit for name, unit in units.items() if unit != "1"}
    return frame[[*COLUMNS, *sorted({*frame} - {*COLUMNS})]], described


def column_of(name: str, runs: pd.DataFrame) -> pd.Series:
    """Return the column ``name``; an unknown name is an error with the nearest match."""
    if name not in runs:
        raise unknown_name("column", name, runs)
    return runs[name]
