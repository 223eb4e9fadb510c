"""Described variables: arrays with the names of their dimensions, their unit and their meaning, before they are a file.

They are plain tuples, so that code which computes needs neither xarray nor HDF5.
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

#: Attributes of a variable of words (CF conventions, section 3.5): the words, and in a file the integers for them.
FLAG_MEANINGS, FLAG_VALUES = "flag_meanings", "flag_values"
#: Meanings of coordinates that count, where "number of the ..." would not do.
COUNTED = {"component": "number of the coordinate"}
#: Attributes of a variable: ``units`` and ``long_name`` at least.
Attributes = dict[str, str]
#: One variable as xarray takes it: names of its dimensions, values, attributes.
Variable = tuple[tuple[str, ...], Any, Attributes]
Variables = dict[str, Variable]


def described(long_name: str, units: str = "1") -> Attributes:
    """Return the attributes of a variable.

    Parameters
    ----------
    long_name : str
        Meaning of the variable.
    units : str
        Unit of its values; "1" if they have none.
    """
    return {"units": units, "long_name": long_name}


def variable(dimensions: str | tuple[str, ...], values: Any, long_name: str, units: str = "1") -> Variable:
    """Return a described variable.

    Parameters
    ----------
    dimensions : str or tuple of str
        Names of the dimensions; a single name stands for one dimension.
    values : array_like
        As many axes as dimensions.
    long_name : str
        Meaning of the variable.
    units : str
        Unit of its values; "1" if they have none.
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
    sizes: dict[str, int] = {}
    for dims, values, _ in variables.values():
        sizes |= zip(dims, np.shape(values), strict=True)
    return {name: _count(name, size) for name, size in sizes.items() if name not in variables}


def _count(name: str, size: int) -> Variable:
    return variable(name, np.arange(size), COUNTED.get(name, f"number of the {name.replace('_', ' ')}"))


def flags(dimensions: str | tuple[str, ...], words: Any, meanings: Sequence[str], long_name: str) -> Variable:
    """Return a described variable of words, each one of ``meanings``; a file keeps it as integers with these meanings.

    Parameters
    ----------
    dimensions : str or tuple of str
        As for :func:`variable`.
    words : array_like of str
        Values.
    meanings : sequence of str
        All words that a value may be.
    long_name : str
        Meaning of the variable.
    """
    names, values, notes = variable(dimensions, words, long_name)
    return names, values, {**notes, FLAG_MEANINGS: " ".join(meanings)}


def double_runs(cube: xr.Dataset) -> xr.Dataset:
    """Return the runs of a cube in double precision, or in its first precision, without the dimension ``precision``."""
    if "precision" not in cube.dims:
        return cube
    names = cube["precision"].values.tolist()
    return cube.isel(precision=names.index("double") if "double" in names else 0)


def assembled(variables: Variables, coordinates: Collection[str], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return the dataset of described variables.

    Parameters
    ----------
    variables : mapping
        Described variables by name.
    coordinates : collection of str
        Names of auxiliary coordinates. A variable with the name of its dimension is a coordinate anyway, and a
        dimension that has none counts from 0.
    attributes : mapping
        Attributes of the dataset.

    Raises
    ------
    ValueError
        Two variables have different sizes along one dimension.
    """
    import xarray as xr

    known = {name for name, (dims, _, _) in variables.items() if dims == (name,)} | set(coordinates)
    held = {name: member for name, member in variables.items() if name not in known}
    counts = {name: _index(name, len(values)) for name, (_, values, _) in counted(variables).items()}
    return xr.Dataset(held, counts | {name: variables[name] for name in variables if name in known}, attributes)


@lru_cache(maxsize=64)
def _index(name: str, size: int) -> xr.IndexVariable:
    """The coordinate 0, 1, 2, ... of a dimension with its index, which takes longer to make than a short run takes."""
    import xarray as xr

    return xr.IndexVariable(*_count(name, size))  # type: ignore[no-untyped-call]


@dataclass(frozen=True, kw_only=True)
class Contents:
    """Contents of one HDF5 file: variables of its root, attributes of the file, and groups of variables.

    Each group has dimensions of its own. ``coordinates`` are the names of auxiliary coordinates. ``evaluations`` counts
    the force evaluations that it took to make; it goes to the record of the run and not into the file.
    """

    variables: Variables
    attributes: Mapping[str, Any] = field(default_factory=dict)
    coordinates: tuple[str, ...] = ()
    groups: Mapping[str, Variables] = field(default_factory=dict)
    evaluations: int = 0
