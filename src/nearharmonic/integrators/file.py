"""Integrators from users' Python files."""

from __future__ import annotations

import os
from collections.abc import Collection

from nearharmonic.errors import TableauError, unknown_name
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry import load_file, near_miss, split_path

DECLARES = "An integrator of your own is a Python file that defines TABLEAU, or several in TABLEAUS"


def tableaus_of(place: str | os.PathLike[str], registered: Collection[str]) -> dict[str, Tableau]:
    """Return the tableaus that a Python file defines as TABLEAU or TABLEAUS, by name; each has the order that it
    declares.

    None has the name of another one or of a ``registered`` integrator.
    """
    path = os.fspath(place)
    module = load_file(path, DECLARES, TableauError)
    several = getattr(module, "TABLEAUS", ())
    single = getattr(module, "TABLEAU", None)
    found = [*([] if single is None else [single]), *(several if isinstance(several, list | tuple) else [several])]
    if not found or not all(isinstance(one, Tableau) for one in found):
        why = near_miss(module, "TABLEAUS" if hasattr(module, "TABLEAUS") else "TABLEAU", Tableau)
        message = f"{path} does not define TABLEAU, a nearharmonic.Tableau, or a tuple of them as TABLEAUS{why}"
        raise TableauError(message)
    named: dict[str, Tableau] = {}
    for one in found:
        if one.name in registered:
            raise TableauError(f"{path}: the integrator {one.name!r} is a registered one already; give it another name")
        if one is not named.setdefault(one.name, one):
            raise TableauError(f"{path} defines two integrators with the name {one.name!r}")
        _check_order(path, one)
    return named


def _check_order(path: str, tableau: Tableau) -> None:
    """Raise an error for a tableau whose coefficients contradict its declared order, as far as it is examined."""
    from nearharmonic.theory.order_conditions import HIGHEST_DECLARED, proved_order

    quadratic = tableau.requires is not None
    examined = min(tableau.order, HIGHEST_DECLARED)
    order = proved_order(tableau, examined, quadratic=quadratic)
    if order < examined:
        kind = "a quadratic kinetic energy" if quadratic else "every separable H"
        declared = (
            f"declares order {tableau.order}, and its coefficients, of {tableau.digits} digits, have order {order}"
        )
        raise TableauError(f"{path}: the integrator {tableau.name!r} {declared} for {kind}")


def tableau_at(place: str, registered: Collection[str]) -> Tableau:
    """Return the tableau of a file that is used by its path; of several, the one whose name follows a colon."""
    path, name = split_path(place)
    found = tableaus_of(path, registered)
    if name and name not in found:
        raise unknown_name(f"integrator of {path}", name, found)
    if not name and len(found) > 1:
        raise TableauError(f"{place} defines {len(found)} integrators: name one, as in {path}:{next(iter(found))}")
    return found[name] if name else next(iter(found.values()))
