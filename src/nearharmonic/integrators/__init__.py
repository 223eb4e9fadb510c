"""The integrators, one file per source; ``integrators["aba864"]`` is a :class:`~nearharmonic.Tableau`.

This package is the mapping ``integrators`` (``nearharmonic.registry``). A key is the name, the label or
another name of an integrator, or the path of a Python file. Three views select methods: those whose kicks are of V
alone, those with kicks of a modified potential, and the implicit ones, which have no kicks.

Examples
--------
>>> import nearharmonic as nh
>>> nh.integrators["velocity_verlet"]
<Tableau leapfrog: label Leapfrog, stages 1, order 2, first kick>
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass

from nearharmonic.errors import TableauError, unknown_name
from nearharmonic.integrators.collocation import Collocation
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry import Registry, Selection, is_path, load_file, near_miss, split_path

__all__ = [
    "BENCHMARKED", "Collocation", "Tableau", "implicit_integrators", "integrators", "modified_integrators",
    "plain_integrators",
]  # fmt: skip

#: The ten methods of Nielsen's figures in the paper's order, which is the order of every legend.
BENCHMARKED = (
    "ruth",
    "s5odr4",
    "aba104",
    "aba864",
    "aba1064",
    "yoshida_s7o6a",
    "abas5o6h",
    "babs7o7h",
    "babps8o7h",
    "babps9o7h",
)

# --- Integrators from users' Python files.

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


# --- The registry, and its views.

integrators: Registry[Tableau] = Registry(
    __name__,
    "integrator",
    "TABLEAUS",
    lambda module: {t.name: t for t in getattr(module, "TABLEAUS", ())},
    tableau_at,
    lambda tableau: tableau.other_names,
)

#: Splitting methods without and with modified potentials, and methods that are no splitting.
plain_integrators = Selection(
    integrators, "plain_integrators", lambda tableau: not (tableau.modified or tableau.implicit)
)
modified_integrators = Selection(
    integrators,
    "modified_integrators",
    lambda tableau: tableau.modified,
    """The integrators with modified potentials, a view of :mod:`nearharmonic.integrators`.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> "chin_4a" in nh.modified_integrators, "ruth" in nh.modified_integrators
    (True, False)
    """,
)
implicit_integrators = Selection(
    integrators,
    "implicit_integrators",
    lambda tableau: tableau.implicit,
    """The implicit integrators, a view of :mod:`nearharmonic.integrators`; each is a
    ``nearharmonic.integrators.collocation.Collocation``.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> [(name, one.order) for name, one in nh.implicit_integrators.items()]
    [('gauss16', 16)]
    """,
)


# --- Definitions of integrators from users' files, and the entries of a config.


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
