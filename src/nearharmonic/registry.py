"""Registries: packages of data files that are read-only mappings of what their files declare.

``nearharmonic.systems`` is a package and at the same time the mapping of its systems by name. A module that is more
than a module is an exception in this project, with one reason: a registry shares its name with its folder. If
``nearharmonic.systems`` were an object that hides the package, ``import nearharmonic.systems.kepler`` would fail or
work depending on what was imported before.
"""

from __future__ import annotations

import pkgutil
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any, Generic, TypeVar, cast

from nearharmonic.errors import NearharmonicError, unknown_name

Entry = TypeVar("Entry")


class Registry(ModuleType, Mapping[str, Entry], Generic[Entry]):
    """A package that maps names to the entries declared by its modules; :func:`make_registry` makes one.

    The modules are imported at the first look-up of a key, in alphabetical order: importing the package stays cheap,
    and a new entry takes a new file in the folder and nothing else. A module is imported also when it is looked up as
    an attribute of the package.

    Raises
    ------
    UnknownNameError
        On a look-up of a key that no module declares.
    """

    _kind: str
    _entries_of: Callable[[ModuleType], Mapping[str, Entry]]
    _entries: dict[str, Entry] | None
    _modules: dict[str, str]
    _covered: tuple[frozenset[str], frozenset[str]] | None

    def _load(self) -> dict[str, Entry]:
        if self._entries is None:
            entries: dict[str, Entry] = {}
            for name in self._files():
                if hasattr(type(self), name):
                    raise NearharmonicError(f"{self.__name__}: a file must not have the name {name!r} of a method")
                module = import_module(f"{self.__name__}.{name}")
                for key, entry in self._entries_of(module).items():
                    if key in entries:
                        first = self._modules[key]
                        raise NearharmonicError(f"{self._kind} {key!r} is declared in {first} and in {module.__name__}")
                    entries[key] = entry
                    self._modules[key] = module.__name__
            self._entries = entries
        return self._entries

    def _files(self) -> list[str]:
        return sorted(info.name for info in pkgutil.iter_modules(self.__path__))

    def __getitem__(self, name: str) -> Entry:
        entries = self._load()
        if not isinstance(name, str) or name not in entries:
            raise unknown_name(self._kind, name, entries)
        if self._covered is not None and name not in self._covered[0] and self._modules[name] not in self._covered[1]:
            message = (
                f"{self._kind} {name!r} is looked up, but no digest of the task covers it: name it in the settings"
            )
            raise NearharmonicError(message)
        return entries[name]

    @contextmanager
    def restricted(self, names: Collection[str], modules: Collection[str]) -> Iterator[None]:
        """Let only some entries be looked up inside the block.

        Parameters
        ----------
        names
            Names of entries.
        modules
            Dotted names of modules; the entries that they declare are allowed as well.

        Raises
        ------
        NearharmonicError
            Inside, on the look-up of any other entry.
        """
        self._covered = frozenset(names), frozenset(modules)
        try:
            yield
        finally:
            self._covered = None

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._load()

    def __iter__(self) -> Iterator[str]:
        return iter(self._load())

    def __len__(self) -> int:
        return len(self._load())

    def module_of(self, name: str) -> str:
        """Dotted name of the module that declares ``name``."""
        if name not in self:
            raise unknown_name(self._kind, name, self._load())
        return self._modules[name]

    def __getattr__(self, name: str) -> Any:
        # Python asks modules for private names that they do not have, __path__ of a plain module among them.
        if not name.startswith("_") and name in self._files():
            return import_module(f"{self.__name__}.{name}")
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._files(), *(name for name in dir(type(self)) if name[0] != "_")})

    def __repr__(self) -> str:
        return f"<module {self.__name__!r}, a mapping of {len(self)} {self._kind}s: {', '.join(self)}>"

    # The mapping of a package is equal to itself alone, and a module can be hashed: Mapping would compare contents.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def __reduce__(self) -> tuple[Callable[[str], ModuleType], tuple[str]]:
        return import_module, (self.__name__,)  # a copy, or what a pickle is read into, is the package itself


def make_registry(package: str, kind: str, entries_of: Callable[[ModuleType], Mapping[str, Entry]]) -> Registry[Entry]:
    """Make an imported package the registry of what its modules declare.

    Parameters
    ----------
    package
        Dotted name of the package; its ``__init__`` calls this function.
    kind
        What an entry is called in error messages, singular.
    entries_of
        Function of a module that returns its entries by name, an empty mapping if it declares none.

    Returns
    -------
    Registry
        The module itself, as it stands in ``sys.modules``.
    """
    module = sys.modules[package]
    module.__class__ = Registry
    made = cast("Registry[Entry]", module)
    made._kind, made._entries_of, made._entries, made._modules = kind, entries_of, None, {}
    made._covered = None
    return made
