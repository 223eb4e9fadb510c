"""Methods of the comparison: trained ones, published ones, and other methods of this project."""

from __future__ import annotations

from typing import Literal

from nearharmonic.integrators import modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.training.published import OURS, TRAINED, module_of

Kind = Literal["trained", "published", "own"]
#: Kinds in the order of cubes.
KINDS: tuple[Kind, ...] = ("published", "own", "trained")

#: Ideas of methods, in the order of tables and figures.
IDEAS = ("exact_oscillator", "harmonic_conditions", "nystrom", "trained", "general")
#: Minimum order of a Nystrom method (with quadratic T) of high order.
NYSTROM_ORDER = 6


def contestants() -> tuple[str, ...]:
    """Return the names of all registered methods whose energy is measured at every step: all except processed ones."""
    modified = [name for name in modified_integrators.registered if not modified_integrators[name].processed]
    return (*plain_integrators.registered, *modified)


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
