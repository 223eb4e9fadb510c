"""V as the oscillators that a system declares, and the rest: [p.p + sum (w_i q_i)^2] / 2 + [V - sum (w_i q_i)^2 / 2].

The rest is formed with exact constants, so that the quadratic terms of V cancel as expressions, not as numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import SystemDefinitionError, bad_setting
from nearharmonic.systems.definition.quantities import Vector, is_extreme, is_list
from nearharmonic.systems.formulas.energy import Energy, constants_beside
from nearharmonic.systems.formulas.formulas import Formulas

if TYPE_CHECKING:
    from nearharmonic.systems.definition.system import System


@dataclass(frozen=True, eq=False)
class Remainder:
    """V - sum w_i^2 q_i^2 / 2 as a function of the coordinates and the parameters."""

    system: System
    frequencies: tuple[Fraction | str, ...]

    def __call__(self, q: Vector, *parameters: Any) -> Any:
        given, rest, number = dict(zip(self.system.parameters, parameters, strict=True)), 0, constants_beside(q)
        for x, w in zip(q, self.frequencies, strict=True):
            if isinstance(w, str):
                rest = rest + given[w] * given[w] * x * x / 2
            elif w:
                rest = rest + number(Constant(w * w / 2)) * (x * x)
        return self.system.V(q, *parameters) - rest


def written_frequencies(system: System) -> tuple[Fraction | str, ...]:
    """Return the frequencies that ``system`` declares: exact numbers, and names of parameters.

    Raises
    ------
    SystemDefinitionError
        Another number of them than of coordinates, or one that is no number of at least 0 and no parameter.
    """
    given: Any = system.frequencies
    if not is_list(given) or not hasattr(given, "__len__") or len(given) != system.dimension:
        allowed = f"{system.dimension} frequencies, one a coordinate, 0 for one that is free"
        raise SystemDefinitionError(f"{system.name}: frequencies = {given!r} is not allowed: {allowed}")
    return tuple(_frequency(system, i, value) for i, value in enumerate(given))


def _frequency(system: System, i: int, value: Any) -> Fraction | str:
    if isinstance(value, str) and value in system.parameters:
        return value
    try:
        number = None if isinstance(value, bool | float) or is_extreme(value) else Fraction(value)
        usable = number is not None and number >= 0 and float(number) < float("inf")
    except (ValueError, TypeError, ZeroDivisionError, OverflowError):
        usable = False
    if not usable:
        names = f", or the name of a parameter: {', '.join(system.parameters)}" if system.parameters else ""
        what = f"a decimal string or a fraction of at least 0{names}"
        raise SystemDefinitionError(f"{system.name}: frequencies[{i}] = {value!r} is not allowed: it must be {what}")
    assert number is not None
    return number


@cache
def frequencies_of(system: System) -> tuple[tuple[Fraction, ...], tuple[int, ...]]:
    """Return the distinct frequencies, and of each coordinate the place of its own among them.

    Raises
    ------
    SettingError
        The oscillators of the system cannot be solved exactly together with T.
    """
    check_oscillator(system)
    constants = dict(zip(system.parameters, system.constants(Fraction), strict=True))
    values = [constants[w] if isinstance(w, str) else w for w in written_frequencies(system)]
    distinct = tuple(dict.fromkeys(values))
    return distinct, tuple(distinct.index(value) for value in values)


def frequency_parameters(system: System) -> list[int]:
    """Return the places of the parameters that are frequencies."""
    named = written_frequencies(system)
    return [i for i, name in enumerate(system.parameters) if name in named]


def check_oscillator(system: System, key: str = "split") -> None:
    """Refuse a system whose oscillators cannot be solved exactly together with T, as a setting named ``key``.

    Raises
    ------
    SettingError
        It says what the system lacks.
    """
    value = "exact_oscillator"
    if system.frequencies is None:
        example = ", ".join(["'1'"] * min(system.dimension, 3)) + (", ..." if system.dimension > 3 else "")
        comma = "," if system.dimension == 1 else ""
        needed = f"{system.name} declares no frequencies, such as frequencies=({example}{comma})"
    elif system.time_dependent:
        needed = f"it is for potentials that do not depend on time, and that of {system.name} does"
    elif system.regularisation is not None:
        needed = f"{system.name} is regularised, and is no oscillator in its own coordinates"
    elif not system.unit_masses:
        needed = f"it requires T = p.p / 2, which {system.name} does not have"
    elif not system.energies[0].traced:
        needed = f"it takes the oscillators out of the expression of V, and V of {system.name} is a function of numba"
    elif system.formulas().are_loops:
        needed = f"it is for systems of few terms, and the formulas of {system.name} are compiled as loops"
    else:
        return
    raise bad_setting(key, value, needed)


@cache
def remainder_formulas(system: System) -> Formulas:
    """Return the formulas of ``system`` whose grad_V is that of V without its oscillators; V is the whole potential.

    Raises
    ------
    SettingError
        The oscillators of the system cannot be solved exactly together with T.
    """
    check_oscillator(system)
    formulas = system.formulas()
    remainder = Remainder(system, written_frequencies(system))
    rest = Energy(system.name, "V", remainder, system.dimension, system.constants(Constant))
    return replace(
        formulas,
        grad_V=rest.gradient,
        grad_V_and_V=lambda q, *given: (*rest.gradient(q, *given), formulas.V(q, *given)),
    )
