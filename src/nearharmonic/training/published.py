"""The methods that trained ones are compared with: all that are registered, but for those of this project itself."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.integrators import integrators
from nearharmonic.integrators.modified import method_of, modified_integrators
from nearharmonic.integrators.tableau import Tableau

#: What the names of trained methods begin with.
TRAINED = "trained_"
#: Modules of this project's own methods: found by order conditions, and trained.
OURS = ("nearharmonic_2026", "trained")


def module_of(name: str) -> str:
    """Return the last part of the name of the module that registers a method, of either registry."""
    registry = integrators if name in integrators else modified_integrators
    return str(registry.module_of(name)).rpartition(".")[2]


def published_names() -> tuple[str, ...]:
    """Return the names of all published methods without modified potentials."""
    return tuple(name for name in integrators.registered if module_of(name) not in OURS)


def modified_names() -> tuple[str, ...]:
    """Return the names of all methods with kicks of a modified potential but for processed and trained ones.

    Published ones come first.
    """
    found = [name for name, one in modified_integrators.items() if not one.processed and module_of(name) != OURS[1]]
    return tuple(sorted(found, key=lambda name: module_of(name) in OURS))


def published_methods(names: Sequence[str]) -> list[Tableau]:
    """Return the published ones among the methods of these names."""
    return [method_of(name) for name in names if module_of(name) not in OURS]
