"""Systems of users: those of a file, or registered ones, with other initial values or parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from nearharmonic.errors import SystemDefinitionError, unknown_name
from nearharmonic.systems import Parameter, System, systems
from nearharmonic.systems.definition.file import load_system


@dataclass(frozen=True, kw_only=True)
class SystemDefinition:
    """A system of a file, or a registered system, with other initial values and parameters.

    Attributes
    ----------
    file : str or None
        The Python file that defines SYSTEM.
    base : str or None
        Name of a registered system, if there is no file.
    label : str or None
        Name in titles, in place of the system's own.
    q0, p0 : tuple of str, or None
        Initial values in place of the system's own, as decimal strings.
    parameters : tuple of (str, str)
        Names and values of the parameters that differ from those of the system.
    """

    file: str | None = None
    base: str | None = None
    label: str | None = None
    q0: tuple[str, ...] | None = None
    p0: tuple[str, ...] | None = None
    parameters: tuple[tuple[str, str], ...] = ()

    def make(self, name: str) -> System:
        """Return the system under the given name.

        Raises
        ------
        SystemDefinitionError
            The file defines no system, or the number of initial values is wrong.
        UnknownNameError
            The system has no parameter of a given name.
        """
        original = load_system(self.file) if self.file is not None else systems[str(self.base)]
        values = {key: value for key in ("q0", "p0") if (value := getattr(self, key)) is not None}
        for key, value in values.items():
            if len(value) != original.dimension:
                message = f"{key} has {len(value)} components, and {original.label} has {original.dimension}"
                raise SystemDefinitionError(message)
        parameters = _changed(original, dict(self.parameters))
        return replace(original, name=name, label=self.label or original.label, **values, parameters=parameters)


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
