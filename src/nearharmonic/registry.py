"""Registries of systems and methods, display of their entries, and Python files of users."""

from __future__ import annotations

import importlib.util
import json
import os
import pkgutil
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import cached_property
from hashlib import sha256
from html import escape
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from shlex import quote
from types import CodeType, ModuleType
from typing import Any, Protocol, TypeVar, cast

from nearharmonic.errors import NearharmonicError, UntrustedFileError, unknown_name

# --- Registries: read-only mappings of the entries that the modules of a package declare.
#
# ``nearharmonic.systems`` is the mapping of systems by name, and the package of their modules: a registry stands in
# ``sys.modules`` in the place of its package. If it only hid the package, ``import nearharmonic.systems.kepler`` would
# succeed or fail depending on earlier imports.

Entry = TypeVar("Entry")
Made_co = TypeVar("Made_co", covariant=True)


class Definition(Protocol[Made_co]):
    """A user's definition of a named entry, for example in a config: all data that another process needs to make it.

    ``file`` is the Python file of the entry, or ``base`` is the name of the registered entry that it changes; the other
    attribute is None.
    """

    @property
    def file(self) -> str | None: ...

    @property
    def base(self) -> str | None: ...

    def make(self, name: str) -> Made_co:
        """Return the entry with this ``name``."""


