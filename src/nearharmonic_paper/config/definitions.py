"""Systems and integrators that a config defines in addition to the registered ones, validated before any job runs."""

from __future__ import annotations

import keyword
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from nearharmonic.errors import NearharmonicError, SettingError, UnknownNameError, bad_setting
from nearharmonic.integrators import TableauDefinition, integrators, load_tableaus
from nearharmonic.registry import is_file, is_path, split_path
from nearharmonic.systems import System, systems
from nearharmonic.systems.gradients import check_gradients
from nearharmonic.systems.user_file import SystemDefinition
from nearharmonic_paper.experiments.paper.experiment import SystemSettings
from nearharmonic_paper.tasks.experiment import experiments

#: Reserved names of the workflow; names of cubes and of folders of runs are reserved too.
TAKEN = frozenset({"substeps", "sweeps"})
#: Names of parameters of the workflow's functions, and of methods of Snakemake's lists of files.
RESERVED = (
    frozenset({"cube", "integrator", "integrators", "run", "runs", "settings", "shard", "sweep", "system"})
    | {name for name in dir(list) if not name.startswith("_")}
    | {"get", "items", "keys", "values", "size", "size_files", "size_tempfiles"}
)
#: Maximum length of a user's name: it is part of file names, which have at most 255 bytes.
LONGEST = 60

_NAME = re.compile(rf"[A-Za-z][A-Za-z0-9_]{{0,{LONGEST - 1}}}", re.ASCII)
#: Keys of a system in a config that define a user's system.
_OWN = ("file", "system", "label", "q0", "p0", "energy", "parameters", "split")


def define(asked: Mapping[str, SystemSettings], methods: Mapping[str, Sequence[str]], folders: Sequence[Path]) -> None:
    """Define the systems and integrators of a config in the registries, in place of those of any previous config.

    ``asked`` has the section of each system by its name, ``methods`` the lists of integrators, names and paths of
    files, by their keys. Files are searched for in ``folders``, in this order.
    """
    defined = {name: _definition(name, one, folders) for name, one in asked.items() if _is_own(name, one)}
    systems.define(defined)
    integrators.define(_tableaus(methods, folders))
    for name in asked:
        with named(f"systems.{name}" if name in defined else "systems"):
            system = systems[name]
            if name in defined:
                _check_formulas(system)


def _check_formulas(system: System) -> None:
    """Evaluate all formulas of a user's system once, so that errors occur before any job."""
    from nearharmonic.engine.setup import energy_at_start, invariant_values

    energy_at_start(system)
    check_gradients(system)
    q, p = system.start(float)
    invariant_values(system, q, p)


def _is_own(name: str, asked: SystemSettings) -> bool:
    """Return True if a config defines the system; a registered system cannot be modified.

    The figures, tables and statements of the paper concern fixed initial values and parameters, and they refer to the
    systems by name.
    """
    given = [key for key in _OWN if getattr(asked, key) is not None]
    if name in systems.registered:
        if given:
            source = f"system: {asked.system or name}" if asked.file is None else f"file: {asked.file}"
            more = "" if given[0] in ("file", "system") else f", {given[0]}: ..."
            remedy = f"write it under another name, as own_{name}: {{{source}{more}, tau_per_stage: ...}}"
            allowed = f"{name} is a registered system, taken as it is: {remedy}"
            value = getattr(asked, given[0])
            raise bad_setting(f"systems.{name}.{given[0]}", list(value) if isinstance(value, tuple) else value, allowed)
        return False
    return bool(given)


def _definition(name: str, asked: SystemSettings, folders: Sequence[Path]) -> SystemDefinition:
    here = f"systems.{name}"
    check_name(here, name)
    if asked.file is not None and asked.system is not None:
        raise bad_setting(f"{here}.system", asked.system, "file is also given: give one of the two")
    if asked.file is None and asked.system is None:
        raise SettingError(f"{here} lacks file, the Python file that defines it, or system, a registered system")
    base = asked.system
    if base is not None and base not in systems.registered:
        with named(f"{here}.system"):
            systems[base]
    return SystemDefinition(
        file=None if asked.file is None else found(f"{here}.file", asked.file, folders),
        base=base,
        label=asked.label,
        q0=asked.q0,
        p0=asked.p0,
        parameters=tuple((asked.parameters or {}).items()),
        energy=asked.energy,
    )


def check_name(key: str, name: str) -> None:
    """Raise SettingError if a user's system or integrator cannot have the ``name``, the value of ``key``."""
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        allowed = f"a letter, then letters, digits and '_', at most {LONGEST} characters, no keyword of Python"
    elif name in TAKEN | RESERVED | _names_of_files():
        allowed = "the workflow uses this name itself"
    else:
        return
    raise bad_setting(key, name, allowed)


def _names_of_files() -> set[str]:
    """Return the names of the cubes and of the folders of runs of all experiments."""
    every = experiments().values()
    return {cube for one in every for cube in one.cubes} | {run.partition("/")[0] for one in every for run in one.runs}


def _tableaus(methods: Mapping[str, Sequence[str]], folders: Sequence[Path]) -> dict[str, TableauDefinition]:
    """Return the integrators of all files in lists of integrators."""
    defined: dict[str, TableauDefinition] = {}
    for key, entries in methods.items():
        for i, entry in enumerate(entries):
            if not is_path(entry):
                continue
            written, one = split_path(entry)
            here = f"{key}[{i}]"
            place = found(here, written, folders)
            with named(here):
                names = load_tableaus(place)
            if one and one not in names:
                raise bad_setting(here, entry, f"{written} defines {', '.join(names)}")
            for name in names:
                check_name(here, name)
                other = defined.setdefault(name, TableauDefinition(file=place, written=written))
                if other.file != place:
                    raise bad_setting(here, entry, f"{other.written} defines the integrator {name!r} as well")
    return defined


def found(key: str, written: str, folders: Sequence[Path]) -> str:
    """Return the path of a user's file, relative to the working directory if it is in there.

    It is ``written`` in the config under ``key``, and searched for in ``folders``; none is a SettingError.
    """
    for folder in folders:
        place = folder / written
        if is_file(place):
            inside = os.path.relpath(place)
            return str(place.absolute()) if inside.startswith(os.pardir) else inside
    looked = " or ".join(dict.fromkeys(str(folder.absolute()) for folder in folders))
    raise bad_setting(key, written, f"no such file in {looked}")


@contextmanager
def named(key: str) -> Iterator[None]:
    """Put ``key`` before the message of an error inside."""
    try:
        yield
    except NearharmonicError as error:
        kind = UnknownNameError if isinstance(error, UnknownNameError) else SettingError
        raise kind(f"{key}: {error}") from None


def folders_of(files: Iterable[str | os.PathLike[str]]) -> list[Path]:
    """Return the folders for the search of files: the working directory, then the folders of the config."""
    return list(dict.fromkeys([Path(), *(Path(os.path.relpath(Path(file).parent)) for file in files)]))
