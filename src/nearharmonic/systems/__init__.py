"""The Hamiltonian systems, one file each; ``systems["kepler"]`` is a :class:`~nearharmonic.System`.

The mapping stands in the place of this package (``nearharmonic.registry``). A key is the name of a system, or
the path of a Python file that defines SYSTEM.

Examples
--------
>>> import nearharmonic as nh
>>> nh.systems["sho"]
<System sho: label simple harmonic oscillator, coordinates 1, t_end 500>
"""

from nearharmonic.registry import Registry
from nearharmonic.systems.quantities import Observable, Parameter
from nearharmonic.systems.system import System, system_at

__all__ = ["Observable", "Parameter", "System", "systems"]

systems: Registry[System] = Registry(
    __name__,
    "system",
    "SYSTEM",
    lambda module: {s.name: s for s in [getattr(module, "SYSTEM", None)] if s is not None},
    system_at,
)
