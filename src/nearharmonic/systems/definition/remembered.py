"""Results of functions of a system that the system keeps itself, so that they are freed together with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial, update_wrapper
from typing import TYPE_CHECKING, Any, Generic, TypeVar
from weakref import WeakSet

if TYPE_CHECKING:
    from nearharmonic.systems.definition.system import System

Result = TypeVar("Result")


class remembered(Generic[Result]):
    """Decorator of a function of a system and of hashable settings: it is evaluated once for a system and settings.

    ``functools.cache`` would keep systems that are no longer used, with a megabyte of machine code each.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function, self._name = function, f"{function.__module__}.{function.__qualname__}"
        self._systems: WeakSet[System] = WeakSet()
        update_wrapper(self, function)

    def __call__(self, system: System, *args: Any, **settings: Any) -> Result:
        """Return the result of the function for these settings."""
        found = vars(system).get(self._name)
        if found is None:
            found = vars(system)[self._name] = cache(partial(self._function, system))
            self._systems.add(system)
        result: Result = found(*args, **settings)
        return result

    @property
    def misses(self) -> int:
        """Evaluations for systems that are still used."""
        return sum(vars(system)[self._name].cache_info().misses for system in self._systems)

    def cache_clear(self) -> None:
        """Forget the results for all systems."""
        for system in list(self._systems):
            del vars(system)[self._name]
        self._systems.clear()
