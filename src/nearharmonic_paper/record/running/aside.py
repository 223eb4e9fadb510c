"""Damaged results, set aside while Snakemake plans a run, so that it makes them again.

Files that no job has made again by the end of the process return to their places, where ``verify`` names them.
"""

from __future__ import annotations

import atexit
import os
import shutil
from collections.abc import Iterable
from pathlib import Path

#: Folder of these files, in the folder of results.
ASIDE = Path("logs", "aside")


def set_aside(folder: Path, names: Iterable[str]) -> None:
    """Move results out of their places until the end of the process."""
    atexit.register(restore, folder)
    for name in names:
        kept = folder / ASIDE / name
        kept.parent.mkdir(parents=True, exist_ok=True)
        (folder / name).rename(kept)


def restore(folder: Path) -> None:
    """Move results back to those places that no job has filled, also after an earlier process was killed."""
    for kept in sorted((folder / ASIDE).rglob("*")):
        place = folder / kept.relative_to(folder / ASIDE)
        if not os.path.lexists(place) and not (kept.is_dir() and not kept.is_symlink()):
            place.parent.mkdir(parents=True, exist_ok=True)
            kept.rename(place)
    shutil.rmtree(folder / ASIDE, ignore_errors=True)
