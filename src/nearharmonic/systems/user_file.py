"""Systems of users' files, or registered ones, with initial values and parameters of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from nearharmonic.errors import SystemDefinitionError, unknown_name
from nearharmonic.systems import Parameter, System, systems
from nearharmonic.systems.definition.file import load_system


@dataclass(frozen=True, kw_only=True)
class SystemDefinition:
    """A system of a file, or a registered one, with initial values and parameters of its own.

    Attributes
    ----------
    file : str or None
        The Python file that defines SYSTEM.
    base : str or None
        Name of a registered system; given if there is no file.
    label : str or None
        Name in titles, in place of the system's own.
    q0, p0 : tuple of str, or None
        Initial values in place of the system's own, as decimal strings.
    parameters : tuple of (str, str)
        Names and values of those parameters that have others than the system's own.
    """

    file: str | None = None
    base: str | None = None
    label: str | None = None
    q0: tuple[str, ...] | None = None
    p0: tuple[str, ...] | None = None
    parameters: tuple[tuple[str, str], ...] = ()

    def make(self, name: str) -> System:
        """Return the system under the name that it has here.

        Raises
        ------
        SystemDefinitionError
            The file defines no system, or a number of initial values does not fit it.
        UnknownNameError
            A parameter that the system does not have.
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
    """The parameters of ``system``, some of them with another value."""
    for name in values:
        if name not in system.parameters:
            if not system.parameters:
                message = f"parameters has {name!r}, and {system.label} has no parameters"
                raise SystemDefinitionError(message)
            raise unknown_name(f"parameter of {system.label}", name, system.parameters)
    return {
        name: replace(parameter, value=values[name]) if name in values else parameter
        for name, parameter in system.parameters.items()
    }
