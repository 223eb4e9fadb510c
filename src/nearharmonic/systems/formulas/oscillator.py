"""V as the oscillators that a system declares, and the rest: [p.p + sum (w_i q_i)^2] / 2 + [V - sum (w_i q_i)^2 / 2].

The rest is formed with exact constants, so that the quadratic terms of V cancel as expressions, not as numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import bad_setting
from nearharmonic.systems.definition.declaration import written_frequencies
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.energy import Energy, constants_beside
from nearharmonic.systems.formulas.formulas import Formulas


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
