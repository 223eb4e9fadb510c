"""Python files of users as modules: loaded once, and again after an edit of the file or of modules that it imports."""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import Any

from nearharmonic.errors import NearharmonicError
from nearharmonic.registry.trust import check_trust

#: Size and time of the last change of each file that a module was loaded from.
Files = dict[Path, tuple[int, int]]

_LOADED: dict[Path, tuple[ModuleType, Files]] = {}


def load(place: str | os.PathLike[str], declares: str, error: type[NearharmonicError]) -> ModuleType:
    """Return the module of a Python file; it is loaded again if one of its files has changed.

    The file may import modules of its own folder. They are private: two files in different folders may import different
    modules ``common``.

    Parameters
    ----------
    declares : str
        Expected content of the file, for the message if it does not exist.
    error : type
        Class of the error.

    Raises
    ------
    NearharmonicError
        Of the class ``error``: the file does not exist, its name does not end in ``.py``, or it fails when it is run.
    UntrustedFileError
        The file must not be run in this block.
    """
    path = Path(place)
    if not is_file(path):
        raise error(f"{path}: no such file. {declares}")
    check_trust(path)
    key = path.resolve()
    if key in _LOADED:
        module, files = _LOADED[key]
        if _state(files) == files:
            return module
    spec = importlib.util.spec_from_file_location(f"nearharmonic_user_{path.stem}", key)
    if spec is None or spec.loader is None:
        raise error(f"{path} is no Python file: its name must end in .py. {declares}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look up their module
    files = {key: (0, 0)}
    try:
        with _own_modules(key.parent, files):
            spec.loader.exec_module(module)
    except NearharmonicError:
        raise
    except (Exception, SystemExit) as fault:
        raise error(f"{path} cannot be run: {type(fault).__name__}: {fault}") from fault
    _LOADED[key] = module, _state(files)
    return module


def near_miss(module: ModuleType, name: str, kind: type) -> str:
    """Return the reason why a user's module does not define ``name``, a ``kind`` or a tuple of them, for a message."""
    if hasattr(module, name):
        return f": its {name} is of type {type(getattr(module, name)).__name__}"
    alike = [
        key
        for key, value in vars(module).items()
        if isinstance(value, kind) or (isinstance(value, list | tuple) and value and isinstance(value[0], kind))
    ]
    nearest = get_close_matches(name, sorted(alike, key=str.upper), n=1, cutoff=0.6) or alike[:1]
    return f"; did you mean its {nearest[0]!r}?" if nearest else ""


def place_of(name: str, value: object) -> Path | None:
    """Return the loaded file in which ``name`` is ``value``, if there is one."""
    return next((path for path, (module, _) in _LOADED.items() if getattr(module, name, None) is value), None)


def pickled(package: str, name: str, entry: Any) -> tuple[Any, ...] | None:
    """Return the pickled form of an entry that another process can look up, or None.

    Parameters
    ----------
    package : str
        Dotted name of the registry; an entry that it declares is looked up by its name.
    name : str
        Variable that a user's file assigns; an entry of such a file is looked up there.
    entry : object
        The entry.
    """
    registry: Any = sys.modules[package]
    if entry.name in registry.registered and registry.get(entry.name) is entry:
        return registry.__getitem__, (entry.name,)
    place = place_of(name, entry)
    return None if place is None else (declared_in, (str(place), name))


def declared_in(place: str, name: str) -> Any:
    """Return the value of the variable ``name`` of a user's file.

    Raises
    ------
    NearharmonicError
        The file cannot be loaded, or does not assign it.
    """
    module = load(place, f"It defined {name}", NearharmonicError)
    if not hasattr(module, name):
        raise NearharmonicError(f"{place} does not define {name} any more")
    return getattr(module, name)


def is_file(path: Path) -> bool:
    """Return True if the file exists; False for an impossible path too."""
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long or invalid
        return False


def _state(files: Files) -> Files:
    """Return the present state of ``files``, without deleted ones."""
    found: Files = {}
    for path in files:
        try:
            told = path.stat()
        except OSError:
            continue
        found[path] = told.st_size, told.st_mtime_ns
    return found


@contextmanager
def _own_modules(folder: Path, files: Files) -> Iterator[None]:
    """Allow imports of modules in ``folder`` inside the block, and add their files to ``files``."""
    before = set(sys.modules)
    # Bytecode would hide a second edit in one second.
    writes, sys.dont_write_bytecode = sys.dont_write_bytecode, True
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(folder))
        sys.dont_write_bytecode = writes
        for name in set(sys.modules) - before:
            origin = getattr(sys.modules[name], "__file__", None)
            if origin and Path(origin).is_relative_to(folder) and "site-packages" not in Path(origin).parts:
                files[Path(origin)] = (0, 0)
                del sys.modules[name]
