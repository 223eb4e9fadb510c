"""Comparison of two results: differences of claims, settings and numbers, and energy errors in one figure."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.output import store
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.history import flattened, newest_finished
from nearharmonic_paper.record.manifest import Texts
from nearharmonic_paper.record.query import settings_of, system_cube, system_cubes
from nearharmonic_paper.tasks.provenance import WHOLE

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# --- Differences between arrays of numbers or texts, datasets on their common coordinates, and tables.

#: Maximum number of values of a coordinate that are listed one by one.
NAMED = 6


@dataclass(frozen=True, kw_only=True)
class Difference:
    """One difference of two results.

    ``kind`` is "claim", "setting", "code", "coefficients", "version", "status", "number", "text" or "missing";
    ``where`` names the object that differs: a file name is relative to the result, followed by the variable or column.
    ``a`` and ``b`` are the values in the two results with their ``unit``, "" if they have none; for arrays those at the
    coordinates ``at`` of the largest difference, or of the first one of texts, whose units are ``at_units``.
    ``relative`` is the largest |a - b| / max(|a|, |b|) of numbers, infinite if one is not finite. ``differ`` of
    ``compared`` values differ; both are None for single values.
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
    x, y = a.astype(np.float64), b.astype(np.float64)
    with np.errstate(all="ignore"):
        # Halves make the difference of the two largest doubles finite.
        relative = abs(x / 2 - y / 2) / np.maximum(abs(x), abs(y)) * 2
    # Two integers may round to one double, and half of the smallest double is 0.
    relative = np.where(relative > 0, relative, np.finfo(np.float64).tiny)
    relative = np.where(np.isfinite(x) & np.isfinite(y), relative, inf)
    return np.where((a == b) | (np.isnan(x) & np.isnan(y)), 0.0, relative)


def array_difference(
    where: str, a: np.ndarray, b: np.ndarray, coordinates: Sequence[tuple[str, Sequence[Any]]], *, unit: str = ""
) -> Difference | None:
    """Return the difference of two arrays of the same shape, numbers or texts; None if they are equal.

    ``coordinates`` are name and values of each dimension. A name ``where`` of texts that ends in ``status`` gives the
    kind "status".
    """
    if a.dtype.kind in "biuf" and b.dtype.kind in "biuf":
        difference = _at_largest("number", where, a, b, relative_differences(a, b), coordinates)
        return difference and replace(difference, unit="" if unit == "1" else unit)
    kind = "status" if where.endswith("status") else "text"
    return _at_largest(kind, where, a, b, np.asarray(a.astype(str) != b.astype(str)), coordinates)


