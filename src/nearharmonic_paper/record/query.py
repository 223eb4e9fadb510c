"""Single runs of a result: conditions on columns, a table, one run with code that repeats it, and repetitions."""

from __future__ import annotations

import ast
import json
import operator
import random
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from math import inf, log
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from pandas.api.types import is_numeric_dtype

from nearharmonic.engine.settings import SharedSettings, Sweep, checked_tau, one_of
from nearharmonic.errors import NearharmonicError, ResultFileError, SettingError, bad_setting, unknown_name
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.output.store import Variables
from nearharmonic.systems import systems
from nearharmonic.systems.user_file import SystemDefinition
from nearharmonic_paper.experiments.paper.run import integrate_run, runs_of
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.history import makers_in
from nearharmonic_paper.record.manifest import check_files_of
from nearharmonic_paper.tasks.provenance import defined, read_definitions
from nearharmonic_paper.tasks.schema import complaint

if TYPE_CHECKING:
    import xarray as xr


# --- Conditions on columns, written as Python comparisons: parsed by ``ast`` and evaluated with numpy, node by node.
#
# Allowed are comparisons (chained ones too), ``and``, ``or``, ``not``, parentheses, ``+ - * /``, numbers, texts,
# names of columns, ``inf``, and ``in`` with a list of numbers or texts. No other node is evaluated: no call and no
# attribute.

NUMBER, TEXT, TRUTH = "a number", "a text", "a condition"

_FUNCTIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.And: np.logical_and, ast.Or: np.logical_or, ast.Not: np.logical_not, ast.UAdd: operator.pos,
    ast.USub: operator.neg, ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.Div: operator.truediv, ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip
_ALLOWED = "comparisons, and, or, not, + - * /, numbers, texts in quotes, columns and in [...]"


