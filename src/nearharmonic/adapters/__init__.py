"""Methods inside other libraries, one module for each: ``nh.adapters.openmm``, ``nh.adapters.ase`` and others.

A module imports its library when it is first asked for; an extra of the same name installs the library.

Examples
--------
>>> import nearharmonic as nh
>>> dir(nh.adapters)[:3]
['ase', 'blackjax', 'diffrax']
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module
from types import ModuleType

from nearharmonic.errors import MissingPackageError

#: Adapters and the package that each imports; the extra of an adapter is its name with hyphens.
PACKAGES = {
    "ase": "ase",
    "blackjax": "blackjax",
    "diffrax": "diffrax",
    "jax_md": "jax-md",
    "mici": "mici",
    "openmm": "openmm",
    "rebound": "rebound",
    "scipy": "scipy",
    "sundials": "sundials4py",
}


def __getattr__(name: str) -> ModuleType:
    if name not in PACKAGES:
        nearest = get_close_matches(name, PACKAGES, n=1) if not name.startswith("_") else []
        hint = f"; did you mean {nearest[0]!r}?" if nearest else f"; there are {', '.join(PACKAGES)}"
        raise AttributeError(f"no adapter for {name!r}{hint}")
    try:
        return import_module(f"nearharmonic.adapters.{name}")
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("nearharmonic"):
            raise
        raise MissingPackageError(f"nh.adapters.{name}", PACKAGES[name], name.replace("_", "-")) from error


def __dir__() -> list[str]:
    return sorted(PACKAGES)
