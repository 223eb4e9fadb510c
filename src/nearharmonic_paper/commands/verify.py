"""``nearharmonic verify``: check of results against their record."""

from __future__ import annotations

import argparse
from pathlib import Path
from shlex import quote
from typing import Any

from nearharmonic.output.answers import Answer

HELP = "check every file of a result, or of an archive, against its record, and this code against the recorded"

#: Description of the option --trust.
TRUST = "a Python file of the config that may be run, if its code is the recorded one; repeatable"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to ``parser``."""
    parser.add_argument("result", help="a folder of results, its name below results/, or an archive (.zip)")
    parser.add_argument("--rerun", metavar="N", default="0", help="integrate N runs again and compare every bit")
    parser.add_argument("--seed", metavar="N", default="1", help="which runs are drawn (default 1)")
    parser.add_argument("--trust", metavar="FILE", action="append", default=[], help=TRUST)


def answer(chosen: argparse.Namespace) -> Answer:
    """Return a row for each fault; the status is 0 if there is none."""
    if chosen.result.endswith(".zip"):
        return _of_archive(Path(chosen.result))
    from nearharmonic.engine.settings import whole_number
    from nearharmonic_paper.record.manifest import check_trusted, folder_of
    from nearharmonic_paper.record.verify import extent, faults, files_not_run, of_other_configs

    number, seed = whole_number(chosen.rerun, "rerun"), whole_number(chosen.seed, "seed")
    folder = folder_of(chosen.result)
    check_trusted(folder, chosen.trust)
    found = [{"file": f.file, "fault": f.says, "mend": f.mend} for f in faults(folder)]
    notes = []
    if not found:
        files, size = extent(folder)
        notes = [f"{_counted(files, 'file')}, {size} bytes: each as its job wrote it, by this code"]
        if not_run := files_not_run(folder):
            says = "are those of their recorded code; to compute them: verify"
            notes.append(
                f"coefficients of {', '.join(not_run)} {says} {' '.join(f'--trust {quote(f)}' for f in not_run)}"
            )
        others = of_other_configs(folder)
        if others:
            notes.append(f"{_counted(others, 'file')} of runs whose config was not that of the newest run")
    if number and found:
        notes.append("no run was integrated again, since there are faults")
    elif number:
        found, says = _run_again(folder, number, seed)
        notes.append(says)
    return _answer(str(folder), found, notes)


def _run_again(folder: Path, number: int, seed: int) -> tuple[list[dict[str, Any]], str]:
    from nearharmonic.output.store import command_for
    from nearharmonic_paper.record.query import rerun

    runs = rerun(folder, number, seed)
    found = [
        {
            "file": run.file,
            "fault": f"{run.precision} run at tau_per_stage = {run.tau_per_stage:g} has other {', '.join(run.differs)}",
            "mend": f"Make it again: {command_for(folder / run.file)}",
        }
        for run in runs
        if run.differs
    ]
    return found, f"{len(runs)} runs integrated again: {len(runs) - len(found)} have the same bits"


def _of_archive(path: Path) -> Answer:
    from nearharmonic_paper.record.archive import faults_of_archive

    found = [{"file": "", "fault": says, "mend": ""} for says in faults_of_archive(path)]
    return _answer(str(path), found, [] if found else ["each file in the archive is as it was written"])


def _answer(result: str, found: list[dict[str, Any]], notes: list[str]) -> Answer:
    return Answer(
        header=["file", "fault", "mend"],
        rows=[list(fault.values()) for fault in found],
        document={"result": result, "faults": found, "notes": notes},
        status=1 if found else 0,
        caption=f"{result}: {_counted(len(found), 'fault')}",
        notes=notes,
    )


def _counted(number: int, what: str) -> str:
    """Return a number with its noun."""
    return f"{number or 'no'} {what}{'s' if number > 1 else ''}"
