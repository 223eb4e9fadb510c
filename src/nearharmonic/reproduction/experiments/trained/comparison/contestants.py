"""Methods that are compared: trained ones, published ones, and those of this project that are neither."""

from __future__ import annotations

from typing import Literal

from nearharmonic.integrators import modified_integrators, plain_integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.training.published import OURS, TRAINED, module_of

Kind = Literal["trained", "published", "own"]
#: In the order of cubes.
KINDS: tuple[Kind, ...] = ("published", "own", "trained")

#: What a method is built on, in the order of tables and figures.
IDEAS = ("exact_oscillator", "harmonic_conditions", "nystrom", "trained", "general")
#: Order from which on a method that requires quadratic T counts as a Nystrom method of high order.
NYSTROM_ORDER = 6


def contestants() -> tuple[str, ...]:
    """Return the names of all registered methods whose energy is measured at every step: all but processed ones."""
    modified = [name for name in modified_integrators.registered if not modified_integrators[name].processed]
    return (*plain_integrators.registered, *modified)


def kind_of(name: str) -> Kind:
    """Return the kind of a registered method."""
    if name.startswith(TRAINED):
        return "trained"
    return "own" if module_of(name) in OURS else "published"


def idea_of(method: Tableau) -> str | None:
    """Return the idea that a method with T and V stands for; None for kicks of a modified potential.

    Methods of harmonic orders are of this idea whatever their general order, and whoever found them.
    """
    if method.name.startswith(TRAINED):
        return "trained"
    if method.modified:
        return None
    if method.harmonic_order is not None:
        return "harmonic_conditions"
    return "nystrom" if method.requires and method.order >= NYSTROM_ORDER else "general"
