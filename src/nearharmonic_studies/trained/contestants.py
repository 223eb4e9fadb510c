"""Methods of the comparison: trained ones, published ones, and other methods of this project."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from nearharmonic.integrators import modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.training.published import OURS, TRAINED, TRAINED_EXACT, module_of

Kind = Literal["trained", "published", "own"]
#: Kinds in the order of cubes.
KINDS: tuple[Kind, ...] = ("published", "own", "trained")

#: Ideas of methods for the exactly solved oscillator: all but trained ones, and trained ones.
EXACT_IDEAS = ("exact_oscillator", "trained_exact")
#: Ideas of methods, in the order of tables and figures.
IDEAS = (*EXACT_IDEAS, "harmonic_conditions", "nystrom", "trained", "general")
#: Minimum order of a Nystrom method (with quadratic T) of high order.
NYSTROM_ORDER = 6


def contestants() -> tuple[str, ...]:
    """Return the names of all registered methods for T and V whose energy is measured at every step.

    Processed methods are not among them, and those trained with the oscillator solved exactly.
    """
    modified = [name for name in modified_integrators.registered if not modified_integrators[name].processed]
    return tuple(name for name in (*plain_integrators.registered, *modified) if not name.startswith(TRAINED_EXACT))


def exact_contestants(others: Sequence[str]) -> tuple[str, ...]:
    """Return the names of methods for the exactly solved oscillator: ``others`` and all registered plain methods."""
    return tuple(dict.fromkeys((*others, *plain_integrators.registered)))


def kind_of(name: str) -> Kind:
    """Return the kind of a registered method."""
    if name.startswith(TRAINED):
        return "trained"
    return "own" if module_of(name) in OURS else "published"


def idea_of(method: Tableau) -> str | None:
    """Return the idea of a method with T and V; None for methods with modified potentials.

    Methods with a harmonic order belong to this idea for any general order and any author.
    """
    if method.name.startswith(TRAINED):
        return "trained"
    if method.modified:
        return None
    if method.harmonic_order is not None:
        return "harmonic_conditions"
    return "nystrom" if method.requires and method.order >= NYSTROM_ORDER else "general"