class Registry(Mapping[str, Entry]):
    """A mapping of names to the entries that the modules of a package declare; it takes the place of the package.

    The modules are imported lazily, at the first look-up of a key, in alphabetical order. A new entry needs only a new
    file in the folder. A module is also imported when it is looked up as an attribute.

    A process can add entries by :meth:`define`. Other names of an entry, such as its label, are keys too, and so is the
    path of a Python file: its value is the entry that the file declares. The mapping lists only names among its keys;
    other names are in it too, and paths are not, since they are read at look-up. A key that is neither declared, nor
    defined, nor a path raises UnknownNameError.

    The ``__init__`` of ``package`` makes the registry. ``kind`` is the singular noun for an entry in error messages,
    ``declares`` the variable of a module with its entries, which ``entries_of`` returns by name. ``read`` returns the
    entry of a user's file from its path and the registered names; None if paths are not keys. ``others_of`` returns the
    other names of an entry.
    """

    def __init__(
        self,
        package: str,
        kind: str,
        declares: str,
        entries_of: Callable[[ModuleType], Mapping[str, Entry]],
        read: Callable[[str, Collection[str]], Entry] | None = None,
        others_of: Callable[[Entry], Collection[str]] = lambda _: (),
    ) -> None:
        self._package, self.kind, self._declares = sys.modules[package], kind, declares
        self._entries_of, self._read, self._others_of = entries_of, read, others_of
        self._modules: dict[str, str] = {}
        self._definitions: dict[str, Definition[Entry]] = {}
        self._made: dict[str, Entry] = {}
        self._covered: tuple[frozenset[str], frozenset[str]] | None = None
        self.__doc__ = self._package.__doc__
        sys.modules[package] = cast("ModuleType", self)

    @cached_property
    def _entries(self) -> dict[str, Entry]:
        entries: dict[str, Entry] = {}
        for name in self._files():
            if hasattr(type(self), name):
                raise NearharmonicError(f"{self.__name__}: a file must not have the name {name!r} of a method")
            if not self._may_declare(name):
                continue
            module = import_module(f"{self.__name__}.{name}")
            for key, entry in self._entries_of(module).items():
                if key in entries:
                    first = self._modules[key]
                    raise NearharmonicError(f"{self.kind} {key!r} is declared in {first} and in {module.__name__}")
                entries[key] = entry
                self._modules[key] = module.__name__
        return entries

    @cached_property
    def _others(self) -> dict[str, str]:
        return {other: name for name, entry in self._entries.items() for other in self._others_of(entry)}

    def _may_declare(self, name: str) -> bool:
        """Return True if a module assigns or imports the name that declares entries, without importing it."""
        try:
            source = Path(self.__path__[0], f"{name}.py").read_bytes()
        except OSError:  # a folder, or a missing file
            return True
        return re.search(rb"^\s*(from\b.*\b)?%b\b" % self._declares.encode(), source, re.MULTILINE) is not None

    def _files(self) -> list[str]:
        return sorted(info.name for info in pkgutil.iter_modules(self.__path__))

    def __getitem__(self, name: str | os.PathLike[str]) -> Entry:
        key: Any = self.name_of(os.fspath(name) if isinstance(name, os.PathLike) else name)
        is_named = self._has(key)
        if not is_named and (self._read is None or not is_path(key)):
            raise unknown_name(self.kind, key, self, self._others)
        if self._covered is not None:
            names, modules = self._covered
            if not is_named or not (key in names or self._modules.get(key) in modules):
                message = "is looked up, but no digest of the task covers it: name it in the settings"
                raise NearharmonicError(f"{self.kind} {key!r} {message}")
        if not is_named and self._read is not None:
            return self._read(key, self.registered)
        return self.entry(key)

    def name_of(self, key: str) -> str:
        """Return the name of the entry with this name or other name; a key that is neither is returned as it is."""
        return key if self._has(key) or not isinstance(key, str) else self._others.get(key, key)

    def entry(self, name: str) -> Entry:
        """Return the entry of a registered name, covered by digests or not, for selection by its properties."""
        name = self.name_of(name)
        if name in self._definitions and name not in self._made:
            self._made[name] = self._definitions[name].make(name)
        return self._made[name] if name in self._definitions else self._entries[name]

    @property
    def registered(self) -> tuple[str, ...]:
        """Names of the entries that the modules of the package declare."""
        return tuple(self._entries)

    @property
    def definitions(self) -> Mapping[str, Definition[Entry]]:
        """The entries that this process has defined besides the registered ones, by name."""
        return dict(self._definitions)

    def define(self, definitions: Mapping[str, Definition[Entry]]) -> None:
        """Add entries to the registered ones, whose names they must not have, and remove all earlier definitions.

        Each entry is made lazily, at its first look-up.
        """
        for name in definitions:
            if name in self._entries:
                message = f"{self.kind} {name!r} is declared in {self._modules[name]} already: choose another name"
                raise NearharmonicError(message)
        self._definitions, self._made = dict(definitions), {}

    @contextmanager
    def defining(self, definitions: Mapping[str, Definition[Entry]]) -> Iterator[None]:
        """Add entries as :meth:`define` does, only inside the block."""
        before, made = self._definitions, self._made
        try:
            self.define(definitions)
            yield
        finally:
            self._definitions, self._made = before, made

    @contextmanager
    def restricted(self, names: Collection[str], modules: Collection[str]) -> Iterator[None]:
        """Refuse look-ups of entries other than ``names`` and the entries of ``modules``, inside the block."""
        self._covered = frozenset(names), frozenset(modules)
        try:
            yield
        finally:
            self._covered = None

    def __contains__(self, name: object) -> bool:
        return self._has(name) or (isinstance(name, str) and self._has(self.name_of(name)))

    def _has(self, name: object) -> bool:
        return isinstance(name, str) and (name in self._entries or name in self._definitions)

    def __iter__(self) -> Iterator[str]:
        yield from self._entries
        yield from self._definitions

    def __len__(self) -> int:
        return len(self._entries) + len(self._definitions)

    def module_of(self, name: str) -> str | None:
        """Return the dotted name of the module that declares ``name`` or its base; None if a file defines it."""
        name = self.name_of(name)
        if not self._has(name):
            raise unknown_name(self.kind, name, self)
        base = self._definitions[name].base if name in self._definitions else name
        return None if base is None else self._modules[base]

    def __getattr__(self, name: str) -> Any:
        # Python looks up private names that a module may not have, and names of the package before it is complete.
        package = self.__dict__["_package"]
        if not hasattr(package, name) and not name.startswith("_") and name in self._files():
            return import_module(f"{self.__name__}.{name}")
        return getattr(package, name)

    def __dir__(self) -> list[str]:
        public = (name for name in dir(type(self)) if name[0] != "_")
        return sorted({*dir(self._package), *self._files(), *public})

    def __repr__(self) -> str:
        return f"<module {self.__name__!r}, a mapping of {len(self)} {self.kind}s: {', '.join(self)}>"

    def _repr_html_(self) -> str:

        return entries_table([cast("Any", entry).facts for entry in self.values()])

    # A registry is equal only to itself and can be hashed, like a module; Mapping would compare contents.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __reduce__(self) -> tuple[Callable[[str], ModuleType], tuple[str]]:
        return import_module, (self.__name__,)  # a copy, or a loaded pickle, is the registry itself


#: A file that is no Python is refused as such, and not as an unknown name.
_ENDINGS = (".py", ".toml", ".json", ".csv", ".yaml", ".yml")


def is_path(name: object) -> bool:
    """Return True if a name is the path of a file, of a Python file optionally with ``:`` and an entry's name in it."""
    return isinstance(name, str) and (name.endswith(_ENDINGS) or ".py:" in name or "/" in name or os.sep in name)


