"""Integrators from users' Python files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

from nearharmonic.errors import TableauError, unknown_name
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry.registry import is_path, split_path
from nearharmonic.registry.user_module import load, near_miss

DECLARES = "An integrator of your own is a Python file that defines TABLEAU, or several in TABLEAUS"


@dataclass(frozen=True, kw_only=True)
class TableauDefinition:
    """An integrator from a user's file.

    Attributes
    ----------
    file : str
        The Python file.
    written : str
        The path of the file, as in the config.
    base : None
        A user's integrator cannot modify a registered one.
    """

    file: str
    written: str
    base: None = None

    def make(self, name: str) -> Tableau:
        """Return the tableau of this name.

        Raises
        ------
        TableauError
            The file does not define it.
        """
        found = load_tableaus(self.file)
        if name not in found:
            message = f"{self.file} does not define the integrator {name!r} any more: it has {', '.join(found)}"
            raise TableauError(message)
        return found[name]


def load_tableaus(place: str | os.PathLike[str]) -> dict[str, Tableau]:
    """Return the tableaus that a Python file defines as TABLEAU or TABLEAUS, by name.

    Raises
    ------
    TableauError
        The file does not exist, cannot be run, or defines no tableau; or a tableau has the name of another one or of a
        registered integrator, or a lower order than it declares.
    """
    path = os.fspath(place)
    module = load(path, DECLARES, TableauError)
    several = getattr(module, "TABLEAUS", ())
    single = getattr(module, "TABLEAU", None)
    found = [*([] if single is None else [single]), *(several if isinstance(several, list | tuple) else [several])]
    if not found or not all(isinstance(one, Tableau) for one in found):
        why = near_miss(module, "TABLEAUS" if hasattr(module, "TABLEAUS") else "TABLEAU", Tableau)
        message = f"{path} does not define TABLEAU, a nearharmonic.Tableau, or a tuple of them as TABLEAUS{why}"
        raise TableauError(message)
    named: dict[str, Tableau] = {}
    for one in found:
        if one.name in integrators.registered:
            message = f"{path}: the integrator {one.name!r} is a registered one already; give it another name"
            raise TableauError(message)
        if one is not named.setdefault(one.name, one):
            message = f"{path} defines two integrators with the name {one.name!r}"
            raise TableauError(message)
        _check_order(path, one)
    return named


def _check_order(path: str, tableau: Tableau) -> None:
    """Raise an error for a tableau whose coefficients contradict its declared order, as far as it is examined."""
    from nearharmonic.integrators.order_conditions import HIGHEST_DECLARED, proved_order

    quadratic = tableau.requires is not None
    examined = min(tableau.order, HIGHEST_DECLARED)
    order = proved_order(tableau, examined, quadratic=quadratic)
    if order < examined:
        kind = "a quadratic kinetic energy" if quadratic else "every separable H"
        declared = (
            f"declares order {tableau.order}, and its coefficients, of {tableau.digits} digits, have order {order}"
        )
        message = f"{path}: the integrator {tableau.name!r} {declared} for {kind}"
        raise TableauError(message)


def tableau_at(place: str) -> Tableau:
    """Return the tableau at the path of a file; if the file has several, a colon and a name follow the path.

    Raises
    ------
    TableauError
        As for :func:`load_tableaus`, or the file defines several and the path has no name.
    UnknownNameError
        The file does not define the named tableau.
    """
    return _chosen(place, *split_path(place))


def _chosen(place: str, path: str, name: str) -> Tableau:
    found = load_tableaus(path)
    if name and name not in found:
        raise unknown_name(f"integrator of {path}", name, found)
    if not name and len(found) > 1:
        message = f"{place} defines {len(found)} integrators: name one, as in {path}:{next(iter(found))}"
        raise TableauError(message)
    return found[name] if name else next(iter(found.values()))


def expanded(entries: Iterable[str]) -> tuple[str, ...]:
    """Return the names of integrators for the entries of a list in a config.

    Parameters
    ----------
    entries : iterable of str
        Names, and paths of files: a path means all integrators of the file, ``path:name`` one of them. These
        integrators are then defined.

    Raises
    ------
    UnknownNameError
        There is no such integrator.
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
            names.append(entry)
    return tuple(names)
