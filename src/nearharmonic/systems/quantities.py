"""Parameters and observables of a system, and checks of its members before they are used."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from math import isinf
from typing import Any

from nearharmonic.errors import SystemDefinitionError, shown
from nearharmonic.numerics.written import any_decimal_of, decimal, exact_number, is_extreme, is_real

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
    """A read-only mapping of a system, since values derived from it would not follow a change."""

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


#: Quantities that a system has units of.
UNITS = ("q", "p", "t", "energy")
#: Names of the variables and dimensions of every result; no invariant or observable may have such a name.
VARIABLES = frozenset((
    "t", "q", "p", "q_low", "p_low", "tau", "tau_requested", "energy_error", "max_energy_error", "mean_energy_error",
    "initial_energy", "initial_energy_low", "clock", "clock_low", "clock_momentum", "clock_momentum_low", "steps",
    "evaluations", "status", "diverged_at", "block_steps", "block_max_energy_error", "block_mean_energy_error",
    "sample", "component", "member", "running", "running_component",
))  # fmt: skip


def check_members(system: Any) -> None:
    """Refuse members of a system that have a wrong type."""
    name: Any = system.name  # a user may pass anything
    if not isinstance(name, str) or not name:
        raise SystemDefinitionError(f"name = {name!r} is not allowed: a system has a name")
    for key, value, is_allowed, allowed in _typed_members(system):
        if not is_allowed:
            raise SystemDefinitionError(f"{name}: {key} = {value!r} is not allowed: {allowed}")
    for key in (*UNITS, *system.units):
        if key not in system.units:
            raise SystemDefinitionError(f"{name}: units lack {key!r}")
        if key not in UNITS:
            raise SystemDefinitionError(f"{name}: units has {key!r}, and names the units of {', '.join(UNITS)} alone")
    for key in system.parameters:
        if not key.isidentifier():
            allowed = "a name that an argument of V may have, of letters, digits and _"
            raise SystemDefinitionError(f"{name}: parameters has {key!r}, which is not allowed: {allowed}")
    for key in ("invariants", "observables"):
        for entry in getattr(system, key):
            if entry in VARIABLES or (key == "observables" and entry in system.invariants):
                raise SystemDefinitionError(f"{name}: {key} has {entry!r}, and a result has a variable of that name")


def _typed_members(system: Any) -> Iterator[tuple[str, Any, bool, str]]:
    """Yield name, value, True if it is allowed, and the allowed type."""
    for key in ("units", "parameters", "invariants", "observables"):
        value = getattr(system, key)
        is_mapping = isinstance(value, Mapping) and all(isinstance(entry, str) for entry in value)
        yield key, value, is_mapping, "a mapping of names"
    functions = {f"invariants[{key!r}]": function for key, function in system.invariants.items()}
    functions |= {f"observables[{key!r}]": function for key, function in system.observables.items()}
    units = {f"units[{key!r}]": unit for key, unit in system.units.items()}
    for key, function in (*system.invariants.items(), *system.observables.items()):
        units |= {f"the unit of {key!r}": function.unit} if isinstance(function, Observable) else {}
    for key, unit in units.items():  # xarray makes dates of the numbers
        is_unit = isinstance(unit, str) and bool(unit) and "since" not in unit
        yield key, unit, is_unit, "a string without the word since, '1' for no unit"
    for key in ("label", "source"):
        yield key, getattr(system, key), isinstance(getattr(system, key), str), "a string"
    for key in ("V", "grad_V", "T", "grad_T"):
        function = getattr(system, key)
        yield key, function, callable(function) or (function is None and "grad" in key), "a function"
    for key, function in functions.items():
        what = "a function f(q, p, *parameters), or a nearharmonic.Observable, which has a unit too"
        yield key, function, callable(function), what
    yield "time_dependent", system.time_dependent, isinstance(system.time_dependent, bool), "True or False"
    limit: Any = system.surface_limit
    yield "surface_limit", limit, is_real(limit) and limit > 0, "a number above 0"


def _not_allowed(system: Any, key: str, value: object, allowed: str) -> SystemDefinitionError:
    return SystemDefinitionError(f"{system.name}: {key} = {value!r} is not allowed: {allowed}")


def check_numbers(system: Any) -> None:
    """Refuse initial values, parameters and times that are not finite doubles."""
    named: dict[str, Any] = {f"parameter {k}": v.value for k, v in system.parameters.items()}
    named |= {"t_end": system.t_end}
    named |= {f"q0[{i}]": v for i, v in enumerate(system.q0)} | {f"p0[{i}]": v for i, v in enumerate(system.p0)}
    named |= {k: v for k in ("position_t_end", "energy_scale") if (v := getattr(system, k)) is not None}
    for key, text in named.items():
        where = f"{system.name}: {key} = {shown(text)}"
        try:
            number = any_decimal_of(str(text) if isinstance(text, str | Decimal) else "")
        except ValueError:
            raise SystemDefinitionError(f"{where} is not a finite decimal number") from None
        if isinf(float(number)):
            raise SystemDefinitionError(f"{where} is larger than any double")
        if is_extreme(number):
            raise SystemDefinitionError(f"{where} is smaller than any double above 0")
    if system.energy_scale is not None and Decimal(system.energy_scale) <= 0:
        raise SystemDefinitionError(f"{system.name}: energy_scale = {system.energy_scale!r} is not positive")


def written_frequencies(system: Any) -> tuple[Fraction | str, ...]:
    """Return the frequencies that ``system`` declares, one per coordinate: exact numbers from 0, and parameters."""
    given: Any = system.frequencies
    if not is_list(given) or not hasattr(given, "__len__") or len(given) != system.dimension:
        allowed = f"{system.dimension} frequencies, one per coordinate, 0 for one that is free"
        raise _not_allowed(system, "frequencies", given, allowed)
    found: list[Fraction | str] = []
    for i, value in enumerate(given):
        if isinstance(value, str) and value in system.parameters:
            found.append(value)
            continue
        try:
            number = exact_number(value)
            usable = number >= 0 and float(number) < float("inf")
        except (ValueError, TypeError, OverflowError):
            usable = False
        if not usable:
            names = f", or the name of a parameter: {', '.join(system.parameters)}" if system.parameters else ""
            what = f"it must be a decimal string or a fraction of at least 0{names}"
            raise _not_allowed(system, f"frequencies[{i}]", value, what)
        found.append(number)
    return tuple(found)
