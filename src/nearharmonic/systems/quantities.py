"""Parameters and observables of a system, and checks of its members before they are used."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
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
    for key in ("units", "parameters", "invariants", "observables"):
        value = getattr(system, key)
        if not isinstance(value, Mapping) or not all(isinstance(entry, str) for entry in value):
            raise _not_allowed(system, key, value, "a mapping of names")
    _check_names(system)
    _check_functions(system)
    if not isinstance(system.time_dependent, bool):
        raise _not_allowed(system, "time_dependent", system.time_dependent, "True or False")
    limit: Any = system.surface_limit
    if not is_real(limit) or not limit > 0:
        raise _not_allowed(system, "surface_limit", limit, "a number above 0")


def _not_allowed(system: Any, key: str, value: object, allowed: str) -> SystemDefinitionError:
    return SystemDefinitionError(f"{system.name}: {key} = {value!r} is not allowed: {allowed}")


def _check_names(system: Any) -> None:
    name = system.name
    units: Mapping[str, Any] = system.units
    for key in UNITS:
        if key not in units:
            raise SystemDefinitionError(f"{name}: units lack {key!r}")
    for key in units:
        if key not in UNITS:
            raise SystemDefinitionError(f"{name}: units has {key!r}, and names the units of {', '.join(UNITS)} alone")
    named = {f"units[{key!r}]": unit for key, unit in units.items()}
    for entry, function in (*system.invariants.items(), *system.observables.items()):
        named |= {f"the unit of {entry!r}": function.unit} if isinstance(function, Observable) else {}
    for key, unit in named.items():
        if not isinstance(unit, str) or not unit or "since" in unit:  # xarray makes dates of the numbers
            raise _not_allowed(system, key, unit, "a string without the word since, '1' for no unit")
    for key in ("label", "source"):
        if not isinstance(text := getattr(system, key), str):
            raise _not_allowed(system, key, text, "a string")
    for key in system.parameters:
        if not key.isidentifier():
            allowed = "a name that an argument of V may have, of letters, digits and _"
            raise SystemDefinitionError(f"{name}: parameters has {key!r}, which is not allowed: {allowed}")


def _check_functions(system: Any) -> None:
    name = system.name
    for key in ("V", "grad_V", "T", "grad_T"):
        function = getattr(system, key)
        if not callable(function) and (function is not None or key in ("V", "T")):
            raise _not_allowed(system, key, function, "a function")
    groups: tuple[tuple[str, Mapping[str, Any]], ...] = (
        ("invariants", system.invariants), ("observables", system.observables),
    )  # fmt: skip
    for key, functions in groups:
        for entry, function in functions.items():
            if entry in VARIABLES or (key == "observables" and entry in system.invariants):
                raise SystemDefinitionError(f"{name}: {key} has {entry!r}, and a result has a variable of that name")
            if not callable(function):
                allowed = "a function f(q, p, *parameters), or a nearharmonic.Observable, which has a unit too"
                raise _not_allowed(system, f"{key}[{entry!r}]", function, allowed)


def check_numbers(system: Any) -> None:
    """Refuse initial values, parameters and times that are not finite doubles."""
    named: dict[str, Any] = {f"parameter {k}": v.value for k, v in system.parameters.items()}
    named |= {"t_end": system.t_end}
    named |= {f"q0[{i}]": v for i, v in enumerate(system.q0)} | {f"p0[{i}]": v for i, v in enumerate(system.p0)}
    named |= {k: v for k in ("position_t_end", "energy_scale") if (v := getattr(system, k)) is not None}
    for key, text in named.items():
        try:
            number = any_decimal_of(str(text) if isinstance(text, str | Decimal) else "")
        except ValueError:
            message = f"{system.name}: {key} = {shown(text)} is not a finite decimal number"
            raise SystemDefinitionError(message) from None
        if isinf(float(number)):
            raise SystemDefinitionError(f"{system.name}: {key} = {shown(text)} is larger than any double")
        if is_extreme(number):
            raise SystemDefinitionError(f"{system.name}: {key} = {shown(text)} is smaller than any double above 0")
    if system.energy_scale is not None and Decimal(system.energy_scale) <= 0:
        raise SystemDefinitionError(f"{system.name}: energy_scale = {system.energy_scale!r} is not positive")


def written_frequencies(system: Any) -> tuple[Fraction | str, ...]:
    """Return the frequencies that ``system`` declares, one per coordinate: exact numbers from 0, and parameters."""
    given: Any = system.frequencies
    if not is_list(given) or not hasattr(given, "__len__") or len(given) != system.dimension:
        allowed = f"{system.dimension} frequencies, one per coordinate, 0 for one that is free"
        raise _not_allowed(system, "frequencies", given, allowed)
    return tuple(_frequency(system, i, value) for i, value in enumerate(given))


def _frequency(system: Any, i: int, value: Any) -> Fraction | str:
    if isinstance(value, str) and value in system.parameters:
        return value
    try:
        number = exact_number(value)
        usable = number >= 0 and float(number) < float("inf")
    except (ValueError, TypeError, OverflowError):
        usable = False
    if not usable:
        names = f", or the name of a parameter: {', '.join(system.parameters)}" if system.parameters else ""
        what = f"it must be a decimal string or a fraction of at least 0{names}"
        raise _not_allowed(system, f"frequencies[{i}]", value, what)
    return number