def rows_where(text: str, columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the mask of the rows that fulfil a condition, such as ``max_energy_error < 1e-9 and status == 'ok'``.

    Columns are arrays of numbers or of texts, of the same length. A comparison with NaN is false.
    """
    source = " ".join(text.split())
    try:
        with np.errstate(all="ignore"):
            mask = _Condition(source, columns).value(_parsed(source))
    except (RecursionError, MemoryError):  # from the parser, or from the recursion below
        raise SettingError("where is too deeply nested") from None
    if _kind(mask) != TRUTH:
        raise SettingError(f"where = {source!r} is {_kind(mask)}, not a condition; allowed are {_ALLOWED}")
    return np.broadcast_to(mask, next((len(columns[name]) for name in columns), 0))


def _parsed(source: str) -> ast.expr:
    try:
        with warnings.catch_warnings(action="ignore"):  # for a backslash in a text, or for 1and 2
            return ast.parse(source, mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset or len(source) + 1}: {error.msg}"
        if re.match(r"=[^=]", source[(error.offset or 0) - 1 :]):
            place += "; equality is written =="
    except ValueError as error:
        place = f"because of its characters: {error}"
    raise SettingError(f"where = {source!r} cannot be read {place}")


def _kind(value: Any) -> str:
    return {"b": TRUTH, "f": NUMBER, "O": TEXT}[value.dtype.kind]


class _Condition:
    """Evaluator of a parsed condition on columns; every value is a numpy scalar or array of floats, texts or truths."""

    def __init__(self, source: str, columns: Mapping[str, np.ndarray]) -> None:
        self._source = source
        self._columns = columns

    def value(self, node: ast.expr) -> Any:
        """Return the value of a part."""
        match node:
            case ast.BoolOp(op=sign, values=parts):
                return reduce(_FUNCTIONS[type(sign)], [self._of_kind(part, TRUTH) for part in parts])
            case ast.UnaryOp(op=ast.Not() | ast.UAdd() | ast.USub() as sign, operand=part):
                return _FUNCTIONS[type(sign)](self._of_kind(part, TRUTH if isinstance(sign, ast.Not) else NUMBER))
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() as sign):
                return _FUNCTIONS[type(sign)](self._of_kind(node.left, NUMBER), self._of_kind(node.right, NUMBER))
            case ast.Compare(ops=signs):
                pairs = zip(signs, pairwise([node.left, *node.comparators]), strict=True)
                return reduce(np.logical_and, [self._compared(left, sign, right) for sign, (left, right) in pairs])
            case ast.Name(id=name):
                if name not in self._columns and name != "inf":
                    raise unknown_name("column", name, self._columns)
                return self._operand(node, self._columns.get(name, inf))
            case ast.Constant(value=str() | int() | float() as value) if not isinstance(value, bool):
                return self._operand(node, value)
        raise self._refused(node, f"allowed are {_ALLOWED}")

    def _operand(self, node: ast.expr, value: Any) -> Any:
        """Return a column or a constant; integers become floats, so that products do not overflow 64 bits."""
        is_text = not isinstance(value, int | float) and np.asarray(value).dtype.kind in "UO"
        try:
            return np.asarray(value, dtype=object) if is_text else np.asarray(value, dtype=float)
        except OverflowError:
            raise self._refused(node, "it is larger than any number of a column") from None

    def _compared(self, left: ast.expr, sign: ast.cmpop, right: ast.expr) -> Any:
        """Return the values of a comparison, which is false if one side is NaN."""
        if isinstance(sign, ast.Is | ast.IsNot):
            raise self._refused(right, f"allowed are {_ALLOWED}")
        others, value = [right], self.value(left)
        if is_member := isinstance(sign, ast.In | ast.NotIn):
            if not isinstance(right, ast.List | ast.Tuple | ast.Set) or not right.elts:
                raise self._refused(right, "in takes a list of numbers or texts, such as ['ruth', 'aba104']")
            others = right.elts
            for member in others:
                if isinstance(member, ast.Name) and member.id in self._columns:
                    raise self._refused(member, "in takes a list of numbers or texts, no columns")
        values = [self._alike(left, value, other) for other in others]
        function = operator.eq if is_member else _FUNCTIONS[type(sign)]
        holds = reduce(np.logical_or, [np.asarray(function(value, other), dtype=bool) for other in values])
        known = [np.asarray(side == side) for side in (value, *values)]  # noqa: PLR0124 - NaN differs from itself
        return reduce(np.logical_and, known, ~holds if isinstance(sign, ast.NotIn) else holds)

    def _alike(self, left: ast.expr, value: Any, right: ast.expr) -> Any:
        """Return the value of ``right``, which must have the kind of the ``value`` of ``left``."""
        other = self.value(right)
        if TRUTH in {_kind(value), _kind(other)}:
            raise self._refused(left if _kind(value) == TRUTH else right, "a condition cannot be compared")
        if _kind(value) != _kind(other):
            raise self._refused(right, f"it is {_kind(other)}, and {self._words(left)} is {_kind(value)}")
        return other

    def _of_kind(self, node: ast.expr, kind: str) -> Any:
        value = self.value(node)
        if _kind(value) != kind:
            raise self._refused(node, f"it is {_kind(value)}, where {kind} is expected")
        return value

    def _words(self, node: ast.expr) -> str:
        return ast.get_source_segment(self._source, node) or ast.unparse(node)

    def _refused(self, node: ast.expr, reason: str) -> SettingError:
        before = self._source.encode()[: node.col_offset].decode()
        message = f"where = {self._source!r}: {self._words(node)!r}, at character {len(before) + 1}, is not allowed: "
        return SettingError(f"{message}{reason}")


# --- Single runs of the cubes of systems as rows of a table, selected by a condition and sorted.

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


def run_table(folders: Mapping[str, Path]) -> tuple[pd.DataFrame, dict[str, dict[str, str]]]:
    """Return every run of some results, sorted by result, system, integrator, precision and step size.

    ``folders`` has folders of results by name; if there are several, the first column is ``result`` with their names.

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
    units: dict[str, dict[str, str]] = {}
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

    Other cubes, such as the cube of kinetic energies, also name a system, but have no single runs.
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
    settings: Any = {}
    try:
        settings = json.loads(attributes.get("settings", "{}"))
        fault = complaint("settings", settings)
    except (TypeError, ValueError, RecursionError):
        fault = "are no JSON"
    if fault:
        raise store.unusable(path, f"has settings that cannot be read: the text {fault}")
    return dict(settings)


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


# --- One run of a result: its numbers, its files, and Python code that repeats it.

#: Relative tolerance for a grid of one step size, for values typed with few digits.
LEAST_SPACING = 1e-3


def single_run(
    folder: Path, system: str, integrator: str, tau: object, *, precision: str | None = None, per_stage: bool = False
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the run of a result with the step size nearest to ``tau``, which ``per_stage`` is that per stage.

    The precision is double by default, or the only available one.

    Returns
    -------
    dict
        The answer: ``result``; ``run``, numbers and texts of its cell in the cube; ``units`` of the numbers, and
        ``system_units`` of t, q, p and the energy, empty for an unknown system; ``settings`` of the sweep;
        ``samples_kept``, states in its trajectory, None without one; ``files`` with their entries in the manifest;
        ``origin``, versions and digests of the trajectory or else of the cube; ``python``, code that repeats the run.
    dict
        Users' ``definitions`` of the system and of integrators.
    """
    cubes = {path.stem: path for path in system_cubes(folder)}
    if system not in cubes:
        raise unknown_name("system", system, cubes)
    runs, units = runs_of_cube(cubes[system])
    integrator = integrators.name_of(integrator)
    if integrator not in (known := dict.fromkeys(runs["integrator"])):
        raise unknown_name("integrator", integrator, known)
    runs = runs[runs["integrator"] == integrator]
    present = list(dict.fromkeys(runs["precision"]))
    runs = runs[runs["precision"] == (present[0] if precision is None else one_of("precision", precision, present))]
    taus = runs["tau_per_stage" if per_stage else "tau"].to_numpy()
    row = _nearest(taus, checked_tau(tau), f"{integrator} on {system}")
    (cells,) = runs[row : row + 1].to_dict("records")
    cube, (file, samples) = cubes[system], _trajectory(folder, cells)
    attributes = store.attributes_of(cube)
    told = settings_of(cube, attributes)
    settings, definitions = told.get("sweep", {}), told.get("definitions", {})
    origin = attributes if file is None else store.attributes_of(file)
    answer = {
        "result": str(folder),
        "run": {str(name): cell for name, cell in cells.items()},
        "units": units,
        "system_units": _units(system, definitions),
        "settings": settings,
        "samples_kept": samples,
        "files": _files(folder, {"cube": cube, "run file": file}),
        "origin": {name: str(text) for name, text in origin.items() if name.endswith(("_version", "_digest"))},
        "python": "\n".join(_python_lines(cells, settings, read_definitions(definitions))),
    }
    return answer, definitions


def _units(system: str, definitions: Mapping[str, Any]) -> dict[str, str]:
    """Return the units of a registered or a user's system; {} for an unknown system."""
    with suppress(NearharmonicError), defined(read_definitions(definitions)):
        return dict(systems[system].units)
    return {}


def _nearest(taus: np.ndarray, asked: float, whose: str) -> int:
    """Return the index of the step size with the nearest logarithm to ``asked``, within the spacing of the grid."""
    logarithms = np.log(np.where(taus > 0, taus, np.inf))
    distances = abs(logarithms - log(asked))
    row = int(distances.argmin())
    gaps = np.diff(np.sort(logarithms[np.isfinite(logarithms)]))
    spacing = max(LEAST_SPACING, float(gaps.max(initial=0.0)))
    if distances[row] > spacing:
        near = np.sort(taus[np.argsort(distances, kind="stable")[:2]]).tolist()
        allowed = f"the runs of {whose} have steps from {taus.min():.6g} to {taus.max():.6g}, the nearest"
        raise bad_setting("tau", asked, f"{allowed} {' and '.join(f'{tau:.6g}' for tau in near)}")
    return row


def _trajectory(folder: Path, cells: Mapping[str, Any]) -> tuple[Path | None, int | None]:
    """Return the run file of the run, and the number of its states there."""
    for path in sorted(folder.glob(f"runs/{cells['system']}/{cells['integrator']}/*.h5")):
        runs = store.read_precisions(path).get(cells["precision"])
        with store.as_written(path):
            if runs is not None:
                made = (runs.tau_per_stage == cells["tau_per_stage"]) & (runs.status != SKIPPED)
                (rows,) = np.nonzero(made.values)
                if rows.size:
                    return path, int(np.isfinite(runs.t[rows[0]].values).sum())
    return None, None


def _python_lines(
    cells: Mapping[str, Any], settings: Mapping[str, Any], definitions: Mapping[str, Mapping[str, Any]]
) -> list[str]:
    """Return Python code that repeats a run; the printed number is bitwise identical to the number in the cube."""
    system, before = _system_lines(str(cells["system"]), definitions)
    own = definitions.get("integrators", {}).get(str(cells["integrator"]))
    integrator = json.dumps(str(cells["integrator"]) if own is None else f"{own.file}:{cells['integrator']}")
    given: dict[str, Any] = {name: settings[name] for name in ("t_end", "summation", "samples") if name in settings}
    shared = SharedSettings().shared_settings.items()
    given |= {name: settings[name] for name, usual in shared if settings.get(name, usual) != usual}
    more = ", ".join(f"{name}={json.dumps(value)}" for name, value in given.items())
    return [
        "import nearharmonic as nh",
        *before,
        "",
        "run = nh.integrate(",
        f"    {system}, {integrator}, tau={cells['tau']!r}, precision={json.dumps(str(cells['precision']))},",
        *([f"    {more},"] if more else []),
        ")",
        f"print(run.max_energy_error.item())  # {cells['max_energy_error']!r}",
    ]


def _system_lines(name: str, definitions: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the argument for a system in a call, and the lines before the call."""
    told = definitions.get("systems", {}).get(name)
    if told is None:
        return json.dumps(name), []  # names in a result may hold quotes
    if told == SystemDefinition(file=told.file):
        return json.dumps(str(told.file)), []
    imported = "from nearharmonic.systems.user_file import SystemDefinition"
    return "system", [imported, "", f"system = {told!r}.make({json.dumps(name)})"]


def _files(folder: Path, paths: Mapping[str, Path | None]) -> dict[str, dict[str, Any]]:
    """Return path, entry in the manifest and newest maker of files."""
    recorded = manifest.read(folder)["files"] if (folder / manifest.MANIFEST).exists() else {}
    makers = {name: {"run": run} for name, run in makers_in(folder).items()}
    names = {what: path.relative_to(folder).as_posix() for what, path in paths.items() if path is not None}
    return {what: {"path": n, **recorded.get(n, {}), **makers.get(n, {})} for what, n in names.items()}


# --- Repetition of recorded runs: equal settings give bitwise identical results.

#: Tasks that write run files.
REPEATED = (
    "nearharmonic_paper.experiments.paper.run:integrate",
    "nearharmonic_paper.experiments.paper.reductions:integrate_and_reduce",
)


@dataclass(frozen=True, kw_only=True)
class Rerun:
    """One repeated run: its run file in the folder of results, its arithmetic, and its step size per stage.

    ``differs`` are the sorted names of the variables that are not bitwise identical.
    """

    file: str
    precision: str
    tau_per_stage: float
    differs: tuple[str, ...]


def rerun(folder: Path, number: int, seed: int = 1) -> list[Rerun]:
    """Repeat random runs from all run files of ``folder``, and compare them bitwise."""
    entries = {n: entry for n, entry in manifest.read(folder)["files"].items() if entry["function"] in REPEATED}
    cells = [cell for name in entries for cell in _cells(folder, name)]
    drawn = [cells[i] for i in sorted(random.Random(seed).sample(range(len(cells)), min(number, len(cells))))]
    check_files_of(entries[name] for name, _, _ in drawn)
    return [_again(folder, *cell) for cell in drawn]


def _cells(folder: Path, name: str) -> Iterator[tuple[str, str, int]]:
    """Yield file, precision and index of every run of a file."""
    for precision, runs in store.read_precisions(folder / name).items():
        with store.as_written(folder / name):
            yield from ((name, precision, i) for i in np.flatnonzero(runs.status.values != SKIPPED).tolist())


def _again(folder: Path, name: str, precision: str, index: int) -> Rerun:
    """Repeat the run ``index`` with this precision of a file."""
    from nearharmonic_paper.experiments.paper.reductions import reduced_run

    kept = store.read(folder / name, None if precision == "double" else precision)
    settings = settings_of(folder / name, kept.attrs)
    with store.as_written(folder / name), defined(read_definitions(settings.get("definitions", {}))):
        sweep = Sweep(**settings["sweep"] | {"precision": tuple(settings["sweep"]["precision"])})
        planned = runs_of(sweep, settings["integrator"], settings["shard"])
        (run,) = (run for run in planned if run.precision == precision)
        place = run.tau_per_stage.index(float(kept.tau_per_stage[index]))
        alone = replace(run, tau_per_stage=run.tau_per_stage[place : place + 1], steps=run.steps[place : place + 1])
        differs = tuple(sorted(_differing((integrate_run if sweep.samples else reduced_run)(alone), kept, index)))
        return Rerun(file=name, precision=precision, tau_per_stage=alone.tau_per_stage[0], differs=differs)


def _differing(made: Variables, kept: Any, index: int) -> Iterator[str]:
    """Return the names of variables that are not bitwise identical to run ``index`` of ``kept``."""
    yield from made.keys() ^ set(kept.variables)
    for name in made.keys() & set(kept.variables):
        dimensions, values, _ = made[name]
        before = kept[name].values[index : index + 1] if dimensions[:1] == ("tau_per_stage",) else kept[name].values
        after = np.asarray(values)
        if name == "sample":
            before = before[: after.size]
        elif "sample" in dimensions:
            # The samples of a short run are padded if the file has longer runs.
            before, filling = np.split(before, [after.shape[1]], axis=1)
            if not (np.isnan(filling) | (filling == 0)).all():
                yield name
                continue
        if after.shape != before.shape or not _same_bits(after, before):
            yield name


def _same_bits(a: np.ndarray, b: np.ndarray) -> bool:
    if a.dtype.kind in "UO":
        return bool(np.array_equal(a.astype(str), b.astype(str)))
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()
