"""Integrators with kicks of a modified potential, one file per source, each a :class:`ModifiedTableau`.

They are no plain splittings, and so have a registry of their own: this package is itself the mapping
``modified_integrators``, see :mod:`nearharmonic.registry.registry`.
"""

from nearharmonic.errors import unknown_name
from nearharmonic.integrators import integrators
from nearharmonic.integrators.modified_tableau import ModifiedTableau
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.registry.registry import Registry, is_path, make_registry

__all__ = ["ModifiedTableau", "method_of", "modified_integrators"]

modified_integrators: Registry[ModifiedTableau] = make_registry(
    __name__, "integrator", "TABLEAUS", lambda module: {t.name: t for t in getattr(module, "TABLEAUS", ())}
)


def method_of(name: str) -> Tableau:
    """Return the integrator of this name, of either registry, or that of a user's file.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    TableauError
        As for :func:`nearharmonic.integrators.user_file.load_tableaus`.
    """
    if name in integrators or is_path(name) or hasattr(name, "__fspath__"):
        return integrators[name]
    if name in modified_integrators:
        return modified_integrators[name]
    raise unknown_name("integrator", name, (*integrators, *modified_integrators))
