"""Differences between two arrays of numbers or texts, and between two datasets on their common coordinates."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
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
        at={name: _plain(values[i]) for (name, values), i in zip(coordinates, index, strict=True)},
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
    rows: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    labels: dict[str, Sequence[Any]] = {}
    for dimension in map(str, [*a.sizes, *(d for d in b.sizes if d not in a.sizes)]):
        if dimension not in a.sizes or dimension not in b.sizes:
            continue
        one, other = (_labels(dataset, dimension) for dataset in (a, b))
        labels[dimension], *indices = _common(one, other)
        rows[dimension] = (indices[0], indices[1])
        if len(one) != len(other) or len(one) != len(labels[dimension]):
            yield _only(f"{file}: {dimension}", one, other, _unit(a, dimension))
    names = [str(name) for name in a.variables]
    for name in [*names, *(str(name) for name in b.variables if name not in a.variables)]:
        if name in leave_out or name in rows:
            continue
        if name not in a.variables or name not in b.variables:
            yield missing(f"{file}: {name}", in_a=name in a.variables)
            continue
        if a[name].dims != b[name].dims:
            yield Difference(kind="missing", where=f"{file}: {name}", a=_over(a[name].dims), b=_over(b[name].dims))
            continue
        along = [(d, labels[d], *rows[d]) for d in map(str, a[name].dims)]
        yield from _values(f"{file}: {name}", a[name], b[name], along)


def _values(
    where: str, a: xr.DataArray, b: xr.DataArray, along: Sequence[tuple[str, Sequence[Any], np.ndarray, np.ndarray]]
) -> Iterator[Difference]:
    one, other = a.values, b.values
    if along:
        one = one[np.ix_(*(rows for _, _, rows, _ in along))]
        other = other[np.ix_(*(rows for _, _, _, rows in along))]
    units = [str(values.attrs.get("units", "1")) for values in (a, b)]
    if units[0] != units[1]:
        yield Difference(kind="text", where=f"{where}, unit", a=units[0], b=units[1])
    found = array_difference(where, one, other, [(name, labels) for name, labels, _, _ in along], unit=units[0])
    if found:
        at_units = {name: _unit(a, name) for name in found.at}
        yield replace(found, at_units={name: unit for name, unit in at_units.items() if unit})


def missing(where: str, *, in_a: bool) -> Difference:
    """Return the difference for an object that one of two results lacks."""
    return Difference(kind="missing", where=where, a="there" if in_a else "missing", b="missing" if in_a else "there")


def _labels(dataset: xr.Dataset, dimension: str) -> np.ndarray:
    """Return the coordinate of a dimension, or the numbers from 0 if it has none."""
    if dimension in dataset.variables:
        return np.asarray(dataset[dimension].values)
    return np.arange(dataset.sizes[dimension])


def _common(a: np.ndarray, b: np.ndarray) -> tuple[list[Any], np.ndarray, np.ndarray]:
    """Return the common values, in the order of ``a``, and their indices in both."""
    place = {value: i for i, value in reversed(list(enumerate(b.tolist())))}
    pairs = [(value, i, place[value]) for i, value in enumerate(a.tolist()) if value in place]
    values = [value for value, _, _ in pairs]
    return values, np.array([i for _, i, _ in pairs], dtype=int), np.array([j for _, _, j in pairs], dtype=int)


def _only(where: str, a: np.ndarray, b: np.ndarray, unit: str) -> Difference:
    """Yield the values of a coordinate that only one result has."""
    one, other = a.tolist(), b.tolist()
    here, there = set(one), set(other)
    return Difference(
        kind="missing",
        where=where,
        a=_listed([value for value in one if value not in there]),
        b=_listed([value for value in other if value not in here]),
        unit=unit,
    )


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


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
