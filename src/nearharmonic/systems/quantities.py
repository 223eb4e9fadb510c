"""Parameters and observables of a system."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Any

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.numerics.written import decimal

#: A coordinate tuple of any number type: float, numpy array, mpf, or a number traced into a kernel.
Vector = tuple[Any, ...]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A constant of a system.

    Parameters
    ----------
    value : str
        Exact decimal; a float means the decimal that it prints as.
    unit : str
        Unit, "1" for none.
    meaning : str
        The constant in words.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> nh.Parameter(value=0.1, unit="h-1", meaning="rate")
    Parameter(value='0.1', unit='h-1', meaning='rate')
    """

    value: str
    unit: str = "1"
    meaning: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "value", decimal(self.value))


@dataclass(frozen=True, kw_only=True)
class Observable:
    """A function of the states of a system, with its unit and meaning.

    Parameters
    ----------
    function : callable
        ``f(q, p, *parameters)``, a number or a sequence of numbers, for tuples q and p of d numbers of any type.
    unit : str
        Unit of the value, "1" for none.
    meaning : str
        The value in words.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> distance = nh.Observable(function=lambda q, p: q[0] * q[0], unit="1", meaning="square of the distance")
    >>> distance((3.0,), (0.0,))
    9.0
    """

    function: Callable[..., Any]
    unit: str
    meaning: str

    def __call__(self, q: Vector, p: Vector, *parameters: Any) -> Any:
        """Return the value, or a sequence of values, at states of any number type, for the parameters of the system."""
        return self.function(q, p, *parameters)


class ReadOnly(dict[str, Any]):
    """A mapping of a system, which does not change: what is derived from it would not."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        what = "the mappings of a system are read-only: make a copy of the system by dataclasses.replace"
        raise SystemDefinitionError(what)

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnly, (dict(self),)


def is_list(values: Any) -> bool:
    """Return True if ``values`` is an ordered collection of numbers: not text, bytes, a mapping or a set."""
    other = isinstance(values, str | bytes | bytearray | memoryview | Mapping | AbstractSet)
    return isinstance(values, Iterable) and not other and getattr(values, "ndim", 1) > 0


def fixed(values: Any) -> Any:
    """Return lists and arrays of any depth as tuples, which do not change; return other objects unchanged."""
    if not is_list(values) or not hasattr(values, "__len__"):
        return values
    found = tuple(map(fixed, values))
    same = isinstance(values, tuple) and all(a is b for a, b in zip(found, values, strict=True))
    return values if same else found
