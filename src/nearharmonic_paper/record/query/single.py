"""One run of a result: its numbers, its files, and Python code that repeats it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import log
from pathlib import Path
from typing import Any

import numpy as np

from nearharmonic.engine.settings import SharedSettings, checked_tau, one_of
from nearharmonic.errors import NearharmonicError, bad_setting, unknown_name
from nearharmonic.integrators import integrators
from nearharmonic.output import store
from nearharmonic.systems import systems
from nearharmonic.systems.user_file import SystemDefinition
from nearharmonic_paper.record.query.run_table import SKIPPED, runs_of_cube, settings_of, system_cubes
from nearharmonic_paper.tasks.definitions import defined, read_definitions

#: Relative tolerance for a grid of one step size, for values typed with few digits.
LEAST_SPACING = 1e-3


@dataclass(frozen=True, kw_only=True)
class SingleRun:
    """One run, with all its data in a result.

    Attributes
    ----------
    cells : dict
        Its cell of the cube: numbers and texts by name.
    units : dict of str to str
        Units of the numbers.
    system_units : dict of str to str
        Units of t, q, p and the energy of the system; empty for an unknown system.
    settings : dict
        The sweep of the run, from the attributes of the cube.
    definitions : dict
        Users' definitions of the system and of integrators, from the attributes of the cube.
    cube : Path
        File of the cube.
    file : Path or None
        File of the trajectory; None if there is none.
    samples : int or None
        Number of states of the run in this file; None without a file.
    origin : dict of str to str
        Versions and digests from the attributes of the trajectory file, or of the cube if there is no such file.
    """

    cells: dict[str, Any]
    units: dict[str, str]
    system_units: dict[str, str]
    settings: dict[str, Any]
    definitions: dict[str, Any]
    cube: Path
    file: Path | None
    samples: int | None
    origin: dict[str, str]


def single_run(
    folder: Path, system: str, integrator: str, tau: object, *, precision: str | None = None, per_stage: bool = False
) -> SingleRun:
    """Return the run of a result with the step size nearest to the requested one.

    Parameters
    ----------
    folder : Path
        Folder of the result.
    system, integrator : str
        Names in the result, or other names of the integrator.
    tau : float or str
        Step size in the unit of time of the system; with ``per_stage`` the step size per stage.
    precision : str, optional
        Arithmetic of the run; by default double, or the only available one.
    per_stage : bool
        True if ``tau`` is divided by the number of stages.

    Raises
    ------
    UnknownNameError
        The result has no such system or integrator.
    SettingError
        No run of this precision, or none within the spacing of the grid from ``tau``.
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
    attributes = store.attributes_of(cubes[system])
    told = settings_of(cubes[system], attributes)
    file, samples = _trajectory(folder, cells)
    return SingleRun(
        cells={str(name): cell for name, cell in cells.items()},
        units=units,
        system_units=_units(system, told.get("definitions", {})),
        settings=told.get("sweep", {}),
        definitions=told.get("definitions", {}),
        cube=cubes[system],
        file=file,
        samples=samples,
        origin=_origin(attributes if file is None else store.attributes_of(file)),
    )


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


def _origin(attributes: Mapping[str, Any]) -> dict[str, str]:
    return {name: str(value) for name, value in attributes.items() if name.endswith(("_version", "_digest"))}


def python_lines(run: SingleRun) -> list[str]:
    """Return Python code that repeats a run; the printed number is bitwise identical to that of the cube."""
    cells, settings = run.cells, run.settings
    definitions = read_definitions(run.definitions)
    system, before = _system_lines(str(cells["system"]), definitions)
    own = definitions.get("integrators", {}).get(str(cells["integrator"]))
    integrator = _text(cells["integrator"] if own is None else f"{own.file}:{cells['integrator']}")
    given: dict[str, Any] = {name: settings[name] for name in ("t_end", "summation", "samples") if name in settings}
    given |= {
        name: settings[name]
        for name, usual in SharedSettings().shared_settings.items()
        if settings.get(name, usual) != usual
    }
    more = ", ".join(f"{name}={json.dumps(value)}" for name, value in given.items())
    return [
        "import nearharmonic as nh",
        *before,
        "",
        "run = nh.integrate(",
        f"    {system}, {integrator}, tau={cells['tau']!r}, precision={_text(cells['precision'])},",
        *([f"    {more},"] if more else []),
        ")",
        f"print(run.max_energy_error.item())  # {cells['max_energy_error']!r}",
    ]


def _system_lines(name: str, definitions: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the argument for a system in a call, and the lines before the call."""
    told = definitions.get("systems", {}).get(name)
    if told is None:
        return _text(name), []
    if told == SystemDefinition(file=told.file):
        return _text(told.file), []
    lines = [
        "from nearharmonic.systems.user_file import SystemDefinition",
        "",
        f"system = {told!r}.make({_text(name)})",
    ]
    return "system", lines


def _text(value: object) -> str:
    """Return the literal of a text in Python; names in a result may hold quotes."""
    return json.dumps(str(value))


def files_of(run: SingleRun, folder: Path, manifest: Mapping[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield (description, path below the result, entry of the manifest or empty) of the files of a run."""
    for what, path in (("cube", run.cube), ("run file", run.file)):
        if path is not None:
            name = path.relative_to(folder).as_posix()
            yield what, name, manifest.get("files", {}).get(name, {})
