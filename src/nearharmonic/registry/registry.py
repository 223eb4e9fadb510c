"""Registries: read-only mappings of the entries that the modules of a package declare.

``nearharmonic.systems`` is the mapping of systems by name, and the package of their modules: a registry stands in
``sys.modules`` in the place of its package. If it only hid the package, ``import nearharmonic.systems.kepler`` would
succeed or fail depending on earlier imports.

Views are mappings of the entries that fulfil a condition. In a notebook an object is a line of text and an HTML table.
"""

from __future__ import annotations

import os
import pkgutil
import re
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cached_property
from html import escape
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, TypeVar, cast

from nearharmonic.errors import NearharmonicError, unknown_name

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
        """Return the entry of a name that the registry has, covered by digests or not: to select by what it is."""
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
        """Refuse look-ups of entries other than ``names``, and those that ``modules`` declare, inside the block."""
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
        # Python looks up private names that a module may not have, and those of the package before it is complete.
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


class Selection(Mapping[str, Entry]):
    """A view of the entries of a registry that fulfil a condition, in the order of the registry.

    ``name`` is that of the view in the package of the registry, ``text`` its docstring.
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
