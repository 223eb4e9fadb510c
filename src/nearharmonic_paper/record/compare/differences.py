"""Differences between two arrays of numbers or texts, and between two datasets on their common coordinates."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Maximum number of values of a coordinate that are listed one by one.
NAMED = 6


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One difference of two results.

    Attributes
    ----------
    kind : str
        "claim", "setting", "code", "coefficients", "version", "status", "number", "text" or "missing".
    where : str
        Name of the object that differs; a file name is relative to the result, followed by the variable or column.
    a, b : object
        Values in the two results; for arrays the values at ``at``.
    relative : float or None
        Largest |a - b| / max(|a|, |b|), infinite if one is no finite number; None unless the values are numbers.
    at, at_units : dict
        Coordinates of the largest difference, or of the first difference of texts, and their units.
    differ, compared : int or None
        Numbers of differing and of compared values; None for single values.
    unit : str
        Unit of ``a`` and ``b``; empty if they have none.
    """

    kind: str
    where: str
    a: Any
    b: Any
    relative: float | None = None
    at: Mapping[str, Any] = field(default_factory=dict)
    at_units: Mapping[str, str] = field(default_factory=dict)
    differ: int | None = None
    compared: int | None = None
    unit: str = ""


def relative_differences(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return |a - b| / max(|a|, |b|) of numbers of the same shape.

    NaN is equal to NaN and an infinity to itself; the difference of a finite and a non-finite number is infinite.
    """
    one, other = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(all="ignore"):
        # Halves make the difference of the two largest doubles finite.
        found = abs(one / 2 - other / 2) / np.maximum(abs(one), abs(other)) * 2
    # Two integers may round to one double, and half of the smallest double is 0.
    found = np.where(found > 0, found, np.finfo(np.float64).tiny)
    found = np.where(np.isfinite(one) & np.isfinite(other), found, inf)
    return np.where((a == b) | (np.isnan(one) & np.isnan(other)), 0.0, found)


def array_difference(
    where: str, a: np.ndarray, b: np.ndarray, coordinates: Sequence[tuple[str, Sequence[Any]]], *, unit: str = ""
) -> Difference | None:
    """Return the difference of two arrays of the same shape, None if they are equal.

    Parameters
    ----------
    where : str
        Name of the arrays; names that end in ``status`` give differences of the kind "status".
    a, b : ndarray
        Numbers, or texts.
    coordinates : sequence of (str, sequence)
        Name and values of each dimension.
    unit : str
        Unit of the numbers.
    """
    numbers = a.dtype.kind in "biuf" and b.dtype.kind in "biuf"
    if numbers:
        distances = relative_differences(a, b)
        unequal = distances > 0
    else:
        unequal = np.asarray(a.astype(str) != b.astype(str))
        distances = unequal
    if not unequal.any():
        return None
    index = tuple(int(i) for i in np.unravel_index(int(np.argmax(distances)), a.shape))
    kind = "number" if numbers else "status" if where.endswith("status") else "text"
    return Difference(
        kind=kind,
        where=where,
        a=a[index].item(),
        b=b[index].item(),
        relative=float(distances[index]) if numbers else None,
        at={name: values[i] for (name, values), i in zip(coordinates, index, strict=True)},
        differ=int(unequal.sum()),
        compared=int(a.size),
        unit=unit if numbers and unit != "1" else "",
    )


def dataset_differences(file: str, a: xr.Dataset, b: xr.Dataset, leave_out: Collection[str]) -> Iterator[Difference]:
    """Yield the differences between two datasets: missing coordinates and variables, then values.

    Parameters
    ----------
    file : str
        Name of the file, and of the group in it.
    a, b : xarray.Dataset
        The two datasets. Values are compared on common coordinates; along a dimension without coordinates, up to the
        shorter length.
    leave_out : collection of str
        Variables that are not compared.
    """
    rows: tuple[dict[Any, Any], dict[Any, Any]] = {}, {}
    for dimension in [name for name in a.sizes if name in b.sizes]:
        one, other = (dataset.get_index(dimension) for dataset in (a, b))
        common = one[one.isin(other)]
        firsts = ~other.duplicated()
        rows[0][dimension] = np.flatnonzero(one.isin(other))
        rows[1][dimension] = np.flatnonzero(firsts)[other[firsts].get_indexer(common)]
        if len(one) != len(other) or len(one) != len(common):
            yield _only(f"{file}: {dimension}", one, other, _unit(a, str(dimension)))
    names = [name for name in dict.fromkeys([*a.variables, *b.variables]) if name not in (*leave_out, *rows[0])]
    a, b = a.isel(rows[0]), b.isel(rows[1])
    for name in names:
        where = f"{file}: {name}"
        if name not in a.variables or name not in b.variables:
            yield missing(where, in_a=name in a.variables)
        elif a[name].dims != b[name].dims:
            yield Difference(kind="missing", where=where, a=_over(a[name].dims), b=_over(b[name].dims))
        else:
            yield from _values(where, a[name], b[name])


def _values(where: str, a: xr.DataArray, b: xr.DataArray) -> Iterator[Difference]:
    """Yield the differences of the units and of the values of two arrays on the same coordinates."""
    units = [str(values.attrs.get("units", "1")) for values in (a, b)]
    if units[0] != units[1]:
        yield Difference(kind="text", where=f"{where}, unit", a=units[0], b=units[1])
    coordinates = [(str(name), a.get_index(name).tolist()) for name in a.dims]
    found = array_difference(where, a.values, b.values, coordinates, unit=units[0])
    if found:
        at_units = {name: _unit(a, name) for name in found.at}
        yield replace(found, at_units={name: unit for name, unit in at_units.items() if unit})


def missing(where: str, *, in_a: bool) -> Difference:
    """Return the difference for an object that one of two results lacks."""
    return Difference(kind="missing", where=where, a="there" if in_a else "missing", b="missing" if in_a else "there")


def _only(where: str, a: pd.Index, b: pd.Index, unit: str) -> Difference:
    """Return the values of a coordinate that only one result has."""
    one, other = a[~a.isin(b)].tolist(), b[~b.isin(a)].tolist()
    return Difference(kind="missing", where=where, a=_listed(one), b=_listed(other), unit=unit)


def _listed(values: Sequence[Any]) -> str:
    """Describe the values that only one result has."""
    if not values:
        return "no more"
    if len(values) <= NAMED or isinstance(values[0], str):
        return f"also {', '.join(map(short, values))}"
    return f"also {len(values)} from {short(min(values))} to {short(max(values))}"


def short(value: Any) -> str:
    """Return a coordinate or a value as text, a float to six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _over(dimensions: Sequence[Any]) -> str:
    return f"over {', '.join(map(str, dimensions))}" if dimensions else "a single value"


def _unit(dataset: xr.Dataset | xr.DataArray, name: str) -> str:
    unit = str(dataset[name].attrs.get("units", "1")) if name in dataset.coords else "1"
    return "" if unit == "1" else unit
