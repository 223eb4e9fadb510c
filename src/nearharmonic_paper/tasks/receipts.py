"""Receipts: lists of the files that each job of a workflow wrote, stored beside its log; the manifest combines them.

A receipt holds the size and the SHA-256 of each file as the job left it, so that a file that was edited later can be
distinguished from a file that was made again. It is not a result file, so it may contain timestamps. A receipt is
sealed; one whose seal does not match is not believed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from hashlib import file_digest
from pathlib import Path
from typing import Any, TypeVar

from nearharmonic.output import atomic as reading
from nearharmonic.output.atomic import sealed, write_text
from nearharmonic.output.atomic import unsealed as opened
from nearharmonic.output.store import sealed_digest
from nearharmonic_paper.tasks.provenance import settings_digest, settings_text

Measuring = TypeVar("Measuring", bound=Callable[..., Any])

#: Environment variable with the id of the workflow run of a job.
RUN = "NEARHARMONIC_RUN"
#: Folders of files that are no results: logs, the marks of jobs among them, and copies of pages of the documentation.
BESIDE = ("logs", "docs")
#: Folder below ``logs`` with the markers of unfinished runs, which are no receipts.
MARKED = "running"
#: Marks a whole file as volatile, in place of columns.
WHOLE = "*"


def measures_time(function: Measuring) -> Measuring:
    """Declare that all files from the results of ``function`` contain measured times, which differ from run to run."""
    function.measures_time = True  # type: ignore[attr-defined]
    return function


class Receipt:
    """Files that one job wrote."""

    def __init__(self, log: str | os.PathLike[str], inputs: Iterable[str] = ()) -> None:
        self._place = Path(log).with_suffix(".json")
        self._folder = folder_of(log)
        self._files: dict[str, dict[str, Any]] = {}
        self._inputs = {
            name: identity(self._folder / name) for name in sorted(map(self._name, filter(self._is_result, inputs)))
        }

    def _name(self, place: str) -> str:
        """Return the name of a file in the folder of results."""
        return Path(os.path.relpath(place, self._folder)).as_posix()

    def _is_result(self, place: str) -> bool:
        """Return True if a file is a result: in the folder, and in none of BESIDE."""
        return self._name(place).partition("/")[0] not in {*BESIDE, ".."}

    def add(
        self, places: Sequence[str], task: Mapping[str, Any], *, volatile: Sequence[str] = (), evaluations: int = 0
    ) -> None:
        """Add results that a task has written."""
        for place in filter(self._is_result, places):
            self._files[self._name(place)] = {
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
                "inputs": self._inputs,
                "run": os.environ.get(RUN),
                **({"definitions": json.loads(settings_text(task))["definitions"]} if task.get("definitions") else {}),
            }

    def write(self) -> None:
        """Write the receipt beside the log; a failure is a warning in the log."""
        try:
            write_text(self._place, json.dumps(sealed({"files": self._files}), indent=1) + "\n")
        except OSError as error:
            print(f"warning: no receipt: {error}")


def measured(place: str | os.PathLike[str]) -> dict[str, Any]:
    """Return ``size`` (bytes) and ``sha256`` (hex) of a regular file."""
    with reading.opened(place) as file:
        digest = file_digest(file, "sha256").hexdigest()  # type: ignore[arg-type]  # it has readinto
        return {"size": file.tell(), "sha256": digest}


def identity(place: Path) -> str:
    """Return a digest that identifies the content of a file: the one in its last line, or else that of its bytes."""
    return sealed_digest(place) or str(measured(place)["sha256"])


def folder_of(log: str | os.PathLike[str]) -> Path:
    """Return the folder of results that a log file belongs to: ``results/<name>`` of ``results/<name>/logs/...``."""
    parts = Path(log).parts
    end = parts.index("results") + 2 if "results" in parts[:-3] else len(parts) - 1 - parts[::-1].index("logs")
    return Path(*parts[:end])


def receipts_in(folder: Path) -> Iterator[tuple[Path, dict[str, dict[str, Any]]]]:
    """Yield place and files by name of each receipt in a folder of results; damaged receipts are skipped."""
    yield from ((place, files) for place, files in _receipts(folder) if files is not None)


def damaged_receipts(folder: Path) -> list[Path]:
    """Return the receipts in a folder of results that cannot be read, or whose seal is missing or does not match."""
    return [place for place, files in _receipts(folder) if files is None]


def names_made_by(folder: Path, run: str) -> list[str]:
    """Return the sorted names of the files that jobs of the workflow run with this id made."""
    made = (name for _, files in receipts_in(folder) for name, entry in files.items() if entry["run"] == run)
    return sorted(made)


def _receipts(folder: Path) -> Iterator[tuple[Path, dict[str, dict[str, Any]] | None]]:
    from nearharmonic_paper.tasks.schema import complaint

    for place in sorted((folder / "logs").rglob("*.json")):
        if place.parent != folder / "logs" / MARKED:
            try:
                files = (opened(reading.read_bytes(place)) or {}).get("files")
            except FileNotFoundError:  # removed in between
                continue
            except OSError:
                files = None
            yield place, None if complaint("receipt", files) else files


def forget(folder: Path, entries: Mapping[str, Mapping[str, Any]]) -> None:
    """Delete the receipts of ``folder`` that say another digest of a file than ``entries`` do."""
    for place, receipt in receipts_in(folder):
        if any(name in entries and entry["sha256"] != entries[name]["sha256"] for name, entry in receipt.items()):
            place.unlink(missing_ok=True)


# --- Receipts of jobs, and the schema of the record that is assembled from them.

__all__ = [
    "BESIDE",
    "MARKED",
    "RUN",
    "WHOLE",
    "Receipt",
    "damaged_receipts",
    "folder_of",
    "forget",
    "identity",
    "measured",
    "measures_time",
    "names_made_by",
    "receipts_in",
]
