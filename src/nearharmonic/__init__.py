"""Near-harmonic symplectic integrators: reproduced, checked and extended (Nielsen 2015, arXiv:1501.04345).

>>> import nearharmonic as nh
>>> nh.sweep("sho", "babps9o7h", [0.9, 0.45]).max_energy_error  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nearharmonic.engine.trajectory import integrate, sweep
from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.systems import systems

if TYPE_CHECKING:
    from nearharmonic.theory.oscillator import kappa as kappa

__all__ = ["NearharmonicError", "__version__", "integrate", "integrators", "kappa", "sweep", "systems"]

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name == "kappa":  # mpmath is loaded by those who ask for multiprecision
        from nearharmonic.theory.oscillator import kappa

        return kappa
    raise AttributeError(f"module 'nearharmonic' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
