"""Equations of motion as the text of a Python function, for libraries that compile or differentiate it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from nearharmonic.core.formulas.number import FUNCTIONS, Constant, Number, vector
from nearharmonic.systems.definition.system import System


class SourceTracer(Number):
    """A symbolic number that records each arithmetic operation as one line of Python source.

    ``name`` is a variable: the last of ``lines`` assigns its value, or it is an argument of the function.
    """

    __slots__ = ("lines", "name")

    def __init__(self, name: str, lines: list[str]) -> None:
        self.name, self.lines = name, lines

    def _line(self, expression: str) -> SourceTracer:
        name = f"v{len(self.lines)}"
        self.lines.append(f"{name} = {expression}")
        return type(self)(name, self.lines)

    def _add(self, other: SourceTracer | Constant) -> SourceTracer:
        # sum() begins with 0; no user would write a line for that addition.
        return self if isinstance(other, Constant) and not other else self._line(f"{self.name} + {_text(other)}")

    def __sub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._line(f"{self.name} - {_text(operand)}")

    def __rsub__(self, other: Any) -> Any:
        operand = self._operand(other)
        return NotImplemented if operand is None else self._line(f"{_text(operand)} - {self.name}")

    def _multiply(self, other: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{self.name} * {_text(other)}")

    def _divide(self, other: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{self.name} / {_text(other)}")

    def __neg__(self) -> SourceTracer:
        return self._line(f"-{self.name}")

    def __abs__(self) -> SourceTracer:
        return self._line(f"abs({self.name})")

    def whole_power(self, exponent: int) -> SourceTracer:
        """Return the ``exponent``-th power in one line, which libraries differentiate as a power."""
        return self._line(f"{self.name} ** {exponent}")

    def sqrt(self) -> SourceTracer:
        return self._line(f"sqrt({self.name})")

    def lifted(self, number: Constant) -> SourceTracer:
        return type(self)(_text(number), self.lines)

    def apply(self, function: str, *others: SourceTracer | Constant) -> SourceTracer:
        return self._line(f"{function}({', '.join(map(_text, (self, *others)))})")


def _text(value: SourceTracer | Constant) -> str:
    return value.name if isinstance(value, SourceTracer) else repr(float(value))


def _function(name: str, arguments: str, lines: list[str], results: list[str]) -> str:
    body = "".join(f"    {line}\n" for line in lines)
    return f"def {name}({arguments}):\n{body}    return {', '.join(results)},\n"


def velocity_text(system: System) -> str:
    """Return the text of ``velocity(q0, .., p0, ..)`` -> (dq0/dt, .., dp0/dt, ..).

    Coordinates are those of ``system.formulas()``. For a regularised system they are (u, w), with derivatives by the
    fictitious time. The text calls ``abs``, ``sqrt`` and the functions of :mod:`nearharmonic.math` by their names.

    Raises
    ------
    SystemDefinitionError
        A formula fails, or uses an operation that formulas do not have.
    """
    lines: list[str] = []
    formulas, constants = system.formulas(), system.constants(Constant)
    d = formulas.dimension
    names = [f"{letter}{i}" for letter in "qp" for i in range(d)]
    entries = [SourceTracer(name, lines) for name in names]
    q, p = tuple(entries[:d]), tuple(entries[d:])
    velocity, force = vector(formulas, "grad_T", p, *constants), vector(formulas, "grad_V", q, *constants)
    results = [*map(_text, velocity), *(f"-{_text(component)}" for component in force)]
    return _function("velocity", ", ".join(names), lines, results)


def velocity(system: System, functions: Mapping[str, Callable[..., Any]] | None = None) -> Callable[..., Any]:
    """The function of :func:`velocity_text`; it calls ``functions``, by default those of the module math."""
    import numpy as np

    space: dict[str, Any] = {name: getattr(math, name) for name in ("sqrt", *FUNCTIONS) if name != "cbrt"}
    space |= {"cbrt": np.cbrt, **(functions or {})}  # numba supports only that of numpy
    exec(compile(velocity_text(system), f"<{system.name}>", "exec"), space)
    made: Callable[..., Any] = space["velocity"]
    return made
