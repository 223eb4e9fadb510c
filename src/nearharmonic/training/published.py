"""The methods that trained ones are compared with: all that are registered, but for those of this project itself."""

from __future__ import annotations

from collections.abc import Sequence

from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.modified_integrators import modified_integrators

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


def published_methods(names: Sequence[str], *, modified: bool = False) -> list[Tableau]:
    """Return the methods of these names.

    Parameters
    ----------
    names : sequence of str
        Of :func:`published_names`.
    modified : bool
        Whether published methods with kicks of a modified potential are among them; processed ones are left out.
    """
    found: list[Tableau] = [integrators[name] for name in names]
    return found + (modified_methods(own=False) if modified else [])


def modified_methods(*, own: bool) -> list[Tableau]:
    """Return the methods with kicks of a modified potential of this project's own search, or the published ones."""
    found: list[Tableau] = []
    for name, one in modified_integrators.items():
        module = module_of(name)
        if not one.processed and (module == OURS[0] if own else module not in OURS):
            found.append(one)
    return found
