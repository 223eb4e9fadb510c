"""Views of a registry: mappings of the entries that fulfil a condition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar, cast

from nearharmonic.errors import unknown_name
from nearharmonic.registry.registry import Registry

Entry = TypeVar("Entry")


class Selection(Mapping[str, Entry]):
    """A view of the entries of a registry that fulfil a condition, in the order of the registry.

    ``name`` is that of the view in the package of the registry, ``text`` its docstring.

    Raises
    ------
    UnknownNameError
        On a look-up of a name that the view does not have.
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
        from nearharmonic.registry.display import entries_table

        return entries_table([cast("Any", entry).facts for entry in self.values()])

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Registry[Entry], str]]:
        return getattr, (self._registry, self._name)
