"""``nearharmonic show``: details of one run, and code that repeats it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from nearharmonic.output.table import Answer

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
    from nearharmonic_paper.record.manifest import folder_of
    from nearharmonic_paper.record.query import single_run

    folder = folder_of(chosen.result)
    found, definitions = single_run(
        folder, chosen.system, chosen.integrator, chosen.tau, precision=chosen.precision, per_stage=chosen.per_stage
    )
    return Answer(
        header=("field", "value", "unit"),
        rows=_rows(found),
        document=found,
        caption=_title(found, float(chosen.tau), per_stage=chosen.per_stage),
        notes=[*_remarks(folder, found, definitions), "", *found["python"].split("\n")],
        digits=None,
    )


def _rows(found: dict[str, Any]) -> list[tuple[str, Any, str | None]]:
    from nearharmonic_paper.record.history import flattened

    units = found["units"]
    rows: list[tuple[str, Any, str | None]] = [(name, cell, units.get(name)) for name, cell in found["run"].items()]
    rows += [(f"unit of {quantity}", unit, None) for quantity, unit in found["system_units"].items()]
    times = dict.fromkeys(("t_end", "lowest", "highest"), units.get("tau"))
    rows += [(f"setting {key}", cell, times.get(key)) for key, cell in flattened(found["settings"])]
    rows.append(("samples kept", found["samples_kept"], None))
    for what, entry in found["files"].items():
        rows += [(what if key == "path" else f"{what}: {key}", cell, None) for key, cell in flattened(entry)]
    return [*rows, *((name, text, None) for name, text in found["origin"].items())]


def _title(found: dict[str, Any], asked: float, *, per_stage: bool) -> str:
    name = "tau_per_stage" if per_stage else "tau"
    step, unit = found["run"][name], found["units"].get(name, "")
    if abs(step - asked) <= WORTH_SAYING * asked:
        return ""
    return f"The run nearest to {name} = {asked:.6g} has {name} = {step:.6g} {unit}".rstrip()


def _remarks(folder: Path, found: dict[str, Any], definitions: dict[str, Any]) -> list[str]:
    from nearharmonic_paper.record.history import doubts_in

    remarks = []
    if "run file" not in found["files"]:
        remarks.append("The trajectory is not among the results: there is no run file that holds it.")
    file = definitions.get("systems", {}).get(found["run"]["system"], {}).get("file")
    if file is not None and not found["system_units"]:
        remarks.append(f"The units of the system are those in {file}, Python code that this command does not run.")
    remarks += doubts_in(folder)
    if not (folder / "manifest.json").exists():
        remarks.append(f"{folder} has no manifest.json, which would give the digests of its files.")
    return remarks