def split_path(place: str) -> tuple[str, str]:
    """Return the path of a Python file, and the name of the entry after a colon, "" without a colon."""
    path, colon, entry = place.rpartition(":")
    return (path, entry) if colon and path.endswith(".py") else (place, "")


# --- Display of objects: in a notebook an object is a line of text and an HTML table.

#: Largest number of characters of a cell.
LONGEST = 200


def line(kind: str, facts: Mapping[str, object]) -> str:
    """Return one line for an object of the class ``kind``.

    The first of ``facts`` is the name of the object, and the last, its source, is omitted.
    """
    (_, name), *others, _ = facts.items()
    return f"<{kind} {name}: {', '.join(f'{key} {value}' for key, value in others if value not in ('', None))}>"


def facts_table(kind: str, facts: Mapping[str, object]) -> str:
    """Return the facts of an object as an HTML table with a row for each fact."""
    rows = "".join(f"<tr><th>{_cell(key)}</th><td>{_cell(value)}</td></tr>" for key, value in facts.items())
    return f"<table><caption>{escape(kind)}</caption>{rows}</table>"


def entries_table(entries: Sequence[Mapping[str, object]]) -> str:
    """Return objects of one kind as an HTML table with a row for each object."""
    header = dict.fromkeys(key for entry in entries for key in entry)
    rows = "".join(_row("td", (entry.get(key, "") for key in header)) for entry in entries)
    return f"<table><thead>{_row('th', header)}</thead><tbody>{rows}</tbody></table>"


def _row(tag: str, cells: Iterable[object]) -> str:
    return f"<tr>{''.join(f'<{tag}>{_cell(cell)}</{tag}>' for cell in cells)}</tr>"


def _cell(value: object) -> str:
    text = str(value)
    return escape(text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}...")


# --- Views: mappings of the entries that fulfil a condition.


class Selection(Mapping[str, Entry]):
    """A view of the entries of a registry that fulfil a condition, in the order of the registry.

    ``name`` is the name of the view in the package of the registry, ``text`` its docstring.
    """

    def __init__(self, registry: Registry[Entry], name: str, fulfils: Callable[[Entry], bool], text: str = "") -> None:
        self._registry, self._name, self._fulfils = registry, name, fulfils
        self.__doc__ = text or type(self).__doc__

    @property
    def registered(self) -> tuple[str, ...]:
        """Names of the entries that the modules of the package declare."""
        return tuple(name for name in self._registry.registered if name in self)

    def __getitem__(self, name: str) -> Entry:
        name = self._registry.name_of(name)
        if name not in self:
            raise unknown_name(self._registry.kind, name, self)
        return self._registry[name]

    def __contains__(self, name: object) -> bool:
        return name in self._registry and self._fulfils(self._registry.entry(str(name)))

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._registry if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def module_of(self, name: str) -> str | None:
        """Return the dotted name of the module that declares ``name``, as :meth:`Registry.module_of` returns it."""
        return self._registry.module_of(name)

    def __repr__(self) -> str:
        return f"<{self._registry.__name__}.{self._name}, a mapping of {len(self)}: {', '.join(self)}>"

    def _repr_html_(self) -> str:

        return entries_table([cast("Any", entry).facts for entry in self.values()])

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Registry[Entry], str]]:
        return getattr, (self._registry, self._name)


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
    """Raise an error for users' files that :func:`trusting_only` refuses, with the SHA-256 of their bytes."""
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


def load_file(place: str | os.PathLike[str], declares: str, error: type[NearharmonicError]) -> ModuleType:
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
        if known == {file: file.read_bytes() for file in known if is_file(file)}:
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


def pickled(package: str, name: str, entry: Any) -> tuple[Any, ...] | None:
    """Return the pickled form of an entry that another process can look up, or None.

    An entry that the registry of a ``package`` declares is looked up by its name there, and one of a user's file by the
    variable ``name`` that the file assigns.
    """
    registry: Any = sys.modules[package]
    if entry.name in registry.registered and registry.get(entry.name) is entry:
        return registry.__getitem__, (entry.name,)
    for place, (module, files) in _LOADED.items():
        if getattr(module, name, None) is entry:
            return declared_in, (str(place), name, _digest_of(files))
    return None


def declared_in(place: str, name: str, digest: str | None = None) -> Any:
    """Return the value of the variable ``name`` of a user's file, whose texts have this ``digest`` if it is given."""
    module = load_file(place, f"It defined {name}", NearharmonicError)
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
