"""Near-harmonic symplectic integrators: reproduced, checked and extended (Nielsen 2015, arXiv:1501.04345).

>>> import nearharmonic as nh
>>> nh.sweep("sho", "babps9o7h", [0.9, 0.45]).max_energy_error  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import NearharmonicError

if TYPE_CHECKING:
    from nearharmonic.engine.ensemble import ensemble as ensemble
    from nearharmonic.engine.problem import problem as problem
    from nearharmonic.engine.trajectory import integrate as integrate
    from nearharmonic.engine.trajectory import sweep as sweep
    from nearharmonic.integrators import integrators as integrators
    from nearharmonic.systems import systems as systems
    from nearharmonic.theory.oscillator import kappa as kappa

__all__ = [
    "NearharmonicError",
    "__version__",
    "ensemble",
    "integrate",
    "integrators",
    "kappa",
    "problem",
    "sweep",
    "systems",
]

__version__ = "0.1.0"

#: Where the names are that are loaded when they are first asked for: numpy takes longer than a command that needs none.
_MODULES = {
    "ensemble": "engine.ensemble",
    "integrate": "engine.trajectory",
    "integrators": "integrators",
    "kappa": "theory.oscillator",
    "problem": "engine.problem",
    "sweep": "engine.trajectory",
    "systems": "systems",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'nearharmonic' has no attribute {name!r}")
    found = getattr(import_module(f"nearharmonic.{_MODULES[name]}"), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
