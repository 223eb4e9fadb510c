"""Systems of users: from a file, or registered ones with other initial values or parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from nearharmonic.errors import SettingError, SystemDefinitionError, bad_setting, unknown_name
from nearharmonic.numerics.written import decimal_of
from nearharmonic.systems import Parameter, System, systems
from nearharmonic.systems.system import load_system

#: Decimal digits of a scaled momentum; extended precision has 32.
DIGITS = 40


@dataclass(frozen=True, kw_only=True)
class SystemDefinition:
    """A system of a ``file`` that defines SYSTEM, or the registered system ``base``, with other initial values and
    parameters.

    ``label`` is its name in titles. ``q0`` and ``p0`` are decimal strings, ``parameters`` the names and values that
    differ, and ``energy`` is that at the start, for which p0 is multiplied by a factor; None is for the system's own.
    """

    file: str | None = None
    base: str | None = None
    label: str | None = None
    q0: tuple[str, ...] | None = None
    p0: tuple[str, ...] | None = None
    parameters: tuple[tuple[str, str], ...] = ()
    energy: str | None = None

    def make(self, name: str) -> System:
        """Return the system under the given name, with as many initial values and with parameters that it has."""
        original = load_system(self.file) if self.file is not None else systems[str(self.base)]
        values = {key: value for key in ("q0", "p0") if (value := getattr(self, key)) is not None}
        for key, value in values.items():
            if len(value) != original.dimension:
                message = f"{key} has {len(value)} components, and {original.label} has {original.dimension}"
                raise SystemDefinitionError(message)
        parameters = _changed(original, dict(self.parameters))
        made = replace(original, name=name, label=self.label or original.label, **values, parameters=parameters)
        return made if self.energy is None else replace(made, p0=_momentum(made, self.energy))


def _momentum(system: System, energy: str) -> tuple[str, ...]:
    """Return p0 times the factor s >= 0 with H(q0, s p0) = ``energy`` at t = 0, in more digits than any run has."""
    from mpmath import mp, mpf, workdps

    with workdps(2 * DIGITS):
        q, p = system.start(mpf)
        constants = system.constants(mpf)

        def missing(factor: Any) -> Any:
            return system.energy(q, tuple(factor * x for x in p), constants, mpf(0)) - wanted

        try:
            wanted = mpf(str(decimal_of(energy)))  # a record of others may hold any text
            least = missing(mpf(0))
            kinetic = missing(mpf(1)) - least
            if least > 0:
                raise bad_setting(
                    "energy", energy, f"a number of at least {mp.nstr(least + wanted, 10)}, H at rest at q0"
                )
            if least < 0 and not any(p):
                raise bad_setting(
                    "energy", energy, "p0 = 0 has no direction: give p0 too, whose length does not matter"
                )
            factor = mp.sqrt(-least / kinetic) if least else least  # exact if T is quadratic
            if abs(missing(factor)) > kinetic * mpf(10) ** -DIGITS:
                factor = mp.findroot(lambda s: missing(s) / kinetic, factor)
            return tuple(mp.nstr(factor * x, DIGITS) for x in p)
        except (ArithmeticError, TypeError, ValueError) as error:
            if isinstance(error, SettingError):
                raise
            raise bad_setting("energy", energy, "an energy that H has at q0 for a multiple of p0") from None


def _changed(system: System, values: Mapping[str, str]) -> Mapping[str, Parameter]:
    """The parameters of ``system``, with new values for some of them."""
    for name in values:
        if name not in system.parameters:
            if not system.parameters:
                raise SystemDefinitionError(f"parameters has {name!r}, and {system.label} has no parameters")
            raise unknown_name(f"parameter of {system.label}", name, system.parameters)
    return {
        name: replace(parameter, value=values[name]) if name in values else parameter
        for name, parameter in system.parameters.items()
    }
