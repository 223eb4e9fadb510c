"""Adoption of results from another machine as up to date, after a check of all files, the code and the settings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError, SettingError
from nearharmonic.output.store import DEFAULT_CONFIG, usable_configs
from nearharmonic_paper.config.refusal import refuse_template
from nearharmonic_paper.config.text import read_mapping
from nearharmonic_paper.record.files import manifest
from nearharmonic_paper.record.files.trusted import check_files_of
from nearharmonic_paper.record.verify import faults
from nearharmonic_paper.tasks.provenance import settings_digest
from nearharmonic_paper.tasks.receipts import BESIDE, forget

#: Environment variable that tells the workflow to compare its jobs with the manifest before it touches a file.
ADOPTING = "NEARHARMONIC_ADOPTING"


def adopt(folder: Path, configfile: str | None = None) -> int:
    """Mark the results in ``folder``, ``results/<name>`` of this working directory, as up to date.

    Snakemake then considers all files as made by the jobs of this workflow with these settings, and runs no job.

    ``configfile`` is the config of the results; by default the recorded one, or the one in ``config/`` with their name.
    The number of files is returned.

    Raises
    ------
    RefusedError
        The results differ from their manifest, were made with another code or config or in another folder, or Snakemake
        fails; the message gives the reason.
    SettingError
        The config cannot be read, or is a template in which Snakemake would run Python.
    UntrustedFileError
        The results need a user's file that is not trusted. The process of Snakemake runs no such file either.
    """
    if folder.absolute().parent != Path("results").absolute() or not Path("Snakefile").is_file():
        says = "is not in results/ of the folder of the workflow: copy it there, and adopt it from there"
        raise RefusedError(f"{folder} {says}")
    if found := faults(folder):
        more = f" ({len(found)} faults in all: nearharmonic verify {folder})" if len(found) > 1 else ""
        raise RefusedError(f"{folder} is not adopted: {found[0]}{more}")
    recorded = manifest.read(folder)
    names = recorded["files"]
    check_files_of(names.values())
    option = _config_option(folder.name, recorded["configfiles"], configfile)
    for place in option[1:] or [DEFAULT_CONFIG]:
        refuse_template(place)
    command = [sys.executable, "-m", "snakemake", "--touch", "--forceall", "-j1", "--quiet", "rules"]
    files = [f"results/{folder.name}/{name}" for name in names]
    command += [*option, "--", *files]
    done = subprocess.run(command, env={**os.environ, ADOPTING: "1"}, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = re.search(r"(?:RefusedError in .*|MissingRuleException:|WorkflowError in .*)\n(.*)", done.stderr)
        raise RefusedError(f"{folder} is not adopted: {reason[1] if reason else done.stderr.strip()[-1000:]}")
    forget(folder, names)  # receipts of previous results in this folder
    return len(files)


def _config_option(name: str, recorded: Sequence[str], given: str | None) -> list[str]:
    """Return the option of Snakemake for the config that writes to ``results/<name>``; none for the default config."""
    if given is not None:
        return ["--configfile", given]
    found = usable_configs(recorded, Path("results", name))
    if not found or not all(Path(place).is_file() for place in found):
        found = [str(place) for place in sorted(Path("config").glob("*.yaml")) if _name_in(place) == name]
        if len(found) != 1:
            says = f"{' and '.join(found)} have" if found else "no file in config/ has"
            says = f"results/{name} is not adopted: {says} the name {name!r}; name its config: --configfile FILE"
            raise RefusedError(says)
    return [] if found == [DEFAULT_CONFIG] else ["--configfile", *found]


def _name_in(place: Path) -> object:
    """Return the name of the results of a config; None if the file is no config."""
    try:
        return read_mapping(place).get("name")
    except SettingError:
        return None


def check_jobs(folder: Path, jobs: Iterable[Any]) -> None:
    """Compare the jobs of a workflow with the manifest of ``folder``, before their files are touched.

    A job of Snakemake has ``output``, and ``params.task`` or ``params.tasks``. A file that it makes and that was made
    with other settings, code or coefficients is a RefusedError.
    """
    entries = manifest.read(folder)["files"]
    for path, task in (pair for job in jobs for pair in _made_by(job)):
        name = Path(path).relative_to(folder).as_posix()
        entry = entries.get(name)
        here = {"settings": settings_digest(task), "code": task["code"], "coefficients": task["coefficients"]}
        differs = ["file"] if entry is None else [what for what in here if here[what] != entry[what]]
        if differs:
            says = "is not among the results" if entry is None else f"was made with other {' and '.join(differs)}"
            raise RefusedError(f"{path} {says}; a run of the workflow brings it up to date")


def _made_by(job: Any) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield each result that a job makes, and its task."""
    params = dict(job.params.items())
    for name, made in job.output.items():
        task = params["tasks"][name] if "tasks" in params else params.get("task")
        for path in [made] if isinstance(made, str) else made:
            if task is not None and not {*BESIDE} & {*Path(path).parts}:
                yield str(path), task
