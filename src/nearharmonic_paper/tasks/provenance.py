"""Provenance of a result: digests of its code, settings, coefficients, versions; no timestamps."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, fields, is_dataclass
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems import systems
from nearharmonic_paper.tasks.sources import PACKAGE, closure, module_digest, module_of

# --- Users' definitions of systems and integrators, passed from the planning process to the jobs.

#: Definitions by name, of "systems" and of "integrators".
Definitions = Mapping[str, Mapping[str, Any]]


def definitions_of(problems: Iterable[str], methods: Iterable[str]) -> Definitions:
    """Return the definitions of users' systems and integrators, by kind and name; {} if there are none."""
    defined = {"systems": (systems.definitions, problems), "integrators": (integrators.definitions, methods)}
    chosen = {kind: {n: every[n] for n in names if n in every} for kind, (every, names) in defined.items()}
    return {kind: found for kind, found in chosen.items() if found}


def files_in(definitions: Definitions) -> list[str]:
    """Return the paths of the users' files, sorted."""
    return sorted({one.file for members in definitions.values() for one in members.values() if one.file is not None})


@contextmanager
def defined(definitions: Definitions) -> Iterator[None]:
    """Add exactly these definitions to the registries inside the block."""
    with systems.defining(definitions.get("systems", {})), integrators.defining(definitions.get("integrators", {})):
        yield


