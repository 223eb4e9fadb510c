"""Adoption of results from another machine as up to date, after a check of all files, the code and the settings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from nearharmonic.errors import RefusedError, SettingError
from nearharmonic.output.store import DEFAULT_CONFIG, usable_configs
from nearharmonic_paper.config.files import read_mapping
from nearharmonic_paper.record import manifest
from nearharmonic_paper.record.manifest import check_files_of
from nearharmonic_paper.record.verify import faults
from nearharmonic_paper.tasks.provenance import settings_digest
from nearharmonic_paper.tasks.receipts import forget

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
    if found := faults(folder):
        more = f" ({len(found)} faults in all: nearharmonic verify {folder})" if len(found) > 1 else ""
        raise RefusedError(f"{folder} is not adopted: {found[0]}{more}")
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
    here = {(one["function"], settings_digest(one), one["code"], one["coefficients"]) for one in tasks}
    for name, entry in manifest.read(folder)["files"].items():
        if (entry["function"], *(entry[key] for key in keys)) in here:
            continue
        alike = [one[1:] for one in here if one[0] == entry["function"]]
        differs = [key for i, key in enumerate(keys) if all(one[i] != entry[key] for one in alike)] or ["settings"]
        message = f"{folder / name} was made with other {' and '.join(differs)}"
        raise RefusedError(f"{message}; a run of the workflow brings it up to date")
