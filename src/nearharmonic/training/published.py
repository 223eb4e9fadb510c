"""The methods that trained ones are compared with: all that are registered, but for those of this project itself."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.integrators import integrators, modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau

#: What the names of trained methods begin with.
TRAINED = "trained_"
#: Modules of this project's own methods: found by order conditions, and trained.
OURS = ("nearharmonic_2026", "nearharmonic_2026_modified", "trained", "trained_modified")


def module_of(name: str) -> str:
    """Return the last part of the name of the module that registers a method."""
    return str(integrators.module_of(name)).rpartition(".")[2]


def published_names() -> tuple[str, ...]:
    """Return the names of all published methods without modified potentials."""
    return tuple(name for name in plain_integrators.registered if module_of(name) not in OURS)


def modified_names() -> tuple[str, ...]:
    """Return the names of all methods with kicks of a modified potential but for processed and trained ones.

    Published ones come first.
    """
    found = [name for name, one in modified_integrators.items() if not (one.processed or name.startswith(TRAINED))]
    return tuple(sorted(found, key=lambda name: module_of(name) in OURS))


def published_methods(names: Sequence[str]) -> list[Tableau]:
    """Return the published ones among the methods of these names."""
    return [integrators[name] for name in names if module_of(name) not in OURS]