def read_definitions(document: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> Definitions:
    """Return definitions from their form in JSON."""
    from nearharmonic.integrators import TableauDefinition
    from nearharmonic.systems.user_file import SystemDefinition

    kinds: dict[str, Any] = {"systems": SystemDefinition, "integrators": TableauDefinition}
    try:
        return {
            kind: {
                name: kinds[kind](**{key: _frozen(value) for key, value in one.items()})
                for name, one in members.items()
            }
            for kind, members in document.items()
        }
    except (AttributeError, KeyError, TypeError) as error:
        message = f"no definition of a system or an integrator: {document!r}"
        raise NearharmonicError(message) from error


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value


#: Libraries whose version may change the last bit of a result or the bytes of its file.
LIBRARIES = ("numpy", "numba", "llvmlite", "h5py")
#: Libraries whose version may change the numbers of a result; a new version invalidates every result.
NUMERICAL_LIBRARIES = ("numpy", "numba", "llvmlite")
#: Fields of a tableau without effect on results, and one field that follows from the coefficients.
REMARKS = ("note", "source", "symmetric")
#: Fields that are included only if a method has them.
OPTIONAL = ("square", "processor")

Task = dict[str, Any]


def task(function: str, **settings: Any) -> Task:
    """Describe the task of a rule: a package function, its settings, and the digest of all dependencies of the result.

    Returns
    -------
    dict
        ``function``, ``settings``, ``modules`` (dotted names of its module and of all modules that this imports),
        ``code`` (SHA-256, hex), ``coefficients`` (SHA-256, hex), and the names of the ``systems`` and ``integrators``
        that the settings hold. ``code`` covers these modules, those of these systems, and the versions of numpy, numba
        and llvmlite. ``coefficients`` covers these integrators. ``definitions`` has the users' systems and integrators
        among them, from which the job creates them; ``code`` covers their files.
    """
    named = named_in(settings)
    problems = [name for name in systems if name in named]
    methods = [name for name in integrators if name in named]
    return {
        "function": function,
        "settings": settings,
        "modules": closure(_module_of(function)),
        **digests(function, problems, methods),
        "systems": problems,
        "integrators": methods,
        "definitions": definitions_of(problems, methods),
    }


def digests(function: str, problems: Iterable[str], methods: Iterable[str]) -> dict[str, str]:
    """Return ``code`` and ``coefficients`` of a task from its function and the names of its systems and integrators."""
    names = list(problems)
    coefficients = coefficients_digest(integrators[name] for name in methods)
    files = {name: one.file for name, one in systems.definitions.items() if name in names and one.file is not None}
    declared = [module for name in names if (module := systems.module_of(name)) is not None]
    if not files:
        return {"code": code_digest(_module_of(function), *declared), "coefficients": coefficients}
    from nearharmonic_paper.tasks.sources import digest_of, package_modules_of

    imported = {module for place in files.values() for name in package_modules_of(place) if (module := module_of(name))}
    code = code_digest(_module_of(function), *declared, *imported)
    told = [code, *(f"{name} {digest_of(place)}" for name, place in sorted(files.items()))]
    return {"code": sha256("\n".join(told).encode()).hexdigest(), "coefficients": coefficients}


def settings_text(task: Mapping[str, Any]) -> str:
    """Return the settings of ``task`` as JSON, with users' definitions of systems and integrators."""
    more = {"definitions": task["definitions"]} if task.get("definitions") else {}
    return json.dumps({**task["settings"], **more}, sort_keys=True, default=asdict)


def settings_digest(task: Mapping[str, Any]) -> str:
    """Return the SHA-256 of the settings of ``task``."""
    return sha256(settings_text(task).encode()).hexdigest()


def _module_of(function: str) -> str:
    return function.partition(":")[0]


def function_of(task: Mapping[str, Any]) -> Any:
    """Return the package function that ``task`` names."""
    module, _, name = task["function"].partition(":")
    return getattr(import_module(module), name)


def named_in(settings: Mapping[str, Any]) -> set[str]:
    """Return every string in ``settings``, at any depth; names of systems and methods are among them."""
    return set(_texts(settings))


def _texts(value: Any) -> Iterator[str]:
    """Yield every string in a value of settings, at any depth."""
    if isinstance(value, str):
        yield value
    elif is_dataclass(value) and not isinstance(value, type):
        for member in fields(value):
            yield from _texts(getattr(value, member.name))
    elif isinstance(value, Mapping):
        for key, member in value.items():
            yield from _texts(key)
            yield from _texts(member)
    elif isinstance(value, Iterable):
        for member in value:
            yield from _texts(member)


def code_digest(*modules: str, root: Path | None = None) -> str:
    """Return the SHA-256 of the code of ``modules`` (dotted names) and of all modules that they import.

    The code of a module is its syntax tree without docstrings. Imports inside functions count; imports under
    TYPE_CHECKING do not. The digest includes versions of the libraries that affect numbers.
    """
    versions = tuple(f"{library} {library_version(library)}" for library in NUMERICAL_LIBRARIES)
    return _digest_of_running(versions, modules) if root is None else _digest_of(versions, modules, root)


def _digest_of(versions: tuple[str, ...], modules: tuple[str, ...], root: Path | None = None) -> str:
    told = (f"{module} {module_digest(module, root=root)}" for module in closure(*modules, root=root))
    return sha256("".join(f"{line}\n" for line in (*versions, *told)).encode()).hexdigest()


#: In the running package, whose files are read once, thousands of jobs ask for the same digest.
_digest_of_running = cache(_digest_of)


def coefficients_digest(tableaus: Iterable[Tableau]) -> str:
    """Return the SHA-256 of the fields of ``tableaus`` except remarks: names, labels, orders and coefficients."""
    names = [field.name for field in fields(Tableau) if field.name not in REMARKS]
    entries = ({name: getattr(one, name) for name in names} for one in tableaus)
    told = ({name: value for name, value in one.items() if name not in OPTIONAL or value} for one in entries)
    return sha256("\n".join(map(repr, told)).encode()).hexdigest()


def provenance(task: Mapping[str, Any]) -> dict[str, str]:
    """Return the provenance attributes of the result of ``task``: versions, digests and settings as JSON."""
    return {
        "package_version": library_version(PACKAGE),
        "code_digest": task["code"],
        "settings": settings_text(task),
        "coefficients_digest": task["coefficients"],
        **{f"{library}_version": library_version(library) for library in LIBRARIES},
    }


@cache
def library_version(library: str) -> str:
    """Return the version of an installed library, from the module if it is loaded.

    Reading the metadata of a library takes 25 ms.
    """
    loaded = sys.modules.get(library)
    if loaded is not None:
        return str(loaded.__version__)
    from importlib.metadata import version

    return version(library)
