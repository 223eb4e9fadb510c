"""The Python files of users' systems and integrators in an archive, and the configs with their paths."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from nearharmonic.errors import ResultFileError
from nearharmonic.registry.registry import split_path
from nearharmonic_paper.record.archive.description.member import Member
from nearharmonic_paper.record.files.trusted import is_edited
from nearharmonic_paper.tasks.code.user_sources import files_of

#: Folder of these files in an archive.
FOLDER = "user_files"


class UserFiles:
    """Users' files of some results, from the entries of their manifest and the ``recorded`` digests of their code."""

    def __init__(self, entries: Iterable[Mapping[str, Any]], recorded: Mapping[str, str]) -> None:
        self._recorded = recorded
        self._systems: dict[str, Path] = {}
        self._integrators: dict[str, Path] = {}
        for entry in entries:
            defined = entry.get("definitions", {})
            for name, one in defined.get("systems", {}).items():
                if one["file"] is not None:
                    self._systems[name] = Path(one["file"])
            self._integrators |= {one["written"]: Path(one["file"]) for one in defined.get("integrators", {}).values()}
        parents = sorted({path.parent for path in (*self._systems.values(), *self._integrators.values())})
        self._folders = {
            parent: FOLDER if len(parents) == 1 else f"{FOLDER}/{number}" for number, parent in enumerate(parents, 1)
        }

    def members(self) -> list[Member]:
        """Return the members of an archive for these files and the files that they import.

        Raises
        ------
        ResultFileError
            A file cannot be read, or its code is not that of the recorded digest: a manifest may name any file.
        """
        found = {}
        for path in (*self._systems.values(), *self._integrators.values()):
            if is_edited(path, self._recorded):
                raise ResultFileError(f"{path} is not archived: its code has no digest in the history, or another one")
            for one in files_of(path):
                name = f"{self._folders[path.parent]}/{one.relative_to(path.parent).as_posix()}"
                found[name] = Member.of_file(name, one, "Python file of a system or an integrator of the config.")
        return list(found.values())

    def config(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """Return a config of the history in which the paths of files are those in the archive."""
        return {key: self._placed(key, value) for key, value in given.items()}

    def _placed(self, key: str, value: Any) -> Any:
        if key == "systems" and isinstance(value, Mapping):
            return {name: self._system(name, one) for name, one in value.items()}
        if isinstance(value, Mapping):
            return self.config(value)
        if key in {"integrators", "decomposition", "overview"} and isinstance(value, list):
            return [self._integrator(entry) for entry in value]
        return value

    def _system(self, name: str, one: Mapping[str, Any]) -> Mapping[str, Any]:
        if name not in self._systems or one.get("file") is None:
            return one
        return {**one, "file": self._place(self._systems[name])}

    def _integrator(self, entry: str) -> str:
        path, name = split_path(entry)
        if path not in self._integrators:
            return entry
        return self._place(self._integrators[path]) + (f":{name}" if name else "")

    def _place(self, path: Path) -> str:
        return f"{self._folders[path.parent]}/{path.name}"
