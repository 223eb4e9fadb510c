"""``nearharmonic show``: details of one run, and code that repeats it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from nearharmonic.output.answers import Answer

if TYPE_CHECKING:
    from nearharmonic_paper.record.query.single import SingleRun

HELP = "show all that is known of one run, and how to make it again"
#: Relative difference of the requested and the found step size above which the answer mentions it: six typed digits.
WORTH_SAYING = 1e-5


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", help="folder of a result, or its name below results/")
    parser.add_argument("system", help="name of a system")
    parser.add_argument("integrator", help="name of an integrator")
    parser.add_argument("tau", help="step size in the system's unit of time; the nearest run is shown")
    parser.add_argument("--per-stage", action="store_true", help="the step size is that per stage, tau/s")
    parser.add_argument("--precision", help="double or extended (default double, or the only one that there is)")


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each fact, followed by lines of Python."""
    from nearharmonic_paper.record.files import manifest
    from nearharmonic_paper.record.files.folders import folder_of
    from nearharmonic_paper.record.history import makers_in
    from nearharmonic_paper.record.query.single import files_of, python_lines, single_run

    folder = folder_of(chosen.result)
    run = single_run(
        folder, chosen.system, chosen.integrator, chosen.tau, precision=chosen.precision, per_stage=chosen.per_stage
    )
    told = manifest.read(folder) if (folder / "manifest.json").exists() else {}
    makers = makers_in(folder)
    files = {
        what: {"path": name, **entry, **({"run": makers[name]} if name in makers else {})}
        for what, name, entry in files_of(run, folder, told)
    }
    lines = python_lines(run)
    document = {
        "result": str(folder),
        "run": run.cells,
        "units": run.units,
        "system_units": run.system_units,
        "settings": run.settings,
        "samples_kept": run.samples,
        "files": files,
        "origin": run.origin,
        "python": "\n".join(lines),
    }
    return Answer(
        header=("field", "value", "unit"),
        rows=_rows(run, files),
        document=document,
        caption=_title(run, float(chosen.tau), per_stage=chosen.per_stage),
        notes=[*_remarks(run, folder, told), "", *lines],
        digits=None,
    )


def _rows(run: SingleRun, files: dict[str, dict[str, Any]]) -> list[tuple[str, Any, str | None]]:
    from nearharmonic_paper.record.history import flattened

    rows: list[tuple[str, Any, str | None]] = [(name, cell, run.units.get(name)) for name, cell in run.cells.items()]
    rows += [(f"unit of {quantity}", unit, None) for quantity, unit in run.system_units.items()]
    times = dict.fromkeys(("t_end", "lowest", "highest"), run.units.get("tau"))
    rows += [(f"setting {key}", cell, times.get(key)) for key, cell in flattened(run.settings)]
    rows.append(("samples kept", run.samples, None))
    for what, entry in files.items():
        rows += [(what if key == "path" else f"{what}: {key}", cell, None) for key, cell in flattened(entry)]
    return [*rows, *((name, text, None) for name, text in run.origin.items())]


def _title(run: SingleRun, asked: float, *, per_stage: bool) -> str:
    name = "tau_per_stage" if per_stage else "tau"
    found, unit = run.cells[name], run.units.get(name, "")
    if abs(found - asked) <= WORTH_SAYING * asked:
        return ""
    return f"The run nearest to {name} = {asked:.6g} has {name} = {found:.6g} {unit}".rstrip()


def _remarks(run: SingleRun, folder: Path, manifest: dict[str, Any]) -> list[str]:
    from nearharmonic_paper.record.history import doubts_in

    remarks = []
    if run.file is None:
        remarks.append("The trajectory is not among the results: there is no run file that holds it.")
    file = run.definitions.get("systems", {}).get(run.cells["system"], {}).get("file")
    if file is not None and not run.system_units:
        remarks.append(f"The units of the system are those in {file}, Python code that this command does not run.")
    remarks += doubts_in(folder)
    if not manifest:
        remarks.append(f"{folder} has no manifest.json, which would give the digests of its files.")
    return remarks
