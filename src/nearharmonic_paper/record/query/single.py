"""One run of a result: its numbers, its files, and Python code that repeats it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
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
from nearharmonic_paper.record.files import manifest
from nearharmonic_paper.record.history import makers_in
from nearharmonic_paper.record.query.run_table import SKIPPED, runs_of_cube, settings_of, system_cubes
from nearharmonic_paper.tasks.definitions import defined, read_definitions

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
    """Return Python code that repeats a run; the printed number is bitwise identical to that of the cube."""
    system, before = _system_lines(str(cells["system"]), definitions)
    own = definitions.get("integrators", {}).get(str(cells["integrator"]))
    integrator = _literal(cells["integrator"] if own is None else f"{own.file}:{cells['integrator']}")
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
        f"    {system}, {integrator}, tau={cells['tau']!r}, precision={_literal(cells['precision'])},",
        *([f"    {more},"] if more else []),
        ")",
        f"print(run.max_energy_error.item())  # {cells['max_energy_error']!r}",
    ]


def _system_lines(name: str, definitions: Mapping[str, Any]) -> tuple[str, list[str]]:
    """Return the argument for a system in a call, and the lines before the call."""
    told = definitions.get("systems", {}).get(name)
    if told is None:
        return _literal(name), []
    if told == SystemDefinition(file=told.file):
        return _literal(told.file), []
    imported = "from nearharmonic.systems.user_file import SystemDefinition"
    return "system", [imported, "", f"system = {told!r}.make({_literal(name)})"]


def _literal(value: object) -> str:
    """Return the literal of a text in Python; names in a result may hold quotes."""
    return json.dumps(str(value))


def _files(folder: Path, paths: Mapping[str, Path | None]) -> dict[str, dict[str, Any]]:
    """Return path, entry in the manifest and newest maker of files."""
    recorded = manifest.read(folder)["files"] if (folder / manifest.MANIFEST).exists() else {}
    makers, files = makers_in(folder), {}
    for what, name in [(what, path.relative_to(folder).as_posix()) for what, path in paths.items() if path is not None]:
        maker = {"run": makers[name]} if name in makers else {}
        files[what] = {"path": name, **recorded.get(name, {}), **maker}
    return files
