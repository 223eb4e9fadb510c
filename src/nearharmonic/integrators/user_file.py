"""Definitions of integrators from users' Python files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

from nearharmonic.errors import TableauError
from nearharmonic.integrators import integrators
from nearharmonic.integrators.file import tableaus_of
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry import is_path, split_path


@dataclass(frozen=True, kw_only=True)
class TableauDefinition:
    """An integrator from a user's file, whose path in the config is ``written``."""

    file: str
    written: str
    base: None = None  # a user's integrator cannot modify a registered one

    def make(self, name: str) -> Tableau:
        """Return the tableau of this name."""
        found = load_tableaus(self.file)
        if name not in found:
            message = f"{self.file} does not define the integrator {name!r} any more: it has {', '.join(found)}"
            raise TableauError(message)
        return found[name]


def load_tableaus(place: str | os.PathLike[str]) -> dict[str, Tableau]:
    """Return the tableaus that a Python file defines, by name, as :func:`tableaus_of` does."""
    return tableaus_of(place, integrators.registered)


def expanded(entries: Iterable[str]) -> tuple[str, ...]:
    """Return the names of integrators for the entries of a list in a config.

    An entry is a name, another name, or the path of a file, all of whose integrators it means; ``path:name`` is one of
    them. These integrators are then defined.
    """
    names: list[str] = []
    for entry in entries:
        if is_path(entry):
            path, name = split_path(entry)
            names += [
                key
                for key, one in integrators.definitions.items()
                if isinstance(one, TableauDefinition) and one.written == path and name in ("", key)
            ]
        else:
            integrators[entry]
            names.append(integrators.name_of(entry))
    return tuple(names)
