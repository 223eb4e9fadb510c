"""Described variables: arrays with names of dimensions, unit and meaning, from which datasets and files are made.

They are plain tuples, so that computing code needs neither xarray nor HDF5.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.integrators.tableau import Tableau

if TYPE_CHECKING:
    import xarray as xr

#: Attributes of a variable of words (CF conventions, section 3.5): the words, and the integers for them in a file.
FLAG_MEANINGS, FLAG_VALUES = "flag_meanings", "flag_values"
#: Meanings of integer coordinates, if "number of the ..." does not fit.
COUNTED = {"component": "number of the coordinate"}
#: Units by which xarray makes time differences of the numbers of a file, in some versions.
DECODED = {f"{size}seconds" for size in ("", "milli", "micro", "nano")} | {"days", "hours", "minutes"}
#: Attributes of a variable: ``units`` and ``long_name`` at least.
Attributes = dict[str, str]
#: A variable as xarray accepts it: names of dimensions, values, attributes.
Variable = tuple[tuple[str, ...], Any, Attributes]
Variables = dict[str, Variable]


def described(long_name: str, units: str = "1") -> Attributes:
    """Return the attributes of a variable: its meaning, and the unit of its values, "1" if they have none.

    A plural of time stands in the singular, which is the same unit.
    """
    return {"units": units.removesuffix("s") if units in DECODED else units, "long_name": long_name}


def variable(dimensions: str | tuple[str, ...], values: Any, long_name: str, units: str = "1") -> Variable:
    """Return a variable of ``values`` with one axis per dimension; a single name stands for one dimension.

    ``long_name`` and ``units`` are as for :func:`described`.
    """
    names = (dimensions,) if isinstance(dimensions, str) else tuple(dimensions)
    return names, np.asarray(values), described(long_name, units)


def coordinate(name: str, values: Any, long_name: str, units: str = "1") -> Variables:
    """Return the coordinate ``name`` along the dimension of the same name, as a mapping of one entry."""
    return {name: variable(name, values, long_name, units)}


def bounds_coordinate() -> Variables:
    """Return the coordinate ``bound`` of the two ends of an interval."""
    return coordinate("bound", ["lower", "upper"], "end of the interval")


def method_coordinates(tableaus: Iterable[Tableau]) -> Variables:
    """Return the coordinates ``integrator`` (names) and ``label`` of methods along the dimension ``integrator``."""
    methods = list(tableaus)
    return {
        "integrator": variable("integrator", [method.name for method in methods], "integrator"),
        "label": variable("integrator", [method.label for method in methods], "name in the paper"),
    }


def counted(variables: Variables) -> Variables:
    """Return a coordinate 0, 1, 2, ... for each dimension of ``variables`` that has none."""
    return {name: _count(name, size) for name, size in _uncounted(variables).items()}


def _uncounted(variables: Variables) -> dict[str, int]:
    """Return the sizes of the dimensions that have no coordinate."""
    sizes: dict[str, int] = {}
    for dims, values, _ in variables.values():
        sizes |= zip(dims, np.shape(values), strict=True)
    return {name: size for name, size in sizes.items() if name not in variables}


def _count(name: str, size: int) -> Variable:
    return variable(name, np.arange(size), COUNTED.get(name, f"number of the {name.replace('_', ' ')}"))


def flags(dimensions: str | tuple[str, ...], words: Any, meanings: Sequence[str], long_name: str) -> Variable:
    """Return a described variable of words, each one of ``meanings``; a file stores integers with these meanings."""
    names, values, notes = variable(dimensions, words, long_name)
    return names, values, {**notes, FLAG_MEANINGS: " ".join(meanings)}


def variables_of(dataset: xr.Dataset) -> Variables:
    """Return the coordinates and the variables of a dataset as described variables."""
    return {str(name): (tuple(map(str, v.dims)), v.values, v.attrs) for name, v in dataset.variables.items()}


def double_runs(cube: xr.Dataset) -> xr.Dataset:
    """Return the runs of a cube in double, otherwise in its first precision, without the dimension ``precision``."""
    if "precision" not in cube.dims:
        return cube
    names = cube["precision"].values.tolist()
    return cube.isel(precision=names.index("double") if "double" in names else 0)


def assembled(variables: Variables, coordinates: Collection[str], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return the dataset of described variables; a ValueError says that their sizes along a dimension differ.

    ``coordinates`` are the names of auxiliary coordinates. A variable with the name of its dimension is always a
    coordinate, and a dimension without one gets the coordinate 0, 1, 2, ....
    """
    import xarray as xr

    counts = _uncounted(variables)
    if not any(dims == (name,) for name, (dims, _, _) in variables.items()):
        auxiliary = tuple(name for name in variables if name in coordinates)
        layout = tuple(
            (name, dims, np.shape(values), *notes.items()) for name, (dims, values, notes) in variables.items()
        )
        template = _template(layout, auxiliary, tuple(counts.items()))
        dataset = template.copy(data={name: one[1] for name, one in variables.items() if name not in auxiliary})
        for name in auxiliary:
            dataset[name].data = np.asarray(variables[name][1])
        dataset.attrs = dict(attributes)
        return dataset
    axes = {name: _count(name, size) for name, size in counts.items()}
    axes |= {name: one for name, one in variables.items() if name in coordinates or one[0] == (name,)}
    return xr.Dataset({name: one for name, one in variables.items() if name not in axes}, axes, attributes)


@lru_cache(maxsize=64)
def _template(layout: tuple[Any, ...], auxiliary: tuple[str, ...], counts: tuple[tuple[str, int], ...]) -> xr.Dataset:
    """Return a dataset of zeros with the coordinates 0, 1, 2, ...; xarray takes longer to make it than a short run."""
    import xarray as xr

    zeros = {name: (dims, np.broadcast_to(0.0, shape), dict(notes)) for name, dims, shape, *notes in layout}
    axes = {name: _count(name, size) for name, size in counts} | {name: zeros.pop(name) for name in auxiliary}
    return xr.Dataset(zeros, axes)


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Contents of one HDF5 file: variables of its root, attributes of the file, and groups of variables.

    Each group has its own dimensions. ``coordinates`` are the names of auxiliary coordinates. ``evaluations`` is the
    number of force evaluations for the file; it is written to the record of the run, not to the file.
    """

    variables: Variables
    attributes: Mapping[str, Any] = field(default_factory=dict)
    coordinates: tuple[str, ...] = ()
    groups: Mapping[str, Variables] = field(default_factory=dict)
    evaluations: int = 0
