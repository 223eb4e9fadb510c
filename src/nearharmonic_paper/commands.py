"""Subcommands for results and their record; see :mod:`nearharmonic.commands`. Slow imports are inside of functions."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from math import isnan
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

from nearharmonic.commands import Command
from nearharmonic.output.table import Answer, printable

if TYPE_CHECKING:
    from nearharmonic_paper.record.compare import Difference

Argument = tuple[tuple[str, ...], Mapping[str, Any]]


def argument(*names: str, **options: Any) -> Argument:
    """Return an argument of a command, by the parameters of ``ArgumentParser.add_argument``."""
    return names, options


def adding(*declared: Argument) -> Callable[[argparse.ArgumentParser], None]:
    """Return the function that adds these arguments to a parser."""

    def add(parser: argparse.ArgumentParser) -> None:
        for names, options in declared:
            parser.add_argument(*names, **options)

    return add


RESULT = "folder of a result, or its name below results/"
TRUST = argument(
    "--trust",
    metavar="FILE",
    action="append",
    default=[],
    help="a Python file of the config that may be run, if its code is the recorded one; repeatable",
)

# --- Check of results against their record, and what needs results without a fault: adoption and archives.


def _verify(chosen: argparse.Namespace) -> Answer:
    """Return a row for each fault; the status is 0 if there is none."""
    if chosen.result.endswith(".zip"):
        return _verify_archive(Path(chosen.result))
    from nearharmonic.engine.settings import whole_number
    from nearharmonic.output.store import command_for
    from nearharmonic_paper.record.manifest import check_trusted, folder_of
    from nearharmonic_paper.record.query import rerun
    from nearharmonic_paper.record.verify import extent, faults

    number, seed = whole_number(chosen.rerun, "rerun"), whole_number(chosen.seed, "seed")
    folder = folder_of(chosen.result)
    check_trusted(folder, chosen.trust)
    found = [{"file": f.file, "fault": f.says, "mend": f.mend} for f in faults(folder)]
    notes = []
    if not found:
        files, size, not_run, others = extent(folder)
        notes = [f"{_counted(files, 'file')}, {size} bytes: each as its job wrote it, by this code"]
        if not_run:
            says = "are taken from their recorded code; to compute them: verify"
            trusting = " ".join(f"--trust {quote(file)}" for file in not_run)
            notes.append(f"coefficients of {', '.join(not_run)} {says} {trusting}")
        if others:
            notes.append(f"{_counted(others, 'file')} of runs with another config than the newest run")
    if number and found:
        notes.append("no run was integrated again, since there are faults")
    elif number:
        runs = rerun(folder, number, seed)
        for run in (run for run in runs if run.differs):
            says = f"{run.precision} run at tau_per_stage = {run.tau_per_stage:g} has other {', '.join(run.differs)}"
            mend = f"Make it again: {command_for(folder / run.file)}"
            found.append({"file": run.file, "fault": says, "mend": mend})
        notes.append(f"{len(runs)} runs integrated again: {len(runs) - len(found)} are bitwise identical")
    return _faults(str(folder), found, notes)


def _verify_archive(path: Path) -> Answer:
    from nearharmonic_paper.record.archive import faults_of_archive

    found = [{"file": "", "fault": says, "mend": ""} for says in faults_of_archive(path)]
    return _faults(str(path), found, [] if found else ["every file in the archive is unchanged since it was written"])


def _faults(result: str, found: list[dict[str, Any]], notes: list[str]) -> Answer:
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


def _adopt(chosen: argparse.Namespace) -> Answer:
    """Return the number of adopted files; the status is 1 if the results are refused."""
    from nearharmonic.errors import RefusedError
    from nearharmonic_paper.record.manifest import check_trusted, folder_of
    from nearharmonic_paper.record.verify import adopt

    folder = folder_of(chosen.result)
    check_trusted(folder, chosen.trust)
    try:
        number, reason = adopt(folder, chosen.configfile), ""
    except RefusedError as refusal:
        number, reason = 0, str(refusal)
        sys.stderr.write(printable(f"nearharmonic: {refusal}\n"))
    return Answer(
        header=["result", "files", "reason"],
        rows=[] if reason else [[str(folder), number, ""]],
        document={"result": str(folder), "adopted": not reason, "files": number, "reason": reason},
        status=1 if reason else 0,
    )


def _archive(chosen: argparse.Namespace) -> Answer:
    """Return path and size of the archive; the status is 1, with the reasons, if the result cannot be archived."""
    from nearharmonic_paper.record import archive
    from nearharmonic_paper.record.manifest import folder_of

    folder = folder_of(chosen.result)
    place = archive.target(folder, chosen.output)
    reasons = archive.reasons_against(folder)
    if reasons:
        return Answer(header=["fault"], rows=[[reason] for reason in reasons], status=1)
    saved = archive.save(folder, place, with_runs=chosen.with_runs)
    return Answer(header=["archive", "bytes"], rows=[[str(saved), saved.stat().st_size]])


# --- Runs of the workflow, and the workflow in a folder of one's own.

#: Number of digits that identify a commit in a repository of this size.
COMMIT = 10
#: Files of the workflow, by patterns from its root, which has all of them.
PARTS = ("Snakefile", "workflow/**/*", "config/*", "profiles/**/*")


def _history(chosen: argparse.Namespace) -> Answer:
    """Return a row for each run, or one for each field of the run that ``--full`` names."""
    from nearharmonic_paper.record.history import flattened, run_named, runs_newest_first
    from nearharmonic_paper.record.manifest import RESULTS, folder_of, result_names

    every = chosen.result is None
    folders = [RESULTS / name for name in result_names()] if every else [folder_of(chosen.result)]
    runs = runs_newest_first(folders)
    if chosen.full is not None:
        run = run_named(chosen.full, [run for _, run in runs])
        return Answer(header=("field", "value"), rows=list(flattened(run)), document=run)
    header = ("when", "id", "commit", "dirty", "targets", "duration", "status")
    rows = [(folder.name, *_row_of_run(run)) if every else _row_of_run(run) for folder, run in runs]
    places = ", ".join(map(str, folders)) or "any folder below results/"
    notes = ["when: start in UTC; duration in s"] if rows else [f"no run is recorded in {places}"]
    return Answer(header=("result", *header) if every else header, rows=rows, notes=notes)


def _row_of_run(run: Mapping[str, Any]) -> tuple[Any, ...]:
    when = str(run.get("start", "")).partition(".")[0].replace("T", " ").removesuffix("Z")
    commit, targets = (run.get("commit") or "")[:COMMIT] or None, " ".join(run.get("targets") or ())
    return when, run.get("id"), commit, run.get("dirty"), targets, run.get("duration"), run.get("status")


def _reproduce(chosen: argparse.Namespace) -> Answer:
    """Run Snakemake in the working directory; the exit status is 1 if a job failed, 2 for bad input."""
    import subprocess

    from nearharmonic.engine.settings import whole_number
    from nearharmonic.errors import bad_setting
    from nearharmonic_paper.config import read_mapping
    from nearharmonic_paper.record.description import workflow_root

    jobs = whole_number(chosen.jobs, "-j")
    if jobs < 1:
        raise bad_setting("-j", chosen.jobs, "an integer of at least 1")
    if chosen.config is not None and not any((root / chosen.config).is_file() for root in (Path(), workflow_root())):
        raise bad_setting("config", chosen.config, "a file that exists, or one of the workflow: config/smoke.yaml")
    put_into(Path())
    if chosen.config is not None:  # Snakemake would run the Python of a template
        read_mapping(chosen.config)
    config = [] if chosen.config is None else ["--configfile", chosen.config]
    # Targets stand behind --, as --configfile would take them for further configs.
    words = [sys.executable, "-m", "snakemake", f"-j{jobs}", *config, "--", *chosen.targets]
    status = subprocess.run(words, check=False).returncode
    return Answer(header=(), rows=(), document={"status": status}, status=status if status in (0, 2) else 1, text="")


def put_into(folder: Path) -> None:
    """Copy the files of the workflow that ``folder`` lacks; files that it has stay as they are."""
    from nearharmonic.errors import bad_setting
    from nearharmonic.output.atomic import write_bytes
    from nearharmonic_paper.record.description import workflow_root

    root = workflow_root()
    there = folder / "Snakefile"
    if there.exists() and there.read_bytes() != (root / "Snakefile").read_bytes():
        what = "an empty folder, or one with the workflow of this version: this Snakefile is another one"
        raise bad_setting("folder", str(folder.absolute()), what)
    for path in (path for pattern in PARTS for path in sorted(root.glob(pattern))):
        place = folder / path.relative_to(root)
        if path.is_file() and "__pycache__" not in path.parts and not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(place, path.read_bytes())


# --- Single runs: a table of them, and one with code that repeats it.


def _runs(chosen: argparse.Namespace) -> Answer:
    """Return a row for each run that fulfils the condition."""
    from nearharmonic.engine.settings import whole_number
    from nearharmonic_paper.record.manifest import folder_of
    from nearharmonic_paper.record.query import column_of, former_systems, rows_where, run_table

    limit = None if chosen.limit is None else whole_number(chosen.limit, "limit")
    folders = {name: folder_of(name) for name in chosen.result}
    every, units = run_table(folders)
    names = list(every) if chosen.columns is None else [name.strip() for name in chosen.columns.split(",")]
    for name in names:
        column_of(name, every)
    found = every if chosen.where is None else every[rows_where(chosen.where, every)]
    if chosen.sort is not None:
        key = column_of(chosen.sort.removeprefix("-"), found)
        found = found.sort_values(str(key.name), ascending=key.name == chosen.sort, kind="stable")
    shown = found[:limit]
    cut = "" if len(shown) == len(found) else f", {len(shown)} shown"
    notes = [f"{len(found)} of {len(every)} runs{cut}"]
    for system in sorted(set(shown["system"])):
        told = [f"{name} in {units[system][name]}" for name in names if name in units[system]]
        notes += [f"{system}: {', '.join(told)}"] if told else []
    for name, folder in folders.items():
        if left := ", ".join(former_systems(folder)):
            notes.append(f"Left out: {left}, which the config of {name} no longer has")
    return Answer(header=names, rows=list(zip(*(shown[name].tolist() for name in names), strict=True)), notes=notes)


#: Relative difference of the requested and the found step size above which the answer mentions it: six typed digits.
WORTH_SAYING = 1e-5


def _show(chosen: argparse.Namespace) -> Answer:
    """Return a row for each fact, followed by lines of Python."""
    from nearharmonic_paper.record.manifest import folder_of
    from nearharmonic_paper.record.query import single_run

    folder = folder_of(chosen.result)
    found, definitions = single_run(
        folder, chosen.system, chosen.integrator, chosen.tau, precision=chosen.precision, per_stage=chosen.per_stage
    )
    asked, name = float(chosen.tau), "tau_per_stage" if chosen.per_stage else "tau"
    step, unit = found["run"][name], found["units"].get(name, "")
    nearest = f"The run nearest to {name} = {asked:.6g} has {name} = {step:.6g} {unit}".rstrip()
    return Answer(
        header=("field", "value", "unit"),
        rows=_facts(found),
        document=found,
        caption="" if abs(step - asked) <= WORTH_SAYING * asked else nearest,
        notes=[*_remarks(folder, found, definitions), "", *found["python"].split("\n")],
        digits=None,
    )


def _facts(found: dict[str, Any]) -> list[tuple[str, Any, str | None]]:
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


def _remarks(folder: Path, found: dict[str, Any], definitions: dict[str, Any]) -> Iterator[str]:
    from nearharmonic_paper.record.history import doubts_in

    if "run file" not in found["files"]:
        yield "The results have no run file with this trajectory."
    file = definitions.get("systems", {}).get(found["run"]["system"], {}).get("file")
    if file is not None and not found["system_units"]:
        yield f"The units of the system are in {file}, whose code this command does not run."
    yield from doubts_in(folder)
    if not (folder / "manifest.json").exists():
        yield f"{folder} has no manifest.json, which would give the digests of its files."


# --- Differences between two results.


def _compare(chosen: argparse.Namespace) -> Answer:
    """Return a row for each difference; the status is 1 if there is one."""
    from nearharmonic_paper.record.compare import compared, same_numbers, save_overlay
    from nearharmonic_paper.record.history import doubts_in
    from nearharmonic_paper.record.manifest import folder_of

    a, b = folder_of(chosen.a), folder_of(chosen.b)
    figure = None
    if chosen.figure is not None:
        second = chosen.b if chosen.b != chosen.a else f"{chosen.b} (again)"  # names in a legend differ
        figure = str(save_overlay({chosen.a: a, second: b}, chosen.figure))
    differences, left_out = compared(a, b)
    same = same_numbers(differences)
    notes = [f"not compared, because they are measured times: {'; '.join(left_out)}"] if left_out else []
    return Answer(
        header=("kind", "where", "a", "b", "unit", "relative", "at", "differ", "of"),
        rows=[_row_of_difference(difference) for difference in differences],
        document={
            "a": str(a),
            "b": str(b),
            "identical": not differences,
            "same_numbers": same,
            "differences": [asdict(difference) for difference in differences],
            "left_out": left_out,
            "figure": figure,
        },
        status=1 if differences else 0,
        caption=f"a = {a}, b = {b}: {_summary(differences, same)}",
        notes=[*notes, *doubts_in(a), *doubts_in(b)],
    )


def _summary(differences: list[Difference], same: bool) -> str:
    """Return the number of differences of each kind, and the largest relative one, in words."""
    if not differences:
        return "identical"
    kinds = Counter(difference.kind for difference in differences)
    told = f"{kinds.total()} differences ({', '.join(f'{number} {kind}' for kind, number in kinds.most_common())})"
    numbers = [one for one in differences if one.relative is not None]
    if numbers:
        largest = max(numbers, key=lambda one: one.relative or 0.0)
        told += f"; largest relative difference {largest.relative:.2g}, {largest.where}"
    return f"identical numbers; {told} in what made them" if same else told


def _row_of_difference(difference: Difference) -> tuple[Any, ...]:
    """Return the cells of a difference; NaN is text, because a table shows NaN as a dash."""
    from nearharmonic_paper.record.compare import short

    told, units = difference, difference.at_units
    at = ", ".join(f"{name} {short(value)} {units.get(name, '')}".rstrip() for name, value in told.at.items())
    a, b = ("nan" if isinstance(value, float) and isnan(value) else value for value in (told.a, told.b))
    return told.kind, told.where, a, b, told.unit, told.relative, at, told.differ, told.compared


COMMANDS = {
    "adopt": Command(
        "take results that were copied here as up to date, after they were verified",
        adding(
            argument("result", help="a folder of results in results/, or its name"),
            argument("--configfile", metavar="FILE", help="its config (default: the one that it was made with)"),
            TRUST,
        ),
        _adopt,
    ),
    "archive": Command(
        "write a result to one zip file, an RO-Crate with the digests and the runs",
        adding(
            argument("result", help=RESULT),
            argument("-o", "--output", metavar="FILE.zip", help="file to write (default NAME.zip)"),
            argument("--with-runs", action="store_true", help="include the trajectories"),
        ),
        _archive,
    ),
    "compare": Command(
        "compare two results: claims, settings, code, and every number",
        adding(
            argument("a", help=RESULT),
            argument("b", help="the other result"),
            argument("--figure", metavar="FILE", help="draw the energy errors of both: a .png, .svg or .pdf file"),
        ),
        _compare,
    ),
    "history": Command(
        "list the runs of the workflow, newest first",
        adding(
            argument("result", nargs="?", help=f"{RESULT}; all if not given"),
            argument(
                "--full",
                nargs="?",
                const="",
                metavar="ID",
                help="full record of the newest run, or of the run with this id",
            ),
        ),
        _history,
    ),
    "reproduce": Command(
        "put the workflow into this folder, if it is not there, and run it",
        adding(
            argument("targets", nargs="*", metavar="TARGET", help="targets of the workflow (default all)"),
            argument("--config", metavar="FILE", help="a config in place of the paper's, config/config.yaml"),
            argument("-j", dest="jobs", default="2", metavar="N", help="jobs at a time (default 2)"),
        ),
        _reproduce,
    ),
    "runs": Command(
        "list single runs with step, errors and status, selected and sorted",
        adding(
            argument("result", nargs="+", help=RESULT),
            argument(
                "--where",
                metavar="EXPR",
                help="a condition on columns, such as \"max_energy_error < 1e-9 and status == 'ok'\"",
            ),
            argument("--sort", metavar="KEY", help="a column; with a minus before it, from the largest"),
            argument("--limit", metavar="N", help="largest number of rows"),
            argument("--columns", metavar="A,B,...", help="columns to show; all if not given"),
        ),
        _runs,
    ),
    "show": Command(
        "show all that is known of one run, and how to make it again",
        adding(
            argument("result", help=RESULT),
            argument("system", help="name of a system"),
            argument("integrator", help="name of an integrator"),
            argument("tau", help="step size in the system's unit of time; the nearest run is shown"),
            argument("--per-stage", action="store_true", help="the step size is per stage, tau/s"),
            argument("--precision", help="double or extended (default double, or the only one that there is)"),
        ),
        _show,
    ),
    "verify": Command(
        "check every file of a result or an archive against its record, and the code with the recorded code",
        adding(
            argument("result", help="a folder of results, its name below results/, or an archive (.zip)"),
            argument("--rerun", metavar="N", default="0", help="integrate N runs again and compare every bit"),
            argument("--seed", metavar="N", default="1", help="seed that selects these runs (default 1)"),
            TRUST,
        ),
        _verify,
    ),
}
