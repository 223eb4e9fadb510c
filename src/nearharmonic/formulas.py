"""A system's equations of motion as the text of a Python function, for libraries that compile or differentiate it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.system import System


class Written:
    """A number that writes down what is done to it, one line an operation; ``name`` is a variable or a literal."""

    __slots__ = ("lines", "name")

    def __init__(self, name: str, lines: list[str]) -> None:
        self.name, self.lines = name, lines

    def _line(self, expression: str) -> Written:
        name = f"v{len(self.lines)}"
        self.lines.append(f"{name} = {expression}")
        return Written(name, self.lines)

    def __add__(self, other: Any) -> Any:
        # sum() begins with 0; a line for it would be a line that no user writes.
        return self if isinstance(other, int) and other == 0 else self._line(f"{self.name} + {_text(other)}")

    __radd__ = __add__

    def __sub__(self, other: Any) -> Written:
        return self._line(f"{self.name} - {_text(other)}")

    def __rsub__(self, other: Any) -> Written:
        return self._line(f"{_text(other)} - {self.name}")

    def __mul__(self, other: Any) -> Written:
        return self._line(f"{self.name} * {_text(other)}")

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Written:
        return self._line(f"{self.name} / {_text(other)}")

    def __rtruediv__(self, other: Any) -> Written:
        return self._line(f"{_text(other)} / {self.name}")

    def __neg__(self) -> Written:
        return self._line(f"-{self.name}")

    def __pow__(self, exponent: int) -> Written:
        return self._line(f"{self.name} ** {exponent}")

    def __bool__(self) -> bool:
        message = "a formula must not branch on a value"
        raise TypeError(message)

    def sqrt(self) -> Written:
        return self._line(f"sqrt({self.name})")


def _text(value: Any) -> str:
    return value.name if isinstance(value, Written) else repr(float(value))


def _function(name: str, arguments: str, lines: list[str], results: list[str]) -> str:
    body = "".join(f"    {line}\n" for line in lines)
    return f"def {name}({arguments}):\n{body}    return {', '.join(results)},\n"


def velocity_text(system: System) -> str:
    """Text of ``velocity(q0, .., p0, ..)`` -> (dq0/dt, .., dp0/dt, ..); the functions it calls: ``sqrt``.

    Raises:
        SystemDefinitionError: a formula that branches, or uses more than ``+ - * /``, powers and sqrt.
    """
    lines: list[str] = []
    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    entries = [Written(name, lines) for name in names]
    q, p = tuple(entries[: system.dimension]), tuple(entries[system.dimension :])
    constants = tuple(Fraction(parameter.value) for parameter in system.parameters.values())
    try:
        velocity, force = system.grad_T(p), system.grad_V(q, *constants)
    except (TypeError, ValueError, AttributeError) as error:
        raise SystemDefinitionError(f"{system.name}: its formulas cannot be written out: {error}") from error
    results = [*map(_text, velocity), *(f"-{_text(component)}" for component in force)]
    return _function("velocity", ", ".join(names), lines, results)


def velocity(system: System, functions: Mapping[str, Callable[..., Any]] | None = None) -> Callable[..., Any]:
    """The function that :func:`velocity_text` writes, with ``functions`` (math's by default) for what it calls."""
    space: dict[str, Any] = {"sqrt": math.sqrt, **(functions or {})}
    exec(compile(velocity_text(system), f"<{system.name}>", "exec"), space)
    made: Callable[..., Any] = space["velocity"]
    return made
