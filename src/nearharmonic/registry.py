"""Registries: read-only mappings filled from a folder of modules; a missing key names its nearest match."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from types import ModuleType
from typing import Generic, TypeVar

from nearharmonic.errors import NearharmonicError, unknown_name

Entry = TypeVar("Entry")


class Registry(Mapping[str, Entry], Generic[Entry]):
    """The entries that the modules of one package declare, by name.

    The modules are imported at the first look-up, in alphabetical order, so that importing the package stays cheap and
    a new file in the folder is all a new entry takes.

    Raises:
        UnknownNameError: on a look-up of a name that no module declares.
    """

    def __init__(self, package: str, kind: str, entries_of: Callable[[ModuleType], Mapping[str, Entry]]) -> None:
        self._package, self.kind, self._entries_of = package, kind, entries_of
        self._entries: dict[str, Entry] | None = None
        self._modules: dict[str, str] = {}

    def _load(self) -> dict[str, Entry]:
        if self._entries is None:
            entries: dict[str, Entry] = {}
            folder = import_module(self._package).__path__
            for info in sorted(pkgutil.iter_modules(folder), key=lambda i: i.name):
                module = import_module(f"{self._package}.{info.name}")
                for name, entry in self._entries_of(module).items():
                    if name in entries:
                        first = self._modules[name]
                        raise NearharmonicError(f"{self.kind} {name!r} is declared in {first} and in {module.__name__}")
                    entries[name] = entry
                    self._modules[name] = module.__name__
            self._entries = entries
        return self._entries

    def __getitem__(self, name: str) -> Entry:
        entries = self._load()
        if not isinstance(name, str) or name not in entries:
            raise unknown_name(self.kind, name, entries)
        return entries[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._load()

    def __iter__(self) -> Iterator[str]:
        return iter(self._load())

    def __len__(self) -> int:
        return len(self._load())

    def module_of(self, name: str) -> str:
        """Dotted name of the module that declares ``name``."""
        self[name]
        return self._modules[name]
