"""Receipts: what each job of a workflow wrote, beside its log; the manifest is put together from them.

A receipt holds the size and the SHA-256 of each file as the job left it, so that a file that changes later on is told
from one that was made again. It is no result: clocks may stand in it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from hashlib import file_digest
from pathlib import Path
from typing import Any, TypeVar

from nearharmonic.output.atomic import write_text
from nearharmonic.output.provenance import settings_digest

Measuring = TypeVar("Measuring", bound=Callable[..., Any])

#: Environment variable with the id of the workflow run that a job belongs to.
RUN = "NEARHARMONIC_RUN"
#: Stands among volatile columns for a whole file.
WHOLE = "*"


def measures_time(function: Measuring) -> Measuring:
    """Declare that all files made from what ``function`` returns hold measured times: they differ from run to run."""
    function.measures_time = True  # type: ignore[attr-defined]
    return function


class Receipt:
    """What one job wrote.

    Parameters
    ----------
    log : path
        Log file of the job, somewhere in ``results/<name>/logs``; the receipt stands beside it.
    """

    def __init__(self, log: str | os.PathLike[str]) -> None:
        self._place = Path(log).with_suffix(".json")
        self._folder = folder_of(log)
        self._files: dict[str, dict[str, Any]] = {}

    def add(
        self, places: Sequence[str], task: Mapping[str, Any], *, volatile: Sequence[str] = (), evaluations: int = 0
    ) -> None:
        """Take note of files that a task has written.

        Parameters
        ----------
        places : sequence of str
            The files.
        task : mapping
            The task, as :func:`nearharmonic.output.provenance.task` describes it.
        volatile : sequence of str
            Names of columns or variables that hold measured times; :data:`WHOLE` for all.
        evaluations : int
            Force evaluations that the files took to make.
        """
        for place in places:
            self._files[Path(os.path.relpath(place, self._folder)).as_posix()] = {
                **measured(place),
                "modified": Path(place).stat().st_mtime_ns,
                "function": task["function"],
                "code": task["code"],
                "coefficients": task["coefficients"],
                "settings": settings_digest(task),
                "systems": list(task["systems"]),
                "integrators": list(task["integrators"]),
                "volatile": list(volatile),
                "evaluations": evaluations,
                "run": os.environ.get(RUN),
            }

    def write(self) -> None:
        """Write the receipt beside the log; one that cannot be written costs a warning in the log."""
        if not self._files:
            return
        try:
            write_text(self._place, json.dumps(self._files, indent=1) + "\n")
        except OSError as error:
            print(f"warning: no receipt {self._place}: {error.strerror}")


def measured(place: str | os.PathLike[str]) -> dict[str, Any]:
    """Return ``size`` (bytes) and ``sha256`` (hex) of a file."""
    with Path(place).open("rb") as file:
        digest = file_digest(file, "sha256").hexdigest()
        return {"size": file.tell(), "sha256": digest}


def folder_of(log: str | os.PathLike[str]) -> Path:
    """Return the folder of results that a log file belongs to: ``results/<name>`` of ``results/<name>/logs/...``."""
    parts = Path(log).parts
    end = parts.index("results") + 2 if "results" in parts[:-3] else len(parts) - 1 - parts[::-1].index("logs")
    return Path(*parts[:end])


def receipts_in(folder: Path) -> Iterator[dict[str, dict[str, Any]]]:
    """Yield the receipts of a folder of results, each as its files by name; what cannot be read is passed over."""
    for place in sorted((folder / "logs").rglob("*.json")):
        try:
            found = json.loads(place.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(found, dict) and all(isinstance(entry, dict) and "sha256" in entry for entry in found.values()):
            yield found
