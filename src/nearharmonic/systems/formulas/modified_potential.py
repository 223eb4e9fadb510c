"""The gradient of the square of a force, for kicks of a modified potential."""

from __future__ import annotations

from functools import cache
from threading import RLock
from typing import Any

from nearharmonic.core.formulas.expression.derivative import gradient
from nearharmonic.core.formulas.expression.graph import Expression, Graph, value_of
from nearharmonic.core.formulas.expression.nodes import Value
from nearharmonic.core.formulas.expression.polynomial import shortest_program
from nearharmonic.core.formulas.expression.program import Program
from nearharmonic.core.formulas.number import Constant, scalar, vector
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.energy import Vector, evaluate


class SquareGradient:
    """grad |grad V|^2 as a function of the coordinates and the parameters.

    |grad V|^2 denotes the square a(f).f with inverse masses, where a(f) is the acceleration by the force f = grad V.
    Its gradient is derived in reverse mode, for a system with quadratic T.
    """

    def __init__(self, system: System) -> None:
        self.formulas, self.parameters = system.formulas(), len(system.parameters)
        self._programs: dict[tuple[Constant, ...] | None, Program] = {}
        self._lock = RLock()

    def __call__(self, q: Vector, *parameters: Any) -> Vector:
        """Return the gradient (d) at ``q`` (d), in any number type."""
        compiled_in = bool(parameters) and all(isinstance(k, Constant) for k in parameters)
        constants = parameters if compiled_in else None
        with self._lock:
            if constants not in self._programs:
                self._programs[constants] = self._program(constants)
        return evaluate(self._programs[constants], (*q, *(() if compiled_in else parameters)))

    def _program(self, constants: tuple[Constant, ...] | None) -> Program:
        graph, d = Graph(), self.formulas.dimension
        variables = graph.variables(d if constants is not None else d + self.parameters)
        q, given = variables[:d], variables[d:] if constants is None else constants
        force = vector(self.formulas, "grad_V", q, *given)
        pairs = zip(force, self.formulas.acceleration(force, *given), strict=True)
        square: Expression | Constant = sum((f * a for f, a in pairs), start=Constant(0))
        coordinates: tuple[Value, ...] = tuple(x.value for x in q)
        roots = gradient(graph, value_of(square), coordinates)
        return shortest_program(graph, roots, value_of(scalar(self.formulas, "V", q, *given)))


#: The function of a system, made once.
square_gradient = cache(SquareGradient)
