"""Users' Python files: loaded once, and again after an edit; trust in them."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from hashlib import sha256
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from shlex import quote
from types import CodeType, ModuleType
from typing import Any

from nearharmonic.errors import NearharmonicError, UntrustedFileError

# --- Trust in users' Python files: commands that read results run none of them but those on their own command line.

#: Environment variable with the trusted files as a JSON list of absolute paths: child processes obey it too.
TRUSTED = "NEARHARMONIC_TRUSTED"


@contextmanager
def trusting_only(files: Iterable[str | os.PathLike[str]]) -> Iterator[None]:
    """Refuse inside the block, and in processes that start there, to run any user's file except ``files``.

    A block inside another one cannot allow more than the outer block.
    """
    before = os.environ.get(TRUSTED)
    allowed = {str(Path(file).resolve()) for file in files}
    if before is not None:
        allowed &= set(json.loads(before))
    os.environ[TRUSTED] = json.dumps(sorted(allowed))
    try:
        yield
    finally:
        if before is None:
            del os.environ[TRUSTED]
        else:
            os.environ[TRUSTED] = before


def is_trusted(file: str | os.PathLike[str]) -> bool:
    """Return True if a user's file may be run: any file outside of the blocks of :func:`trusting_only`."""
    given = os.environ.get(TRUSTED)
    return given is None or str(Path(file).resolve()) in json.loads(given)


def check_trust(*files: str | os.PathLike[str]) -> None:
    """Raise an error for users' files that are not among those of :func:`trusting_only`, with the SHA-256 of their
    bytes.
    """
    refused = [os.fspath(file) for file in files if not is_trusted(file)]
    if refused:
        told = ", ".join(f"{file} (SHA-256 {_file_digest(Path(file))})" for file in refused)
        options = " ".join(f"--trust {quote(file)}" for file in refused)
        is_code = "is Python code, which" if len(refused) == 1 else "are Python code, which"
        raise UntrustedFileError(f"{told} {is_code} is not run: read it, and allow it by {options}")


def _file_digest(file: Path) -> str:
    return sha256(file.read_bytes()).hexdigest() if file.is_file() else "unknown, there is no such file"


# --- Python files of users as modules: loaded once, and again after an edit of the file or of modules that it imports.
#
# They are compiled from their text always. Python's kept bytecode hides an edit within a second that keeps the length.

#: Text of each file that a module was loaded from.
Files = dict[Path, bytes]

_PACKAGE = __package__.partition(".")[0]
_LOADED: dict[Path, tuple[ModuleType, Files]] = {}


def load(place: str | os.PathLike[str], declares: str, error: type[NearharmonicError]) -> ModuleType:
    """Return the module of a Python file; it is loaded again if one of its files has changed.

    The file may import modules of its own folder. They are private: two files in different folders may import different
    modules ``common``. A file that does not exist, is no Python file or fails when it is run raises an ``error`` of
    this class, and one that must not be run in this block UntrustedFileError. ``declares`` is its expected content, for
    the message.
    """
    path = Path(place)
    if not is_file(path):
        raise error(f"{path}: no such file. {declares}")
    check_trust(path)
    key = path.resolve()
    if key in _LOADED:
        module, known = _LOADED[key]
        if _state(known) == known:
            return module
    name, files = f"nearharmonic_user_{path.stem}", Files()
    if key.suffix != ".py":
        raise error(f"{path} is no Python file: its name must end in .py. {declares}")
    spec = importlib.util.spec_from_file_location(name, key, loader=_TextLoader(name, key, files))
    module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
    sys.modules[name] = module  # dataclasses look up their module
    try:
        with _own_modules(key.parent, files):
            spec.loader.exec_module(module)  # type: ignore[union-attr]
    except NearharmonicError:
        raise
    except (Exception, SystemExit) as fault:
        raise error(f"{path} cannot be run: {type(fault).__name__}: {fault}") from fault
    _LOADED[key] = module, files
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

    An entry that the registry of a ``package`` declares is looked up by its name there, and one of a user's file by the
    variable ``name`` that the file assigns.
    """
    registry: Any = sys.modules[package]
    if entry.name in registry.registered and registry.get(entry.name) is entry:
        return registry.__getitem__, (entry.name,)
    place = place_of(name, entry)
    return None if place is None else (declared_in, (str(place), name, _digest_of(_LOADED[place][1])))


def declared_in(place: str, name: str, digest: str | None = None) -> Any:
    """Return the value of the variable ``name`` of a user's file, whose texts have this ``digest`` if it is given."""
    module = load(place, f"It defined {name}", NearharmonicError)
    if digest not in (None, _digest_of(_LOADED[Path(place).resolve()][1])):
        raise NearharmonicError(f"{place}, or a module that it imports, has changed since its {name} was pickled")
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
    """Return the present texts of ``files``, without deleted ones."""
    return {path: path.read_bytes() for path in files if is_file(path)}


def _digest_of(files: Files) -> str:
    return sha256(repr(sorted((path.name, text) for path, text in files.items())).encode()).hexdigest()


class _TextLoader(SourceFileLoader):
    """Loader that compiles the text of a module, and adds the text to ``files``."""

    def __init__(self, name: str, path: Path, files: Files) -> None:
        super().__init__(name, str(path))
        self._files = files

    def get_code(self, fullname: str) -> CodeType:
        text = self._files[Path(self.path)] = self.get_data(self.path)
        return self.source_to_code(text, self.path)


class _Beside:
    """Finder of the modules in a folder, and of those in packages of the folder; ``found`` are their names."""

    def __init__(self, folder: Path, files: Files) -> None:
        self._folder, self._files = folder, files
        self.found: set[str] = set()

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: Any = None) -> ModuleSpec | None:
        """Return the spec of a module of the folder; None passes the name to the next finder."""
        above = name.rpartition(".")[0]
        if above and above not in self.found:
            return None
        spec = PathFinder.find_spec(name, path if above else [str(self._folder), *sys.path])
        if spec is None or not (above or self._has(name, spec)):
            return None
        self.found.add(name)
        if type(spec.loader) is SourceFileLoader:
            spec.loader = _TextLoader(name, Path(spec.loader.path), self._files)
        return spec

    def _has(self, name: str, spec: ModuleSpec) -> bool:
        place = Path(spec.origin or next(iter(spec.submodule_search_locations or ()), ""))
        inside = place.relative_to(self._folder).parts if place.is_relative_to(self._folder) else ("",)
        return inside[0].partition(".")[0] == name


@contextmanager
def _own_modules(folder: Path, files: Files) -> Iterator[None]:
    """Allow imports of modules in ``folder`` inside the block, and add their texts to ``files``.

    A module of the same name that the program has imported stands aside, unless it is part of Python or installed.
    """
    others = {name.partition(".")[0] for name in sys.modules} - sys.stdlib_module_names - {_PACKAGE, "__main__"}
    beside = {name for name in others if _is_beside(folder, name)}
    hidden = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in beside}
    for name in hidden:
        del sys.modules[name]
    finder: Any = _Beside(folder, files)
    sys.meta_path.insert(0, finder)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        for name in finder.found:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)


def _is_beside(folder: Path, name: str) -> bool:
    """Return True if a folder has a module of the name of an imported one, which is not installed."""
    place = getattr(sys.modules.get(name), "__file__", None)
    if "-packages" in str(place):
        return False
    has_text = is_file(folder / f"{name}.py") or is_file(folder / name / "__init__.py")
    return has_text or (place is None and (folder / name).is_dir())
