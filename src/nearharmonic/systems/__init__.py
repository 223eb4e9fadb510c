"""The Hamiltonian systems, one file each; ``systems["kepler"]`` is a :class:`~nearharmonic.System`.

This package is itself the mapping ``systems``: see :mod:`nearharmonic.registry.registry`.
"""

from nearharmonic.registry.registry import Registry, make_registry
from nearharmonic.systems.definition.file import system_at
from nearharmonic.systems.definition.quantities import Observable, Parameter
from nearharmonic.systems.definition.system import System

__all__ = ["Observable", "Parameter", "System", "systems"]

systems: Registry[System] = make_registry(
    __name__,
    "system",
    "SYSTEM",
    lambda module: {s.name: s for s in [getattr(module, "SYSTEM", None)] if s is not None},
    system_at,
)
