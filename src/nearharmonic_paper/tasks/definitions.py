"""Users' definitions of systems and integrators, passed from the planning process to the jobs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

#: Definitions by name, of "systems" and of "integrators".
Definitions = Mapping[str, Mapping[str, Any]]


def definitions_of(problems: Iterable[str], methods: Iterable[str]) -> Definitions:
    """Return the definitions of users' systems and integrators, by kind and name; {} if there are none."""
    defined = {"systems": (systems.definitions, problems), "integrators": (integrators.definitions, methods)}
    chosen = {kind: {n: every[n] for n in names if n in every} for kind, (every, names) in defined.items()}
    return {kind: found for kind, found in chosen.items() if found}


def files_in(definitions: Definitions) -> list[str]:
    """Return the paths of the users' files, sorted."""
    return sorted({one.file for members in definitions.values() for one in members.values() if one.file is not None})


@contextmanager
def defined(definitions: Definitions) -> Iterator[None]:
    """Add exactly these definitions to the registries inside the block."""
    with systems.defining(definitions.get("systems", {})), integrators.defining(definitions.get("integrators", {})):
        yield


def read_definitions(document: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Definitions:
    """Return definitions from their form in JSON.

    Raises
    ------
    NearharmonicError
        The document has no definitions.
    """
    from nearharmonic.integrators.user_file import TableauDefinition
    from nearharmonic.systems.user_file import SystemDefinition

    kinds: dict[str, Any] = {"systems": SystemDefinition, "integrators": TableauDefinition}
    try:
        return {
            kind: {
                name: kinds[kind](**{key: _frozen(value) for key, value in one.items()})
                for name, one in members.items()
            }
            for kind, members in document.items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        message = f"no definition of a system or an integrator: {document!r}"
        raise NearharmonicError(message) from error


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
