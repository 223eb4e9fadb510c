"""Energies of a system as expressions, with derivatives and proved properties; kinetic energies of masses."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from inspect import Parameter as Argument
from inspect import signature
from numbers import Rational
from sys import float_info
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple

from nearharmonic.core import arithmetic
from nearharmonic.core.expression import Graph, Value, Variable, becomes_loops, check_size, operations, value_of
from nearharmonic.core.number import Constant, Number, call, constant, scalar
from nearharmonic.errors import SystemDefinitionError, shown
from nearharmonic.numerics.written import decimal, exact_number, exact_value
from nearharmonic.systems.quantities import is_list

if TYPE_CHECKING:
    from nearharmonic.core.program import Program
    from nearharmonic.core.terms import LoopedEnergy


Components = tuple[Any, ...]


# --- The energies of a system as expressions, with derivatives for numbers of any type, and proved properties.
#
# A formula is traced at its first use. A gradient or a Hessian is derived at its first call.


class _Traced(NamedTuple):
    """An energy as a value of a graph, with its coordinates."""

    graph: Graph
    value: Value
    coordinates: tuple[Value, ...]


class Energy:
    """V or T of a system, as an expression of its coordinates.

    ``function(x, *parameters)`` is of coordinates x (d = ``dimension``); ``parameters`` are the system's own. ``name``,
    of the system, and ``formula``, "V" or "T", are for errors.
    """

    #: The energy has an expression, unlike a function of numba.
    traced = True

    def __init__(
        self, name: str, formula: str, function: Callable[..., Any], dimension: int, parameters: tuple[Constant, ...]
    ) -> None:
        self.name, self.formula, self.function = name, formula, function
        self.dimension, self.parameters = dimension, parameters
        setattr(self, formula, function)  # for :mod:`nearharmonic.core.number`
        self._traced: dict[Any, _Traced] = {}
        self._programs: dict[Any, Program] = {}
        self._loops: dict[Any, LoopedEnergy] = {}
        self._at_run_time: bool | None = None
        self._lock = RLock()  # differentiation adds nodes to the graph, and threads may share a system

    @property
    def parameters_at_run_time(self) -> bool:
        """True if the formula works with parameters that are values of a kernel, so that no branch depends on them."""
        with self._lock:
            if self._at_run_time is None:
                try:
                    self._trace(None)
                    self._at_run_time = True
                except SystemDefinitionError:
                    if not self.parameters:
                        raise
                    self._trace(self.parameters)  # raises the error of a formula that fails with constants too
                    self._at_run_time = False
            return self._at_run_time

    def trace(self) -> None:
        """Trace the formula, unless it was traced before; one that fails, or is too long to be compiled, raises an
        error.
        """
        _ = self._standard  # raises the error of the formula
        if self.is_long:
            looped = call(self, self.formula, self.looped, self.parameters_at_run_time)
            call(self, self.formula, check_size, looped.operations)

    @cached_property
    def is_long(self) -> bool:
        """True if the formula is compiled as loops; False if it fails."""
        try:
            graph, value, _ = self._standard
        except SystemDefinitionError:
            return False
        return becomes_loops(self.dimension, operations(graph, [value]))

    def _trace(self, parameters: tuple[Constant, ...] | None) -> _Traced:
        """The expression; its parameters are variables, or the given constants."""
        if parameters not in self._traced:
            graph, d = Graph(), self.dimension
            variables = graph.variables(d if parameters is not None else d + len(self.parameters))
            result = scalar(self, self.formula, variables[:d], *(parameters or variables[d:]))
            call(self, self.formula, variables[0].__add__, result)  # fails for a value of an earlier call
            self._traced[parameters] = _Traced(graph, value_of(result), tuple(x.value for x in variables[:d]))
        return self._traced[parameters]

    @property
    def _standard(self) -> _Traced:
        return self._trace(None if self.parameters_at_run_time else self.parameters)

    def looped(self, parameters_at_run_time: bool) -> LoopedEnergy:
        """Return the energy as loops; its parameters are values of a kernel or the constants of the system."""
        from nearharmonic.core.terms import LoopedEnergy  # most systems do not need it

        parameters = None if parameters_at_run_time else self.parameters
        with self._lock:
            if parameters not in self._loops:
                graph, value, _ = self._trace(parameters)
                count = len(self.parameters) if parameters_at_run_time else 0
                self._loops[parameters] = LoopedEnergy(graph, value, self.dimension, count)
            return self._loops[parameters]

    @property
    def is_quadratic(self) -> bool:
        """True if the energy is a polynomial of degree at most 2 in its coordinates, in any form."""
        from nearharmonic.core.program import is_quadratic

        graph, value, coordinates = self._standard
        return is_quadratic(graph, value, frozenset(x.node for x in coordinates if x.node is not None))

    @property
    def is_half_square(self) -> bool:
        """True if the energy is x.x / 2, in any form."""
        from nearharmonic.core.program import polynomial_of

        graph, value, coordinates = self._standard
        half = {((x.node, 2),): Fraction(1, 2) for x in coordinates}
        return self.is_quadratic and polynomial_of(graph, value) == half

    def gradient(self, x: Components, *parameters: Any) -> Components:
        """Return the derivatives (d) with respect to the coordinates ``x`` (d), in any number type."""
        return self._evaluated("gradient", (), x, parameters)

    def gradient_and_value(self, x: Components, *parameters: Any) -> Components:
        """Return the derivatives (d) followed by the energy; both share operations."""
        return self._evaluated("both", (), x, parameters)

    def balanced(self, x: Components, *parameters: Any) -> Any:
        """Return the energy by the operations of its expression, in which long sums have short chains."""
        (value,) = self._evaluated("value", (), x, parameters)
        return value

    def slope(self, index: int, x: Components, *parameters: Any) -> Any:
        """Return the derivative with respect to one coordinate."""
        (derivative,) = self._evaluated(index, (), x, parameters)
        return derivative

    def hessian_times(self, x: Components, vector: Components, *parameters: Any) -> Components:
        """Return the Hessian at ``x`` (d) times ``vector`` (d), in any number type."""
        return self._evaluated("hessian", vector, x, parameters)

    def _evaluated(self, wanted: Any, vector: Components, x: Components, parameters: Sequence[Any]) -> Components:
        arguments = (*x, *parameters)
        if len(arguments) != self.dimension + len(self.parameters):
            raise SystemDefinitionError(
                f"{self.name}: the derivative of {self.formula} is called with {len(x)} coordinates and "
                f"{len(parameters)} parameters, expected {self.dimension} and {len(self.parameters)}"
            )
        constants: tuple[Constant, ...] | None = None
        if parameters and (not self.parameters_at_run_time or all(isinstance(k, Constant) for k in parameters)):
            constants, arguments = tuple(map(_as_constant, parameters)), tuple(x)
        with self._lock:
            if (wanted, constants) not in self._programs:
                made = call(self, self.formula, self._program, wanted, self._trace(constants))
                self._programs[wanted, constants] = made
        return evaluate(self._programs[wanted, constants], (*arguments, *vector))

    def _program(self, wanted: Any, traced: _Traced) -> Program:
        from nearharmonic.core.expression import gradient, hessian_vector
        from nearharmonic.core.program import shortest_program

        graph, value, coordinates = traced
        if wanted == "hessian":
            # The components of the vector follow all other arguments.
            behind = max((node.place for node in graph.nodes if isinstance(node, Variable)), default=-1) + 1
            vector = [v.value for v in graph.variables(behind + self.dimension)[behind:]]
            return shortest_program(graph, hessian_vector(graph, value, coordinates, vector), value)
        if wanted == "value":
            return shortest_program(graph, [value], value)
        derivatives = gradient(graph, value, coordinates)
        if wanted == "both":
            return shortest_program(graph, [*derivatives, value], value)
        return shortest_program(graph, derivatives if wanted == "gradient" else derivatives[wanted : wanted + 1], value)


def _as_constant(parameter: Any) -> Constant:
    """A parameter as a constant, for a formula that needs its value."""
    if hasattr(parameter, "man_exp"):
        return Constant(exact_value(parameter))
    value = constant(parameter)
    if value is None:
        raise SystemDefinitionError(f"a parameter that a formula branches on must be a constant, not {parameter!r}")
    return value


def evaluate(program: Program, arguments: Sequence[Any]) -> Components:
    """Return the results of a program on numbers of one type; constants are as exact as this type allows."""
    results = program.run(arguments, constants_beside(arguments), _function)
    arrays = [x for x in arguments if hasattr(x, "shape") and x.shape]
    if arrays and not all(hasattr(result, "shape") for result in results):  # a derivative that is constant
        results = tuple(result if hasattr(result, "shape") else arrays[0] * 0 + result for result in results)
    return results


def constants_beside(arguments: Sequence[Any]) -> Callable[[Constant], Any]:
    """Return a function that converts exact constants to the type of ``arguments``."""
    scalars = [x.flat[0] if getattr(getattr(x, "dtype", None), "kind", "") == "O" and x.size else x for x in arguments]
    if any(isinstance(x, Number) for x in scalars):
        return lambda c: c
    mp = next((x for x in scalars if hasattr(x, "context")), None)
    if mp is not None:
        return lambda c: mp.context.mpf(c.numerator) / c.denominator
    if any(isinstance(x, Decimal) for x in scalars):
        return lambda c: Decimal(c.numerator) / Decimal(c.denominator)
    if all(isinstance(x, Rational) for x in scalars):
        if any(isinstance(x, Constant) for x in scalars):
            return lambda c: c
        if any(isinstance(x, Fraction) for x in scalars):
            return lambda c: Fraction(c.numerator, c.denominator)
    return float


def _function(name: str, x: Any, *others: Any) -> Any:
    """Return the value of a function of formulas, for a number of any type."""
    if name == "root":
        return arithmetic.sqrt(x)
    if name == "sign":
        return x.sign() if isinstance(x, Number) else _sign(x)
    from nearharmonic import math

    return getattr(math, name)(x, *others)


def _sign(x: Any) -> Any:
    if hasattr(x, "shape"):
        import numpy as np

        return np.where(x < 0, -1.0, 1.0)
    return -1 if x < 0 else 1


Vector = tuple[Any, ...]

# --- Kinetic energies p.M^-1 p / 2: for unit masses, for masses, and for a constant mass matrix with exact inverse.

#: The inverse of the largest double, about 5.6e-309.
SMALLEST_MASS = 1 / Fraction(float_info.max)


def quadratic_T(p: Vector) -> Any:
    """T = p.p / 2, the kinetic energy per unit mass."""
    return sum(x * x for x in p) / 2


def quadratic_grad_T(p: Vector) -> Vector:
    """dT/dp = p for T = p.p / 2."""
    return p


class MassKineticEnergy:
    """T = p.M^-1 p / 2 for masses that are numbers or names of parameters, or for a constant matrix M.

    ``masses`` are d positive numbers, decimal strings, fractions or names of parameters, or a symmetric positive
    definite matrix (d, d) of numbers. A number alone is the mass of the only coordinate.
    """

    def __init__(self, masses: Any, dimension: int, parameters: Collection[str]) -> None:
        #: The arguments.
        self.given = (masses, tuple(parameters))
        if dimension == 1 and isinstance(masses, int | float):
            masses = (masses,)
        if not is_list(masses) or not hasattr(masses, "__len__"):
            raise SystemDefinitionError(f"masses = {masses!r} is no tuple of {dimension} masses")
        if len(masses) != dimension:
            raise SystemDefinitionError(f"masses has {len(masses)} entries, expected {dimension}, one per coordinate")
        self.inverse: tuple[tuple[Constant, ...], ...] | None = None
        self.masses: tuple[int | Constant, ...] = ()
        if all(map(is_list, masses)):
            self.inverse = _inverse(_matrix(masses))
        else:
            names = list(parameters)
            self.masses = tuple(_mass(i, mass, names) for i, mass in enumerate(masses))

    def velocity(self, p: Vector, *parameters: Any) -> Vector:
        """Return dT/dp = M^-1 p."""
        kind = constants_beside(p)
        if self.inverse is None:
            return tuple(
                x / parameters[m] if isinstance(m, int) else (x if m == 1 else x * kind(1 / m))
                for x, m in zip(p, self.masses, strict=True)
            )
        return tuple(sum(x * kind(c) for c, x in zip(row, p, strict=True) if c) for row in self.inverse)

    def __call__(self, p: Vector, *parameters: Any) -> Any:
        """Return T = p.M^-1 p / 2."""
        return sum(x * v for x, v in zip(p, self.velocity(p, *parameters), strict=True)) / 2


def of_masses(
    masses: Sequence[Any] | None, T: Callable[..., Any], dimension: int, parameters: tuple[str, ...], *, alone: bool
) -> Callable[..., Any]:
    """Return the kinetic energy of a system: that of ``masses``, or T if there are no masses; both are refused.

    In a copy T may come from the masses of the original. ``alone`` is True if no gradient of T is given.
    """
    made = T if isinstance(T, MassKineticEnergy) else None
    if masses is None:
        return T if made is None else quadratic_T
    if (made is None and T is not quadratic_T) or not alone:
        raise SystemDefinitionError(
            "masses and T are both given, and each defines the kinetic energy: give one of them"
        )
    if made is not None and made.given == (masses, parameters):
        return made
    return MassKineticEnergy(masses, dimension, parameters)


def takes_parameters(T: Callable[..., Any]) -> bool:
    """Return True if T is a function of the momenta and the parameters, by its signature."""
    if isinstance(T, MassKineticEnergy):
        return True
    try:
        arguments = signature(T).parameters.values()
    except (TypeError, ValueError):  # functions written in C have no signature
        return False
    needed = [x for x in arguments if x.default is Argument.empty]
    positional = sum(x.kind in (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD) for x in needed)
    return positional > 1 or any(x.kind is Argument.VAR_POSITIONAL for x in needed)


def _number(key: str, value: Any) -> Fraction:
    """An entry of ``masses`` as a fraction, which is finite as a double."""
    try:
        number = exact_number(value if isinstance(value, Rational) else decimal(value))
        float(number)
    except (ValueError, TypeError, OverflowError):
        what = "a decimal string or a fraction, such as '0.5', '1/3'"
        message = f"{key} = {shown(value)} is not allowed: it must be {what}, and finite as a double"
        raise SystemDefinitionError(message) from None
    return number


def _mass(i: int, mass: Any, names: list[str]) -> int | Constant:
    """A mass, or the index of its parameter."""
    if mass in names:
        return names.index(mass)
    try:
        number = _number(f"masses[{i}]", mass)
    except SystemDefinitionError as error:
        known = f": {', '.join(names)}" if names else ", of which there is none"
        raise SystemDefinitionError(f"{error}; or the name of a parameter{known}") from None
    if number <= 0:
        raise SystemDefinitionError(f"masses[{i}] = {mass!r} is not allowed: a mass must be positive")
    if number < SMALLEST_MASS:
        raise SystemDefinitionError(f"masses[{i}] = {mass!r} is not allowed: no double holds its inverse")
    return Constant(number)


def _matrix(rows: Sequence[Sequence[Any]]) -> list[list[Fraction]]:
    d = len(rows)
    for i, row in enumerate(rows):
        if len(row) != d:
            raise SystemDefinitionError(f"masses[{i}] has {len(row)} entries, expected {d}: the matrix must be square")
    M = [[_number(f"masses[{i}][{j}]", entry) for j, entry in enumerate(row)] for i, row in enumerate(rows)]
    for i in range(d):
        for j in range(i):
            if M[i][j] != M[j][i]:
                raise SystemDefinitionError(
                    f"masses[{i}][{j}] = {rows[i][j]!r} differs from masses[{j}][{i}] = {rows[j][i]!r}: the matrix "
                    "must be symmetric"
                )
    return M


def _inverse(M: list[list[Fraction]]) -> tuple[tuple[Constant, ...], ...]:
    """The inverse of a symmetric positive definite matrix, by elimination in the order of the coordinates.

    A symmetric matrix is positive definite if and only if all pivots are positive.
    """
    d = len(M)
    rows = [[*row, *(Fraction(i == j) for j in range(d))] for i, row in enumerate(M)]
    for k in range(d):
        pivot = rows[k][k]
        if pivot <= 0:
            what = "singular" if pivot == 0 else "not positive definite"
            raise SystemDefinitionError(f"masses is {what}: the pivot of row {k} is {pivot}")
        rows[k] = [x / pivot for x in rows[k]]
        for i in range(d):
            factor = rows[i][k]
            if i != k and factor:
                rows[i] = [x - factor * y if y else x for x, y in zip(rows[i], rows[k], strict=True)]
    return tuple(tuple(map(Constant, row[d:])) for row in rows)