def _at_largest(
    kind: str, where: str, a: np.ndarray, b: np.ndarray, distances: np.ndarray,
    coordinates: Sequence[tuple[str, Sequence[Any]]],
) -> Difference | None:  # fmt: skip
    """Return the difference at the largest of the ``distances``; None if all are 0."""
    if not distances.any():
        return None
    index = tuple(int(i) for i in np.unravel_index(int(np.argmax(distances)), a.shape))
    first, second = (one[index].item() if isinstance(one[index], np.generic) else one[index] for one in (a, b))
    return Difference(
        kind=kind,
        where=where,
        a=first,
        b=second,
        relative=float(distances[index]) if kind == "number" else None,
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
        left, right = (dataset.get_index(dimension) for dataset in (a, b))
        firsts, common = ~right.duplicated(), left.isin(right)
        rows[0][dimension] = np.flatnonzero(common)
        rows[1][dimension] = np.flatnonzero(firsts)[right[firsts].get_indexer(left[common])]
        if not len(left) == len(right) == rows[0][dimension].size:
            only = [_listed(values) for values in (left[~common].tolist(), right[~right.isin(left)].tolist())]
            unit = _unit(a, str(dimension))
            yield Difference(kind="missing", where=f"{file}: {dimension}", a=only[0], b=only[1], unit=unit)
    names = [name for name in dict.fromkeys([*a.variables, *b.variables]) if name not in (*leave_out, *rows[0])]
    a, b = a.isel(rows[0]), b.isel(rows[1])
    for name in names:
        where = f"{file}: {name}"
        if name not in a.variables or name not in b.variables:
            yield missing(where, in_a=name in a.variables)
        elif a[name].dims != b[name].dims:
            over = [", ".join(map(str, dataset[name].dims)) for dataset in (a, b)]
            shapes = [f"over {dimensions}" if dimensions else "a single value" for dimensions in over]
            yield Difference(kind="missing", where=where, a=shapes[0], b=shapes[1])
        else:
            yield from _values(where, a[name], b[name])


def _values(where: str, a: xr.DataArray, b: xr.DataArray) -> Iterator[Difference]:
    """Yield the differences of the units and of the values of two arrays on the same coordinates."""
    units = [str(values.attrs.get("units", "1")) for values in (a, b)]
    if units[0] != units[1]:
        yield Difference(kind="text", where=f"{where}, unit", a=units[0], b=units[1])
    coordinates = [(str(name), a.get_index(name).tolist()) for name in a.dims]
    if difference := array_difference(where, a.values, b.values, coordinates, unit=units[0]):
        at_units = {name: _unit(a, name) for name in difference.at}
        yield replace(difference, at_units={name: unit for name, unit in at_units.items() if unit})


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
    left, right = (pd.DataFrame(table.rows, columns=list(table.header), dtype=object) for table in tables)
    for column in dict.fromkeys([*left, *right]):
        if column not in leave_out and (column not in left or column not in right):
            yield missing(f"{name}: {column}", in_a=column in left)
    columns = [column for column in left if column in right and column not in leave_out]
    names = _naming(left[columns], right[columns])
    if names:
        left, right = (table.set_index(names, drop=False) for table in (left, right))
    common = left.index[left.index.isin(right.index)]
    if len(common) < max(len(left), len(right)):
        more = [f"{len(rows) - len(common) or 'no'} more" for rows in (left, right)]
        yield Difference(kind="missing", where=f"{name}: rows", a=more[0], b=more[1])
    at = [" ".join(key) if len(names) > 1 else key if names else str(key + 1) for key in common]
    for column in columns:
        mine, other = (table.loc[common, column].to_numpy(object) for table in (left, right))
        if difference := _column_difference(f"{name}: {column}", mine, other, at):
            yield difference


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True


def _naming(left: pd.DataFrame, right: pd.DataFrame) -> list[str]:
    """Return the first columns of text that identify the rows of both tables uniquely, if there are any."""
    texts = [column for column in left if not all(map(_is_number, [*left[column], *right[column]]))]
    firsts = (texts[:end] for end in range(1, len(texts) + 1))
    return next((names for names in firsts if not any(t.duplicated(names).any() for t in (left, right))), [])


def _column_difference(where: str, a: np.ndarray, b: np.ndarray, at: Sequence[str]) -> Difference | None:
    numbers = all(map(_is_number, [*a, *b]))
    distances = [0.0 if x == y else _relative(x, y) if numbers else 1.0 for x, y in zip(a, b, strict=True)]
    told = _at_largest("number" if numbers else "text", where, a, b, np.array(distances), [("row", at)])
    return replace(told, a=_cell(told.a), b=_cell(told.b)) if told and numbers else told


def _relative(a: str, b: str) -> float:
    """Return |a - b| / max(|a|, |b|) of two cells, with all their digits."""
    try:
        x, y = Decimal(a), Decimal(b)
    except InvalidOperation:  # one of them is empty
        return inf
    if not (x.is_finite() and y.is_finite()):
        return 0.0 if float(a) == float(b) or (x.is_nan() and y.is_nan()) else inf
    # Decimals are subtracted exactly; only the difference is rounded.
    scale = max(abs(x), abs(y))
    return float(abs(x - y) / scale) if scale else 0.0


def _cell(text: str) -> Any:
    """Return a number of a table, as a float if this loses no digit."""
    try:
        number = float(text)
    except ValueError:
        return text
    return number if not isfinite(number) or Decimal(repr(number)) == Decimal(text) else text


# --- Comparison of two folders: claims first, then the provenance, then cubes and tables.

CLAIMS = Path("tables/claims.json")
#: Kinds of differences that concern the provenance of the results, not their content.
ORIGIN = ("setting", "code", "coefficients", "version")


def compared(a: Path, b: Path) -> tuple[list[Difference], list[str]]:
    """Return the differences between two folders of results, of any configs, and what is not compared.

    These are the files and variables that hold measured times. A file that cannot be read is a ResultFileError.
    """
    pair = _Pair(a, b)
    differences = [*pair.claims(), *pair.settings(), *pair.origins()]
    differences += [*pair.files("cubes/*.h5", pair.cube), *pair.files("tables/*.csv", pair.table)]
    return differences, list(dict.fromkeys(pair.left_out))


def same_numbers(differences: Sequence[Difference]) -> bool:
    """Return True if only the provenance of the results differs."""
    return all(difference.kind in ORIGIN for difference in differences)


class _Pair:
    """Two folders of results."""

    def __init__(self, a: Path, b: Path) -> None:
        self._folders = (a, b)
        self._newest = [newest_finished(folder) or {} for folder in self._folders]
        self._manifests = [
            manifest.read(folder) if (folder / "manifest.json").exists() else {} for folder in self._folders
        ]
        self.left_out: list[str] = []

    def claims(self) -> Iterator[Difference]:
        """Yield claims with different verdicts, and claims that only one result has."""
        left, right = map(_claims, self._folders)
        if left is None or right is None:
            if left is not right:
                yield missing(str(CLAIMS), in_a=left is not None)
            return
        yield from (told for told in _keys_that_differ("claim", [left, right]) if None not in (told.a, told.b))
        yield from (missing(f"claim {name}", in_a=name in left) for name in sorted({*left} ^ {*right}))

    def settings(self) -> Iterator[Difference]:
        """Yield the differing keys of the configs, then of the settings of each cube."""
        if all(self._newest):
            # The name is the folder's.
            configs = [dict(flattened(run.get("config", {}) | {"name": ""})) for run in self._newest]
            yield from _keys_that_differ("setting", configs, "config: {}")
        for name, cubes in self._attributes():
            both = zip(self._folders, cubes, strict=True)
            told = [dict(flattened(settings_of(folder / name, attributes))) for folder, attributes in both]
            yield from _keys_that_differ("setting", told, f"{name}: {{}}")

    def origins(self) -> Iterator[Difference]:
        """Yield differing digests of code and coefficients, and versions: of the newest runs, then of the cubes."""
        cubes = list(self._attributes())
        makers: list[tuple[str, Sequence[Mapping[str, Any]]]] = [("newest run", self._newest)]
        for kind in ("code", "coefficients"):
            for name, both in (makers if all(self._newest) else []) + cubes:
                digests = [{name: told.get(f"{kind}_digest")} for told in both]
                for one in _keys_that_differ(kind, digests):
                    yield replace(one, a=one.a and one.a[:10], b=one.b and one.b[:10])
        versions: list[dict[str, Any]] = [{}, {}]
        for _, both in cubes:
            for side, told in zip(versions, both, strict=True):
                side |= {key.removesuffix("_version"): told[key] for key in told if key.endswith("_version")}
        for side, run in zip(versions, self._newest, strict=True):
            if "package" in side:
                side["nearharmonic"] = side.pop("package")
            side.update(run.get("versions", {}) if all(self._newest) else {})
        yield from _keys_that_differ("version", versions)

    def _attributes(self) -> Iterator[tuple[str, list[dict[str, str]]]]:
        """Return the name of each common cube, and its attributes in both results."""
        for name in self._names("cubes/*.h5"):
            paths = [folder / name for folder in self._folders]
            if all(path.exists() for path in paths):
                yield name, [{key: str(value) for key, value in store.attributes_of(path).items()} for path in paths]

    def _names(self, pattern: str) -> list[str]:
        return sorted(
            {path.relative_to(folder).as_posix() for folder in self._folders for path in folder.glob(pattern)}
        )

    def cube(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        """Yield the differences of a cube, group by group."""
        paths = [folder / name for folder in self._folders]
        groups = [store.groups_of(path) for path in paths]
        for group in dict.fromkeys([None, *groups[0], *groups[1]]):
            place = name if group is None else f"{name}/{group}"
            if group is not None and not all(group in names for names in groups):
                yield missing(place, in_a=group in groups[0])
                continue
            datasets = store.read(paths[0], group), store.read(paths[1], group)
            measured = {str(v) for d in datasets for v in d.variables if "volatile" in d[v].attrs} | volatile
            self.left_out += [f"{place}: {v}" for v in sorted(measured) if any(v in d for d in datasets)]
            yield from dataset_differences(place, *datasets, measured)

    def table(self, name: str, volatile: set[str]) -> Iterator[Difference]:
        """Yield the differences of a table; differences of verdicts are told as claims."""
        self.left_out += [f"{name}: {column}" for column in sorted(volatile)]
        shown_above = {"verdict"} if name == str(CLAIMS.with_suffix(".csv")) else set()
        left, right = map(Texts, self._folders)
        return table_differences(name, left, right, volatile | shown_above)

    def files(self, pattern: str, differences: Callable[[str, set[str]], Iterator[Difference]]) -> Iterator[Difference]:
        """Yield the differences of each common file, from its name and volatile parts, and each missing file."""
        for name in self._names(pattern):
            there = [(folder / name).exists() for folder in self._folders]
            entries = [told.get("files", {}).get(name, {}) for told in self._manifests]
            volatile = {part for entry in entries for part in entry.get("volatile", ())}
            if not all(there):
                yield missing(name, in_a=there[0])
            elif WHOLE in volatile:
                self.left_out.append(name)
            else:
                yield from differences(name, volatile)


def _claims(folder: Path) -> dict[str, str] | None:
    """Return the verdict of each claim by its id; None if there are no claims."""
    if not (folder / CLAIMS).exists():
        return None
    texts = Texts(folder)
    text = texts.read(str(CLAIMS))
    try:
        return {str(claim["id"]): str(claim["verdict"]) for claim in json.loads(text)}
    except (ValueError, TypeError, LookupError, RecursionError) as error:
        raise texts.unusable(str(CLAIMS), "holds no claims") from error


def _keys_that_differ(kind: str, both: Sequence[Mapping[str, Any]], where: str = "{}") -> Iterator[Difference]:
    """Yield the keys with different values, in the order of the first result; None marks a missing key."""
    for key in dict.fromkeys([*both[0], *both[1]]):
        a, b = (values.get(key) for values in both)
        if a != b:
            yield Difference(kind=kind, where=where.format(key), a=a, b=b)


# --- Energy errors of two results in one figure: broad pale lines for the first, thin dashes on them for the second.

FIGURES = (".pdf", ".png", ".svg")
#: Columns of panels: variable and title.
MEASURES = (("max_energy_error", "maximum over all steps"), ("mean_energy_error", "mean over all steps"))
DASHES: Any = (0, (4, 2))
#: Upper end of the axis: an error of ten times the energy is not meaningful.
LARGEST_ERROR = 10.0


def save_overlay(results: Mapping[str, Path], place: str) -> Path:
    """Draw the energy errors of two results, folders by the names in the legend, and write the figure.

    Another ending of the file than :data:`FIGURES`, or no system of which both have a cube, is a SettingError.
    """
    from nearharmonic.plotting import style

    path = Path(place)
    if path.suffix not in FIGURES:
        raise bad_setting("figure", place, f"a file that ends in {', '.join(FIGURES)}")
    cubes = [{file.stem: file for file in system_cubes(folder)} for folder in results.values()]
    common = [name for name in cubes[0] if name in cubes[1]]
    if not common:
        raise SettingError(f"no figure: {' and '.join(results)} have no system in common")
    pairs = {name: [store.double_runs(system_cube(files[name])) for files in cubes] for name in common}
    (written,) = style.save(style.house_style(overlay)(list(results), pairs), [path])
    return written


def overlay(results: Sequence[str], pairs: Mapping[str, Sequence[xr.Dataset]]) -> Figure:
    """Draw a row of panels for each system, maximum on the left and mean on the right.

    ``pairs[system]`` are the cubes of both results, over (integrator, tau_per_stage).
    """
    from matplotlib.lines import Line2D

    from nearharmonic.plotting import style

    labels: dict[str, str] = {}
    for cube in (cube for pair in pairs.values() for cube in pair):
        labels |= dict(zip(map(str, cube["integrator"].values), map(str, cube["label"].values), strict=True))
    lines_of_legend = -(-(len(labels) + 2) // 4)
    height = 0.75 + 0.2 * lines_of_legend + 2.9 * len(pairs)
    drawn = style.new_figure(7.5, height)
    top = 1 - (0.35 + 0.2 * lines_of_legend) / height
    drawn.subplots_adjust(left=0.1, right=0.985, top=top, bottom=0.5 / height, hspace=0.34, wspace=0.09)
    grid = drawn.subplots(len(pairs), len(MEASURES), squeeze=False, sharex="row", sharey="row")
    for row, (name, pair) in zip(grid, pairs.items(), strict=True):
        for axes, (variable, says) in zip(row, MEASURES, strict=True):
            _draw(axes, pair, variable, list(labels))
            axes.set_title(f"{pair[0].attrs.get('system_label', name)}: {says}", loc="left", fontsize=9, pad=4)
            unit = pair[0]["tau_per_stage"].attrs.get("units", "1")
            axes.set_xlabel(style.step_label(unit))
        row[0].set_ylabel(r"$|\Delta H/H_0|$")
        row[0].margins(x=0.02, y=0.03)
        for axes in row:
            style.log_scale(axes, "xy")
        if row[0].get_ylim()[1] > LARGEST_ERROR:
            row[0].set_ylim(top=LARGEST_ERROR)
    handles = style.method_handles(labels, labels.values())
    looks: list[dict[str, Any]] = [{"linewidth": 2.4, "alpha": 0.4}, {"linewidth": 1.0, "linestyle": DASHES}]
    handles += [Line2D([], [], color="#404040", label=name, **look) for name, look in zip(results, looks, strict=True)]
    drawn.legend(handles=handles, loc="upper center", ncols=4, columnspacing=1.8)
    return drawn


def _draw(axes: Axes, pair: Sequence[xr.Dataset], variable: str, methods: Sequence[str]) -> None:
    """Draw the first as a pale, broad line with markers, the second as thin dashes that are visible on it."""
    from nearharmonic.plotting import style

    for cube, second in zip(pair, (False, True), strict=True):
        tau: Any = cube["tau_per_stage"].values
        for position, name in enumerate(methods):
            if name not in cube["integrator"].values:
                continue
            errors, line = cube[variable].sel(integrator=name).values, style.style_of(name)
            if second:
                axes.plot(tau, errors, zorder=4, **line.line(marker="none", linestyle=DASHES, linewidth=1.0))
            else:
                marked = style.mark_every(position, len(methods), errors)
                axes.plot(tau, errors, zorder=2, **line.line(marker="none", linewidth=2.4, alpha=0.4))
                axes.plot(tau, errors, zorder=3, markevery=marked, **line.points())
