"""Systems in Python files of users."""

from __future__ import annotations

import os
from collections.abc import Collection

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.registry.registry import split_path
from nearharmonic.registry.user_module import load, near_miss
from nearharmonic.systems.definition.system import System

DECLARES = "A system of your own is a Python file that defines SYSTEM"


def load_system(place: str | os.PathLike[str]) -> System:
    """Return the ``SYSTEM`` that a Python file defines.

    Raises
    ------
    SystemDefinitionError
        The file does not exist, fails when it is run, or defines no System of that name.
    """
    module = load(place, DECLARES, SystemDefinitionError)
    found = getattr(module, "SYSTEM", None)
    if not isinstance(found, System):
        why = near_miss(module, "SYSTEM", System)
        raise SystemDefinitionError(f"{os.fspath(place)} does not define SYSTEM, a nearharmonic.System{why}")
    return found


def system_at(place: str, registered: Collection[str]) -> System:
    """Return the system of a file that is given by its path; it must not have the name of a registered system.

    Raises
    ------
    SystemDefinitionError
        As for :func:`load_system`, or the system has the name of a registered system.
    """
    path, entry = split_path(place)
    if entry:
        raise SystemDefinitionError(f"{place}: a file defines one system, SYSTEM; give the path alone")
    found = load_system(path)
    if found.name in registered:
        message = f"{path}: SYSTEM has the name of the registered system {found.name!r}; give it another name"
        raise SystemDefinitionError(message)
    return found
