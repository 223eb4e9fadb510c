"""Check of a folder of results against its record, and adoption of results from another machine after such a check."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from shlex import quote
from typing import Any, NamedTuple

from nearharmonic.errors import NearharmonicError, RefusedError, ResultFileError, SettingError
from nearharmonic.output.atomic import parts_in
from nearharmonic.output.store import DEFAULT_CONFIG, command_for, foreign_in, usable_configs, workflow_command
from nearharmonic_paper.config import read_mapping
from nearharmonic_paper.record import history, manifest
from nearharmonic_paper.record.manifest import check_files_of, integrator_files_not_run, is_edited, recorded_digests
from nearharmonic_paper.record.workflow_run import lost_line
from nearharmonic_paper.tasks import provenance
from nearharmonic_paper.tasks.experiment import beside_the_paper, experiments

# --- Check of every file, and of the code and coefficients that made it.

EntriesByName = Mapping[str, Mapping[str, Any]]

#: Beginnings of file names, in the order of their production.
ORDER = ("runs/", "cubes/", "derived/", "figures/", "tables/", "report.html")


class Fault(NamedTuple):
    """A deviation from the record: the file in the folder of results, what it is, and what repairs it."""

    file: str
    says: str
    mend: str

    def __str__(self) -> str:
        return f"{self.file} {self.says}. {self.mend}"


def faults(folder: Path) -> list[Fault]:
    """Compare every file of ``folder`` with the record, and the code and coefficients here with those recorded.

    Only the record is parsed; all other files are compared as bytes, so that damaged files cannot mislead or block the
    reader. Of HDF5 files with the recorded bytes the list of members is read, and no value. Faults are in the order of
    their repair: runs, cubes, and derived files.
    """
    try:
        recorded = manifest.read(folder)
    except ResultFileError as error:
        says, _, mend = str(error).partition(". ")
        says = says.removeprefix(f"{folder / manifest.MANIFEST} ")
        return [*_of_record(folder), Fault(manifest.MANIFEST, says, mend)]
    here = [*_of_record(folder), *_of_files(folder, recorded)]
    damaged = {fault.file for fault in here}
    whole = {name: entry for name, entry in recorded["files"].items() if name not in damaged}
    here += [*_of_inputs(folder, whole), *_of_origins(folder, recorded["files"])]
    ranks = {fault: [i for i, part in enumerate(ORDER) if fault.file.startswith(part)] for fault in here}
    return sorted(here, key=lambda fault: (ranks[fault] or [0], fault))


def _of_record(folder: Path) -> Iterator[Fault]:
    """Yield a fault for each line of the history and each receipt that has changed since it was written."""
    again, place = command_for(folder / "report.html"), folder / history.HISTORY
    if os.path.lexists(place) and not place.is_file():
        yield Fault(history.HISTORY, "is not a regular file", "Move it elsewhere")
    lines = history.lines_of(place)
    told = [f"line {line.number} {line.fault}" for line in history.faulty_lines(lines)]
    if lost_line(folder, lines):
        told.append(f"has lost its last line or more; it has {len(lines)}")
    for says in told:
        yield Fault(history.HISTORY, says, f"The next run with jobs records this, for example: {again}")
    for place in provenance.damaged_receipts(folder):
        name, mend = place.relative_to(folder).as_posix(), "The next run replaces or removes it"
        yield Fault(name, "is a damaged receipt", f"{mend}: {workflow_command(place)}")
    for place in parts_in(folder):
        name, mend = place.relative_to(folder).as_posix(), "The next run with jobs removes it, for example"
        yield Fault(name, "is a temporary file of an unfinished job", f"{mend}: {again}")


def _of_files(folder: Path, recorded: Mapping[str, Any]) -> Iterator[Fault]:
    entries, former, there = recorded["files"], set(recorded["former"]), set(manifest.names_in(folder))
    by_now = manifest.entries_of(folder)
    for name in sorted((there | entries.keys()) - (former - there)):
        again = f"Make it again: {command_for(folder / name)}"
        if name in former:
            yield Fault(name, "is of a former config: no job makes it now", "Move it elsewhere")
        elif name not in there:
            yield Fault(name, "is missing", again)
        elif (digest := provenance.measured(folder / name)["sha256"]) != entries.get(name, {}).get("sha256"):
            if digest == by_now.get(name, {}).get("sha256"):
                mend = f"Wait for it, or run the workflow again: {workflow_command(folder / name)}"
                yield Fault(name, "was made by a run that has not ended, or was killed", mend)
            elif name in recorded["unrecorded"]:
                yield Fault(name, "has lost its record", again)
            elif name not in entries:
                yield Fault(name, "is extra: no job made it", "Move it elsewhere")
            else:
                yield Fault(name, "is damaged: its bytes differ from what its job wrote", again)
        elif name.endswith(".h5") and (says := foreign_in(folder / name)):
            yield Fault(name, says, again)


def _of_inputs(folder: Path, entries: EntriesByName) -> Iterator[Fault]:
    """Yield a fault for each file whose inputs differ from ``entries``, for example after an interrupted run."""
    now: dict[str, str] = {}
    for name, entry in entries.items():
        for source, before in entry.get("inputs", {}).items():
            if source in entries and source not in now:
                now[source] = provenance.identity(folder / source)
            if now.get(source, before) != before:
                mend = f"Bring it up to date: {workflow_command(folder / name)} -- {quote(str(folder / name))}"
                yield Fault(name, f"was made from another {source}", mend)
                break


def _of_origins(folder: Path, entries: EntriesByName) -> Iterator[Fault]:
    """Yield a fault for each function whose code, systems or methods have changed since it made some of its files."""
    made_otherwise: dict[tuple[str, str], list[str]] = {}
    difference = cache(partial(_difference, recorded_digests(folder)))
    for name, entry in entries.items():
        reached = tuple(entry["systems"]), tuple(entry["integrators"])
        definitions = json.dumps(entry.get("definitions", {}))
        recorded = {what: entry[what] for what in ("code", "coefficients")}
        if differs := difference(entry["function"], *reached, definitions, **recorded):
            made_otherwise.setdefault((entry["function"], differs), []).append(name)
    for (function, differs), names in made_otherwise.items():
        others = f" (and {len(names) - 1} more)" if len(names) > 1 else ""
        mend = f"Make it again: {workflow_command(folder / names[0])}{_target_of(function)}"
        yield Fault(names[0], f"was made with other {differs}{others}, by {function}", mend)


def _difference(
    files: Mapping[str, str], function: str, problems: tuple[str, ...], methods: tuple[str, ...], definitions: str,
    **recorded: str,
) -> str:  # fmt: skip
    """Describe the deviations from the record; ``definitions`` of systems and integrators are JSON.

    Coefficients from files that are not trusted are compared by the recorded digests of these ``files``.
    """
    told = json.loads(definitions)
    try:
        not_run = integrator_files_not_run([{"definitions": told}])
        with provenance.defined(provenance.read_definitions(told)):
            here = provenance.digests(function, problems, () if not_run else methods)
        if not_run:
            here["coefficients"] = "" if any(is_edited(file, files) for file in not_run) else recorded["coefficients"]
    except NearharmonicError as error:
        return f"code, part of which is missing here ({error})"
    return " and ".join(what for what in recorded if here[what] != recorded[what])


def _target_of(function: str) -> str:
    """Return the target of the files of ``function``, as the end of a command; empty for the default target."""
    experiment = next((experiments()[part] for part in function.split(".") if part in experiments()), None)
    return f" -- {experiment.target}" if experiment in beside_the_paper() else ""


def extent(folder: Path) -> tuple[int, int, list[str], int]:
    """Return what the manifest and the history of ``folder``, which has no fault, tell of its files.

    These are the number of its files and their size in bytes; the sorted files with users' integrators whose
    coefficients :func:`faults` does not compute; and the number of files from runs with a different config than
    the newest successful run, which may be up to date: the section of one system does not affect other systems.
    """
    entries = manifest.read(folder)["files"]
    configs = {run["id"]: run.get("config_digest") for run in history.runs_of(folder)}
    newest, makers = history.newest_finished(folder) or {}, history.makers_in(folder)
    made = [configs.get(makers.get(name, entry.get("run"))) for name, entry in entries.items()]
    others = sum(config != newest.get("config_digest") for config in made) if newest else 0
    size = sum(entry["size"] for entry in entries.values())
    return len(entries), size, integrator_files_not_run(entries.values()), others


# --- Adoption as up to date, after a check of all files, the code and the settings.

#: Environment variable that tells the workflow to compare its tasks with the manifest before it touches a file.
ADOPTING = "NEARHARMONIC_ADOPTING"


def adopt(folder: Path, configfile: str | None = None) -> int:
    """Mark the results in ``folder``, ``results/<name>`` of this working directory, as up to date.

    Snakemake then considers all files as made by the jobs of this workflow with these settings, and runs no job.

    ``configfile`` is the config of the results; by default the recorded one, or the one in ``config/`` with their name.
    The number of files is returned.
    """
    if folder.absolute().parent != Path("results").absolute() or not Path("Snakefile").is_file():
        says = "is not in results/ of the folder of the workflow: copy it there, and adopt it from there"
        raise RefusedError(f"{folder} {says}")
    if here := faults(folder):
        more = f" ({len(here)} faults in all: nearharmonic verify {folder})" if len(here) > 1 else ""
        raise RefusedError(f"{folder} is not adopted: {here[0]}{more}")
    recorded = manifest.read(folder)
    names = recorded["files"]
    check_files_of(names.values())
    option = _config_option(folder.name, recorded["configfiles"], configfile)
    for place in option[1:] or [DEFAULT_CONFIG]:
        read_mapping(place)
    command = [sys.executable, "-m", "snakemake", "--touch", "--forceall", "-j1", "--quiet", "rules"]
    files = [f"results/{folder.name}/{name}" for name in names]
    command += [*option, "--", *files]
    done = subprocess.run(command, env={**os.environ, ADOPTING: "1"}, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = re.search(r"(?:RefusedError in .*|MissingRuleException:|WorkflowError in .*)\n(.*)", done.stderr)
        raise RefusedError(f"{folder} is not adopted: {reason[1] if reason else done.stderr.strip()[-1000:]}")
    provenance.forget(folder, names)  # receipts of previous results in this folder
    return len(files)


def _config_option(name: str, recorded: Sequence[str], given: str | None) -> list[str]:
    """Return the option of Snakemake for the config that writes to ``results/<name>``; none for the default config."""
    if given is not None:
        return ["--configfile", given]
    places = usable_configs(recorded, Path("results", name))
    if not places or not all(Path(place).is_file() for place in places):
        places = [str(place) for place in sorted(Path("config").glob("*.yaml")) if _name_in(place) == name]
        if len(places) != 1:
            says = f"{' and '.join(places)} have" if places else "no file in config/ has"
            says = f"results/{name} is not adopted: {says} the name {name!r}; name its config: --configfile FILE"
            raise RefusedError(says)
    return [] if places == [DEFAULT_CONFIG] else ["--configfile", *places]


def _name_in(place: Path) -> object:
    """Return the name of the results of a config; None if the file is no config."""
    try:
        return read_mapping(place).get("name")
    except SettingError:
        return None


def noting(describe: Callable[..., dict[str, Any]]) -> tuple[Callable[..., dict[str, Any]], list[dict[str, Any]]]:
    """Return a function that describes tasks as ``describe`` does, and the list that it adds each of them to."""
    noted: list[dict[str, Any]] = []

    def described(function: str, **settings: Any) -> dict[str, Any]:
        noted.append(describe(function, **settings))
        return noted[-1]

    return described, noted


def check_tasks(folder: Path, tasks: Iterable[Mapping[str, Any]]) -> None:
    """Compare the manifest of ``folder`` with the tasks of the workflow, before files are touched.

    Snakemake has described the tasks of all requested files by then.
    """
    keys = ("settings", "code", "coefficients")
    here = {(task["function"], provenance.settings_digest(task), task["code"], task["coefficients"]) for task in tasks}
    for name, entry in manifest.read(folder)["files"].items():
        if (entry["function"], *(entry[key] for key in keys)) in here:
            continue
        alike = [digests for function, *digests in here if function == entry["function"]]
        differs = [key for i, key in enumerate(keys) if all(told[i] != entry[key] for told in alike)] or ["settings"]
        message = f"{folder / name} was made with other {' and '.join(differs)}"
        raise RefusedError(f"{message}; a run of the workflow brings it up to date")
