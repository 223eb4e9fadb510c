"""Near-harmonic symplectic integrators: reproduced, checked and extended (Nielsen 2015, arXiv:1501.04345).

Examples
--------
>>> import nearharmonic as nh
>>> run = nh.integrate("kepler", "aba864", 100)
>>> print(run.status.item(), f"{run.max_energy_error.item():.1e}")
ok 5.4e-06
"""

from __future__ import annotations

import warnings
from importlib import import_module
from types import FunctionType
from typing import TYPE_CHECKING, Any

from nearharmonic.errors import NearharmonicError, naming_arguments

if TYPE_CHECKING:
    from nearharmonic import adapters as adapters
    from nearharmonic.engine.ensemble import ensemble as ensemble
    from nearharmonic.engine.ensemble import section as section
    from nearharmonic.engine.gradient import gradient as gradient
    from nearharmonic.engine.tangent import tangent as tangent
    from nearharmonic.engine.trajectory import integrate as integrate
    from nearharmonic.engine.trajectory import problem as problem
    from nearharmonic.engine.trajectory import stepper as stepper
    from nearharmonic.engine.trajectory import sweep as sweep
    from nearharmonic.integrators import implicit_integrators as implicit_integrators
    from nearharmonic.integrators import integrators as integrators
    from nearharmonic.integrators import modified_integrators as modified_integrators
    from nearharmonic.integrators.tableau import Tableau as Tableau
    from nearharmonic.integrators.tableau import palindrome as palindrome
    from nearharmonic.plotting.plot import animate as animate
    from nearharmonic.plotting.plot import plot as plot
    from nearharmonic.recommendation.recommend import recommend as recommend
    from nearharmonic.systems import systems as systems
    from nearharmonic.systems.quantities import Observable as Observable
    from nearharmonic.systems.quantities import Parameter as Parameter
    from nearharmonic.systems.system import System as System
    from nearharmonic.theory.order import harmonic_order as harmonic_order
    from nearharmonic.theory.order import order_of as order_of
    from nearharmonic.theory.oscillator import kappa as kappa
    from nearharmonic.theory.oscillator import stability_limit as stability_limit
    from nearharmonic.training.tailor import tailor as tailor

__version__ = "1.0.0"

#: Modules of the names that are loaded lazily: numpy takes longer to load than a command without numpy runs.
_MODULES = {
    name: module
    for module, names in {
        "adapters": "adapters",
        "engine.ensemble": "ensemble section",
        "engine.trajectory": "integrate problem stepper sweep",
        "engine.gradient": "gradient",
        "engine.tangent": "tangent",
        "integrators": "implicit_integrators integrators modified_integrators",
        "integrators.tableau": "Tableau palindrome",
        "theory.order": "harmonic_order order_of",
        "theory.oscillator": "kappa stability_limit",
        "plotting.plot": "animate plot",
        "recommendation.recommend": "recommend",
        "systems": "systems",
        "systems.quantities": "Observable Parameter",
        "systems.system": "System",
        "training.tailor": "tailor",
    }.items()
    for name in names.split()
}

#: Former names, which warn at their first use, and their present names.
_FORMER = {"ModifiedTableau": "Tableau"}

__all__ = [
    "NearharmonicError", "Observable", "Parameter", "System", "Tableau", "__version__", "adapters", "animate",
    "ensemble", "gradient", "harmonic_order", "implicit_integrators", "integrate", "integrators", "kappa",
    "modified_integrators", "order_of", "palindrome", "plot", "problem",
    "recommend", "section", "stability_limit", "stepper", "sweep", "systems", "tailor", "tangent",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    present = _FORMER.get(name, name)
    if present not in _MODULES:
        raise AttributeError(f"module 'nearharmonic' has no attribute {name!r}")
    if present != name:
        warnings.warn(f"nearharmonic.{name} is now nearharmonic.{present}", DeprecationWarning, stacklevel=2)
    module = import_module(f"nearharmonic.{_MODULES[present]}")
    found = module if present == "adapters" else getattr(module, present)
    if isinstance(found, FunctionType):
        found = naming_arguments(found, present)
        found.__module__ = __name__  # where pickle finds it
    elif isinstance(found, type):
        for method in ("__init__", "__call__") if hasattr(found, "_prepared_step") else ("__init__",):
            setattr(found, method, naming_arguments(getattr(found, method), present))
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
