"""Files that jobs are about to write again: kept beside the logs until the workflow has ended without an error.

Snakemake deletes the outputs of a job before it starts. A job whose settings have changed may still use most of what
the file holds.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.output.dataset import Variables
from nearharmonic.output.store.files import claimed_attributes
from nearharmonic.output.store.seal import complaint

#: Folder of the files that are kept, in the folder of results.
PLACE = "logs/earlier"


def keep(folder: Path, outputs: Iterable[str | os.PathLike[str]]) -> None:
    """Keep all sound result files in the folders of ``outputs``, which jobs are about to write, in a folder of results.

    The HDF5 library may crash on a damaged file, so that none is kept.
    """
    for place in sorted({Path(output).parent for output in outputs}):
        for path in place.glob("*.h5"):
            kept = folder / PLACE / place.relative_to(folder) / f"{path.stem}-{path.stat().st_mtime_ns}.h5"
            if not kept.exists() and not complaint(path):
                kept.parent.mkdir(parents=True, exist_ok=True)
                _link(path, kept)


def _link(path: Path, kept: Path) -> None:
    try:
        kept.hardlink_to(path)
    except OSError:  # a file system without links
        shutil.copyfile(path, kept)


def forget(folder: Path) -> None:
    """Delete what was kept."""
    shutil.rmtree(folder / PLACE, ignore_errors=True)


@dataclass(frozen=True)
class KeptFile:
    """A kept file: the ``settings`` that it states, and its contents.

    Its users need no reader of files, so that an edit of one leaves their results valid.
    """

    path: Path
    settings: Mapping[str, Any]

    def contents(self) -> dict[str, Variables]:
        """Return the variables by precision; none if the file is damaged."""
        from nearharmonic.output.store.reader import read_precisions

        try:
            read = read_precisions(self.path)
        except NearharmonicError:
            return {}
        return {
            precision: {
                str(name): (tuple(map(str, one.dims)), one.values, one.attrs) for name, one in runs.variables.items()
            }
            for precision, runs in read.items()
        }


def kept_for(folder: Path, output: str | os.PathLike[str], origin: Mapping[str, str]) -> list[KeptFile]:
    """Return the kept files beside ``output`` of the same code, coefficients and users' definitions.

    Parameters
    ----------
    folder : Path
        Folder of results.
    output : path
        File that a job is about to write.
    origin : mapping
        Provenance attributes of the job.
    """
    place = folder / PLACE / Path(output).parent.relative_to(folder)
    ours = json.loads(origin["settings"]).get("definitions")
    found = []
    for path in sorted(place.glob("*.h5")):
        try:
            said = claimed_attributes(path)
            settings = json.loads(said["settings"])
            same = all(said[key] == origin[key] for key in ("code_digest", "coefficients_digest"))
            if same and settings.get("definitions") == ours:
                found.append(KeptFile(path, settings))
        except (NearharmonicError, AttributeError, KeyError, TypeError, ValueError, RecursionError):
            continue  # a file that does not say what it is
    return found
