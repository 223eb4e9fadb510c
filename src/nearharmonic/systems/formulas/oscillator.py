"""V as declared oscillators and the rest: [p.p + sum (w_i q_i)^2] / 2 + [V - sum (w_i q_i)^2 / 2].

The rest has exact constants, so that the quadratic terms of V cancel as expressions, not as numbers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from nearharmonic.core.formulas.number import Constant
from nearharmonic.errors import bad_setting
from nearharmonic.systems.definition.declaration import written_frequencies
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.definition.remembered import remembered
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


@remembered
def frequencies_of(system: System) -> tuple[tuple[Fraction, ...], tuple[int, ...]]:
    """Return the distinct frequencies, and for each coordinate the index of its frequency.

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
    """Return the indices of the parameters that are frequencies."""
    named = written_frequencies(system)
    return [i for i, name in enumerate(system.parameters) if name in named]


def check_oscillator(system: System, key: str = "split") -> None:
    """Raise an error about the setting ``key`` if the oscillators and T cannot be solved exactly together.

    Raises
    ------
    SettingError
        The message holds the missing property of the system.
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


@remembered
def remainder_formulas(system: System) -> Formulas:
    """Return the formulas of ``system`` with the grad_V of V without its oscillators; V is the full potential.

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
