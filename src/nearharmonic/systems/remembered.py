"""Results of functions of a system that the system keeps itself, so that they are freed together with it.

They hold for the values that its formulas read from elsewhere, which :func:`read_by` returns.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from functools import cache, partial, update_wrapper
from hashlib import sha256
from numbers import Number
from types import CellType, CodeType, FunctionType, MethodType, ModuleType, SimpleNamespace
from typing import Any, Generic, TypeVar, cast
from weakref import WeakSet

Result = TypeVar("Result")

#: Names of Python's own modules, and of this package.
_INSTALLED = sys.stdlib_module_names | {__package__.partition(".")[0]}


class remembered(Generic[Result]):
    """Decorator of a function of a system and of hashable settings: it is evaluated once for a system and settings.

    ``functools.cache`` would keep systems that are no longer used, with a megabyte of machine code each.
    """

    def __init__(self, function: Callable[..., Result]) -> None:
        self._function, self._name = function, f"{function.__module__}.{function.__qualname__}"
        self._systems: WeakSet[Any] = WeakSet()
        update_wrapper(self, function)

    def __call__(self, system: Any, *args: Any, **settings: Any) -> Result:
        """Return the result of the function for these settings."""
        found = vars(system).get(self._name)
        if found is None:
            found = vars(system)[self._name] = cache(partial(self._evaluated, system))
            self._systems.add(system)
        return cast("Result", found(*args, **settings))

    def _evaluated(self, system: Any, *args: Any, **settings: Any) -> Result:
        result = self._function(system, *args, **settings)
        system.read_again()  # a formula that counts its calls changes what it reads
        return result

    @property
    def misses(self) -> int:
        """Evaluations for systems that are still used."""
        found = (vars(system).get(self._name) for system in self._systems)
        return sum(one.cache_info().misses for one in found if one is not None)

    def cache_clear(self) -> None:
        """Forget the results for all systems."""
        for system in list(self._systems):
            vars(system).pop(self._name, None)
        self._systems.clear()


def read_by(*functions: object) -> list[object]:
    """Return the code of functions and the values that they read from elsewhere, in a form that can be compared.

    Such values are variables of enclosing functions, global variables, defaults, attributes of modules and of objects,
    and contents of containers and arrays. Objects of installed packages are compared by identity.
    """
    found: list[object] = []
    names: set[str] = {"__call__"}
    met: set[Any] = set()
    spaces: list[Any] = []
    waiting: list[Any] = [*functions]
    while waiting:
        value = waiting.pop()
        value = getattr(value, "py_func", value)  # of a function of numba
        if value is None or isinstance(value, str | bytes | Number):
            found.append((type(value), repr(value)))
        elif id(value) not in met:
            met.add(id(value))
            if isinstance(value, ModuleType) or (isinstance(value, type) and not _is_installed(value.__module__)):
                spaces.append(value)
            else:
                told, parts = _parts(value, names)
                found.append((told, len(parts)))
                waiting += parts
        if not waiting:
            read = {(id(space), name): space for space in spaces for name in sorted(names & vars(space).keys())}
            waiting = [vars(space)[name] for (number, name), space in read.items() if (number, name) not in met]
            met |= read.keys()
    return found


def _parts(value: Any, names: set[str]) -> tuple[object, list[Any]]:
    """Return a value without its parts, and the parts; parts of modules and classes have the ``names`` in functions."""
    told, parts = cast("object", ""), list[Any]()
    home = value if isinstance(value, type | FunctionType) else type(value)
    if isinstance(value, MethodType):
        parts = [value.__func__, value.__self__]
    elif isinstance(value, partial):
        parts = [value.func, value.args, value.keywords]
    elif isinstance(value, Mapping):
        parts = [*value.keys(), *value.values()]
    elif isinstance(value, list | tuple | AbstractSet):
        parts = sorted(value, key=repr) if isinstance(value, AbstractSet) else [*value]
    elif not isinstance(value, type) and getattr(getattr(value, "dtype", None), "kind", "O") != "O":
        told = value.dtype.str, value.shape, sha256(value.tobytes()).digest()
    elif home is not SimpleNamespace and _is_installed(str(home.__module__)):
        told = id(value)
    elif isinstance(value, FunctionType):
        codes = list(_codes(value.__code__))
        read = {name for code in codes for name in code.co_names}
        names |= read
        told = [(code.co_code, repr([x for x in code.co_consts if not isinstance(x, CodeType)])) for code in codes]
        cells = [cell for cell in value.__closure__ or () if cell != CellType()]  # without variables to come
        parts = [value.__globals__[name] for name in sorted(read & value.__globals__.keys())]
        parts += [*(cell.cell_contents for cell in cells), value.__defaults__, value.__kwdefaults__]
        parts.append(getattr(value, "__wrapped__", None))
    else:
        parts = [type(value), *getattr(value, "__dict__", {}).values()]
    return told, parts


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _is_installed(module: str) -> bool:
    """Return True for a module of Python, of an installed package, or of this one."""
    top = module.partition(".")[0]
    place = str(getattr(sys.modules.get(module), "__file__", ""))
    return top in _INSTALLED or "-packages" in place
