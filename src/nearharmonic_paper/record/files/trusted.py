"""Users' Python files of a result: those that its record names, and a check of those that the user trusts."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.registry.user_module import check_trust, is_file, is_trusted
from nearharmonic_paper.record.history import runs_newest_first
from nearharmonic_paper.tasks.code.user_sources import digest_of
from nearharmonic_paper.tasks.definitions import files_in, read_definitions

Entries = Iterable[Mapping[str, Any]]


def check_trusted(folder: Path, given: Iterable[str]) -> None:
    """Check that the files which the user trusts are those that made the results in ``folder``.

    No such file, or another digest or none of the newest run that used it, is a SettingError.
    """
    recorded = recorded_digests(folder)
    for file in given:
        if not is_file(Path(file)):
            raise bad_setting("--trust", file, "a Python file that the results name")
        if (key := _key(file)) not in recorded:
            raise bad_setting("--trust", file, f"the history of {folder} has no digest of such a file")
        if (digest := digest_of(file)) != recorded[key]:
            message = f"{file} is not the file that made {folder}: its code has the digest {digest}, recorded is"
            raise SettingError(f"{message} {recorded[key]}")


def recorded_digests(folder: Path) -> dict[str, str]:
    """Return the digest of the code of each user's file, by absolute path, as its newest run has recorded it."""
    found: dict[str, str] = {}
    for _, run in runs_newest_first([folder]):
        for file, digest in run.get("user_files", {}).items():
            found.setdefault(_key(file), digest)
    return found


def is_edited(file: str | os.PathLike[str], recorded: Mapping[str, str]) -> bool:
    """Return True if the code of a user's file, which is read, has not the ``recorded`` digest."""
    return digest_of(file) != recorded.get(_key(file))


def check_files_of(entries: Entries) -> None:
    """Raise UntrustedFileError, which names each file, if entries of a manifest need users' files not trusted."""
    check_trust(
        *sorted({file for entry in entries for file in files_in(read_definitions(entry.get("definitions", {})))})
    )


def integrator_files_not_run(entries: Entries) -> list[str]:
    """Return the sorted files with integrators of entries of a manifest, without the trusted ones."""
    kinds = ({"integrators": entry.get("definitions", {}).get("integrators", {})} for entry in entries)
    files = {file for kind in kinds for file in files_in(read_definitions(kind))}
    return sorted(file for file in files if not is_trusted(file))


def _key(file: str | os.PathLike[str]) -> str:
    return str(Path(os.path.realpath(file)))
