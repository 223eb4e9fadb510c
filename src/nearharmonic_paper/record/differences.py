"""Differences between two arrays of numbers or texts, two datasets on their common coordinates, and two tables."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from nearharmonic_paper.record.manifest import Texts

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


def missing(where: str, *, in_a: bool) -> Difference:
    """Return the difference for an object that one of two results lacks."""
    return Difference(kind="missing", where=where, a="there" if in_a else "missing", b="missing" if in_a else "there")


def short(value: Any) -> str:
    """Return a coordinate or a value as text, a float to six digits."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


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
    """Return the difference of two arrays of the same shape, numbers or texts; None if they are equal.

    ``coordinates`` are name and values of each dimension. A name ``where`` of texts that ends in ``status`` gives the
    kind "status".
    """
    if a.dtype.kind in "biuf" and b.dtype.kind in "biuf":
        found = _at_largest(where, a, b, relative_differences(a, b), coordinates)
        return found and replace(found, kind="number", unit="" if unit == "1" else unit)
    found = _at_largest(where, a, b, np.asarray(a.astype(str) != b.astype(str)), coordinates)
    return found and replace(found, kind="status" if where.endswith("status") else "text", relative=None)


def _at_largest(
    where: str, a: np.ndarray, b: np.ndarray, distances: np.ndarray, coordinates: Sequence[tuple[str, Sequence[Any]]]
) -> Difference | None:
    """Return the difference at the largest of the ``distances``, without its kind; None if all are 0."""
    if not distances.any():
        return None
    index = tuple(int(i) for i in np.unravel_index(int(np.argmax(distances)), a.shape))
    return Difference(
        kind="",
        where=where,
        a=a[index].item() if isinstance(a[index], np.generic) else a[index],
        b=b[index].item() if isinstance(b[index], np.generic) else b[index],
        relative=float(distances[index]),
        at={name: values[i] for (name, values), i in zip(coordinates, index, strict=True)},
        differ=int((distances > 0).sum()),
        compared=int(a.size),
    )


def dataset_differences(file: str, a: xr.Dataset, b: xr.Dataset, leave_out: Collection[str]) -> Iterator[Difference]:
    """Yield the differences between two datasets: missing coordinates and variables, then values.

    Values are compared on common coordinates; along a dimension without coordinates, up to the shorter length.
    Variables in ``leave_out`` are not compared; ``file`` is the name of the file, and of the group in it.
    """
    rows: tuple[dict[Any, Any], dict[Any, Any]] = {}, {}
    for dimension in [name for name in a.sizes if name in b.sizes]:
        one, other = (dataset.get_index(dimension) for dataset in (a, b))
        firsts = ~other.duplicated()
        rows[0][dimension] = np.flatnonzero(one.isin(other))
        rows[1][dimension] = np.flatnonzero(firsts)[other[firsts].get_indexer(one[one.isin(other)])]
        if not len(one) == len(other) == rows[0][dimension].size:
            only = [_listed(values) for values in (one[~one.isin(other)].tolist(), other[~other.isin(one)].tolist())]
            unit = _unit(a, str(dimension))
            yield Difference(kind="missing", where=f"{file}: {dimension}", a=only[0], b=only[1], unit=unit)
    names = [name for name in dict.fromkeys([*a.variables, *b.variables]) if name not in (*leave_out, *rows[0])]
    a, b = a.isel(rows[0]), b.isel(rows[1])
    for name in names:
        where = f"{file}: {name}"
        if name not in a.variables or name not in b.variables:
            yield missing(where, in_a=name in a.variables)
        elif a[name].dims != b[name].dims:
            over = [
                f"over {', '.join(map(str, one[name].dims))}" if one[name].dims else "a single value" for one in (a, b)
            ]
            yield Difference(kind="missing", where=where, a=over[0], b=over[1])
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


def _listed(values: Sequence[Any]) -> str:
    """Describe the values that only one result has."""
    if not values:
        return "no more"
    if len(values) <= NAMED or isinstance(values[0], str):
        return f"also {', '.join(map(short, values))}"
    return f"also {len(values)} from {short(min(values))} to {short(max(values))}"


def _unit(dataset: xr.Dataset | xr.DataArray, name: str) -> str:
    unit = str(dataset[name].attrs.get("units", "1")) if name in dataset.coords else "1"
    return "" if unit == "1" else unit


def table_differences(name: str, a: Texts, b: Texts, leave_out: Collection[str]) -> Iterator[Difference]:
    """Yield the differences of each column between the CSV files with one name in two results, without ``leave_out``.

    Rows are matched by the first columns of text that identify them uniquely, or else by their position. A file that
    is damaged, or no table, is a ResultFileError.
    """
    tables = a.table(name), b.table(name)
    one, other = (pd.DataFrame(table.rows, columns=list(table.header), dtype=object) for table in tables)
    for column in dict.fromkeys([*one, *other]):
        if column not in leave_out and (column not in one or column not in other):
            yield missing(f"{name}: {column}", in_a=column in one)
    columns = [column for column in one if column in other and column not in leave_out]
    names = _naming(one[columns], other[columns])
    if names:
        one, other = (table.set_index(names, drop=False) for table in (one, other))
    common = one.index[one.index.isin(other.index)]
    if len(common) < max(len(one), len(other)):
        more = [f"{len(rows) - len(common) or 'no'} more" for rows in (one, other)]
        yield Difference(kind="missing", where=f"{name}: rows", a=more[0], b=more[1])
    at = [" ".join(key) if len(names) > 1 else key if names else str(key + 1) for key in common]
    for column in columns:
        cells = (table.loc[common, column].to_numpy(object) for table in (one, other))
        found = _column_difference(f"{name}: {column}", next(cells), next(cells), at)
        if found:
            yield found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True


def _naming(one: pd.DataFrame, other: pd.DataFrame) -> list[str]:
    """Return the first columns of text that identify the rows of both tables uniquely, if there are any."""
    texts = [column for column in one if not all(map(_is_number, [*one[column], *other[column]]))]
    firsts = (texts[:end] for end in range(1, len(texts) + 1))
    return next(
        (names for names in firsts if not one.duplicated(names).any() and not other.duplicated(names).any()), []
    )


def _column_difference(where: str, a: np.ndarray, b: np.ndarray, at: Sequence[str]) -> Difference | None:
    numbers = all(map(_is_number, [*a, *b]))
    distances = [0.0 if x == y else _relative(x, y) if numbers else 1.0 for x, y in zip(a, b, strict=True)]
    found = _at_largest(where, a, b, np.array(distances), [("row", at)])
    if found is None or not numbers:
        return found and replace(found, kind="text", relative=None)
    return replace(found, kind="number", a=_cell(found.a), b=_cell(found.b))


def _relative(a: str, b: str) -> float:
    """Return |a - b| / max(|a|, |b|) of two cells, with all their digits."""
    try:
        one, other = Decimal(a), Decimal(b)
    except InvalidOperation:  # one of them is empty
        return inf
    if not (one.is_finite() and other.is_finite()):
        return 0.0 if float(a) == float(b) or {one.is_nan(), other.is_nan()} == {True} else inf
    # Decimals are subtracted exactly; only the difference is rounded.
    scale = max(abs(one), abs(other))
    return float(abs(one - other) / scale) if scale else 0.0


def _cell(text: str) -> Any:
    """Return a number of a table, as a float if this loses no digit."""
    try:
        number = float(text)
    except ValueError:
        return text
    return number if not isfinite(number) or Decimal(repr(number)) == Decimal(text) else text
