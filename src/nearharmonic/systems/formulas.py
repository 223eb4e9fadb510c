"""Formulas of a system: energies as expressions, kinetic energies of masses, extended phase space, regularisation."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property, partial
from inspect import Parameter as Argument
from inspect import signature
from numbers import Rational
from sys import float_info
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple

from nearharmonic.core import arithmetic
from nearharmonic.core.arithmetic import sqrt
from nearharmonic.core.expression import Graph, Value, Variable, becomes_loops, check_size, operations, value_of
from nearharmonic.core.number import (
    NO_SUCH_COMPONENT,
    Constant,
    FormulaError,
    Number,
    call,
    components,
    constant,
    scalar,
)
from nearharmonic.core.tracing import Hamiltonian
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
        from nearharmonic.core.terms import LoopedEnergy

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
            self.inverse = _inverse(_mass_matrix(masses))
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
    """Return the kinetic energy of a system, from ``masses`` or from T; both together are refused.

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


def _mass_matrix(rows: Sequence[Sequence[Any]]) -> list[list[Fraction]]:
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


# --- Kepler's problem as a perturbed oscillator: the regularisations of Levi-Civita and of Kustaanheimo and Stiefel.
#
# For H = |p|^2/2 - GM/r + R(q) with H = -w < 0, let u be coordinates with q = L(u) u and r = |u|^2, s a fictitious time
# with dt = r ds, and v = du/ds the momenta. Then r (H + w) / 4 = |v|^2/2 + w |u|^2/4 + |u|^2 R/4 - GM/4. This is an
# oscillator of frequency sqrt(w/2), perturbed by |u|^2 R/4. It is separable, and quadratic in the momenta. Energy and
# time are one more conjugate pair: the position w = -H, on which T does not depend, and the momentum -t/4, since
# dV/dw = |u|^2/4.
#
# L(u) is a matrix with orthogonal columns. In the plane it is the matrix of Levi-Civita (1920), doi:10.1007/BF02404404,
# where q = u^2 as complex numbers. In space it is the matrix of Kustaanheimo & Stiefel (1965),
# doi:10.1515/crll.1965.218.204, with four coordinates; the start satisfies their bilinear relation. Source of both:
# Stiefel & Scheifele (1971), Linear and Regular Celestial Mechanics.


@dataclass(frozen=True)
class Regularisation:
    """Regularisation of a system with an attracting centre, which removes the singularity.

    Parameters
    ----------
    gravity : str
        Name of the parameter GM.
    perturbation : callable, optional
        R as ``f(q, r, *parameters)``. The argument r = |q| is known, so that R need not compute a root.
    strength : str, optional
        Name of a parameter that is a factor of R: if it is 0, R is not computed.
    """

    gravity: str
    perturbation: Callable[..., Any] | None = None
    strength: str | None = None


@dataclass(frozen=True)
class RegularisedFormulas:
    """The formulas and the maps of a regularised system, for numbers of any type.

    Positions are ``u``, 2 coordinates in the plane and 4 in space, followed by w. Momenta are ``v`` followed by -t/4.
    ``gravity`` is the index of GM among the parameters, and ``dimension`` the dimension of physical space, 2 or 3.
    """

    regularisation: Regularisation
    gravity: int
    dimension: int

    @property
    def coordinates(self) -> int:
        """Number of coordinates, including w."""
        return 3 if self.dimension == 2 else 5

    def V(self, x: Vector, *parameters: Any) -> Any:
        """Return |u|^2 (w + R)/4."""
        *u, w = x
        r = _square(u)
        field = w if self.regularisation.perturbation is None else w + self._perturbation(tuple(u), r, *parameters)
        return r * field / 4

    def T(self, y: Vector, *_: Any) -> Any:
        """Return |v|^2/2; it does not depend on the momentum of w."""
        return _square(y[:-1]) / 2

    def _perturbation(self, u: Vector, r: Any, *parameters: Any) -> Any:
        assert self.regularisation.perturbation is not None
        return self.regularisation.perturbation(self._position(u), r, *parameters)

    def _position(self, u: Vector) -> Vector:
        return tuple(sum(a * b for a, b in zip(row, u, strict=True)) for row in _square_roots(u)[: self.dimension])

    def energies(self, x: Vector, y: Vector, *parameters: Any) -> tuple[Any, Any]:
        """Return |p|^2/2 = 2 |v|^2/r, and -GM/r + R."""
        u, v = x[:-1], y[:-1]
        r = _square(u)
        V = -parameters[self.gravity] / r
        if self.regularisation.perturbation is not None:
            V = V + self._perturbation(u, r, *parameters)
        return 2 * _square(v) / r, V

    def from_physical(self, q: Vector, p: Vector, *parameters: Any) -> tuple[Vector, Vector]:
        """Return (u, w) and (v, -t/4) of a physical state at t = 0."""
        r = sqrt(_square(q))
        u = self._root(q, r)
        momenta = (*p, *[p[0] * 0] * (len(u) - len(p)))
        v = tuple(sum(row[k] * c for row, c in zip(_square_roots(u), momenta, strict=True)) / 2 for k in range(len(u)))
        w = parameters[self.gravity] / r - _square(p) / 2
        if self.regularisation.perturbation is not None:
            w = w - self.regularisation.perturbation(q, r, *parameters)
        return (*u, w), (*v, w * 0)

    def to_physical(self, x: Vector, y: Vector) -> tuple[Vector, Vector]:
        """Return q = L(u) u and p = 2 L(u) v / r."""
        u, v = x[:-1], y[:-1]
        r = _square(u)
        rows = _square_roots(u)[: self.dimension]
        return self._position(u), tuple(2 * sum(a * b for a, b in zip(row, v, strict=True)) / r for row in rows)

    def inverse_axis(self, x: Vector, *parameters: Any) -> Any:
        """Return 1/a = 2 w/GM with the semi-major axis a: the period of an orbit in s over its period in t."""
        return 2 * x[-1] / parameters[self.gravity]

    def largest_radius(self, x: Vector, y: Vector, *parameters: Any) -> Any:
        """Return the distance a (1 + e) of the apoapsis of the unperturbed orbit."""
        u, v, GM = x[:-1], y[:-1], parameters[self.gravity]
        a = GM / (2 * x[-1])
        cosine, sine = 1 - _square(u) / a, 2 * sum(b * c for b, c in zip(u, v, strict=True))
        return a * (1 + sqrt(cosine * cosine + sine * sine / (GM * a)))

    def _root(self, q: Vector, r: Any) -> Vector:
        """u with L(u) u = q: from the larger of two possible roots, so that nothing cancels."""
        right = (1 + _side(q[0])) / 2
        large = sqrt((r + abs(q[0])) / 2)
        small = [c / (2 * large) for c in q[1:]]
        first, second = _swapped(right, large, small[0])
        if self.dimension == 2:
            return first, second
        fourth, third = _swapped(right, large * 0, small[1])
        return first, second, third, fourth


def _swapped(right: Any, a: Any, b: Any) -> tuple[Any, Any]:
    """(a, b) if ``right`` is 1, (b, a) if it is 0: exact, and without a branch."""
    left = 1 - right
    return right * a + left * b, left * a + right * b


def _side(x: Any) -> Any:
    return x.sign() if hasattr(x, "sign") else (x >= 0) * 2 - 1


def _square(x: Any) -> Any:
    return sum(c * c for c in x)


def _square_roots(u: Vector) -> tuple[Vector, ...]:
    """L(u), whose rows are orthogonal and have the length |u|."""
    if len(u) == 2:
        return (u[0], -u[1]), (u[1], u[0])
    a, b, c, d = u
    return (a, -b, -c, d), (b, a, -d, -c), (c, d, a, b), (d, -c, b, -a)


# --- Formulas of the extended phase space, and adapters for formulas without parameters.
#
# A system with V(q, t) is extended to an autonomous system, whose last coordinate is the time t with the conjugate
# momentum p_t: H = T(p) + p_t + V(q, t). Then dt/dt = 1, dp_t/dt = -dV/dt, and H is conserved. p_t starts at 0, so that
# -p_t is the energy that the system has received. T + p_t has degree 2 in the momenta if T has. Source: Hairer,
# Lubich &
# Wanner (2006), Geometric Numerical Integration, Sec. VI.1 (extended phase space).


class DerivedGradient:
    """The gradient of an energy, derived at the first call."""

    def __init__(self, energy: Energy, time_dependent: bool = False) -> None:
        self.energy, self.time_dependent = energy, time_dependent

    def __call__(self, x: Vector, *others: Any) -> Vector:
        if self.time_dependent:
            t, *parameters = others
            return self.energy.gradient((*x, t), *parameters)[:-1]
        return self.energy.gradient(tuple(x), *others)


def with_parameters(formula: Callable[..., Any], count: int) -> Callable[..., Any]:
    """Return T or grad_T, which may take no parameters, as a function of momenta and parameters."""
    taken = not count or isinstance(formula, DerivedGradient) or takes_parameters(formula)
    return formula if taken else partial(_without_parameters, formula)


# The functions below take their first arguments by functools.partial, which can be pickled and compared by what it has.
def _without_parameters(formula: Callable[..., Any], p: Vector, *_: Any) -> Any:
    return formula(p)


def extended_V(V: Callable[..., Any], x: Vector, *parameters: Any) -> Any:
    """V(q, t) as a function of the coordinates (q, t)."""
    *q, t = x
    return _of_time(V, tuple(q), t, *parameters)


def _of_time(formula: Callable[..., Any], q: Vector, t: Any, *parameters: Any) -> Any:
    """Call V or grad_V; error messages do not count the time as a coordinate."""
    try:
        return formula(q, t, *parameters)
    except IndexError as error:
        if str(error) != NO_SUCH_COMPONENT:
            raise
        raise IndexError(f"{error}: {components('q', len(q))}") from error


def extended_force(grad_V: Callable[..., Vector], potential: Energy, x: Vector, *parameters: Any) -> Vector:
    """(dV/dq, dV/dt): dV/dq is given with the system, dV/dt is derived."""
    *q, t = x
    force = tuple(_of_time(grad_V, tuple(q), t, *parameters))
    if len(force) != len(q):
        raise FormulaError(f"returns {len(force)} components, expected a tuple of {len(q)}, one number per coordinate")
    return *force, potential.slope(len(q), x, *parameters)


def extended_T(T: Callable[..., Any], p: Vector, *parameters: Any) -> Any:
    """T(p) + p_t."""
    return T(p[:-1], *parameters) + p[-1]


def extended_velocity(grad_T: Callable[..., Vector], p: Vector, *parameters: Any) -> Vector:
    """(dT/dp, 1)."""
    return *grad_T(p[:-1], *parameters), 1


@dataclass(frozen=True, kw_only=True)
class Formulas(Hamiltonian):
    """The integrated formulas of a system.

    ``hessian_V_times(q, vector, *parameters)`` and ``hessian_T_times(p, vector, *parameters)`` are derived from V and
    T. ``energies`` are V and T as expressions, and ``regularised`` holds the maps of a regularised system.
    """

    acceleration: Callable[..., Vector]
    hessian_V_times: Callable[..., Vector]
    hessian_T_times: Callable[..., Vector]
    energies: tuple[Energy, Energy]
    regularised: RegularisedFormulas | None = None

    @property
    def are_loops(self) -> bool:
        """True if kernels of the system are loops, for one trajectory at a time."""
        return self.energies[0].traced and any(energy.is_long for energy in self.energies)


def formulas_of(system: Any, potential: Energy, kinetic_energy: Energy) -> Formulas:
    """Return the integrated formulas of ``system``, with derived gradients where it has none.

    V is a function of the integrated coordinates, which include the time if V depends on it, T of the system's momenta.
    """
    T, grad_T = kinetic_energy.function, with_parameters(system.grad_T, len(system.parameters))
    grad_V = None if isinstance(system.grad_V, DerivedGradient) else system.grad_V
    if system.time_dependent:
        grad_V = grad_V and partial(extended_force, grad_V, potential)
        T, grad_T = partial(extended_T, T), partial(extended_velocity, grad_T)
    kinetic = Energy(system.name, "T", T, potential.dimension, kinetic_energy.parameters)
    return _of_energies(potential, kinetic, grad_V, grad_T, partial(_acceleration, system, kinetic_energy))


def regularised_formulas(system: Any) -> Formulas:
    """Return the formulas of the oscillator of ``system``, which has a ``regularisation`` that fits it."""
    given = system.regularisation
    assert given is not None
    places, named = list(system.parameters), {given.gravity, given.strength or given.gravity}
    fits = system.dimension in (2, 3) and system.unit_masses and not system.time_dependent
    if not (fits and named <= set(places)):
        raise SystemDefinitionError(
            f"{system.name}: regularisation = {given!r} is not allowed: it is for two or three coordinates, masses of "
            "1, V that does not depend on time, and parameters of the names of gravity and strength"
        )
    maps = RegularisedFormulas(given, places.index(given.gravity), system.dimension)
    constants = system.constants(Constant)
    V = Energy(system.name, "V", maps.V, maps.coordinates, constants)
    T = Energy(system.name, "T", maps.T, maps.coordinates, constants)

    def without_last(x: Vector, *_: Any) -> Vector:
        return *x[:-1], Constant(0)

    return _of_energies(V, T, None, without_last, without_last, maps)


def _of_energies(
    potential: Energy, kinetic: Energy, grad_V: Any, grad_T: Any, acceleration: Any,
    regularised: RegularisedFormulas | None = None,
) -> Formulas:  # fmt: skip
    """Return the formulas of V and T; the gradient of V is derived if ``grad_V`` is None."""
    V, derived = potential.function, grad_V is None
    return Formulas(
        name=potential.name,
        dimension=potential.dimension,
        V=V,
        grad_V=potential.gradient if derived else grad_V,
        T=kinetic.function,
        grad_T=grad_T,
        grad_V_and_V=potential.gradient_and_value if derived else lambda q, *given: (*grad_V(q, *given), V(q, *given)),
        balanced_T=kinetic.balanced,
        hessian_V_times=potential.hessian_times,
        hessian_T_times=kinetic.hessian_times,
        acceleration=acceleration,
        energies=(potential, kinetic),
        regularised=regularised,
    )


def _acceleration(system: Any, kinetic_energy: Energy, force: Vector, *parameters: Any) -> Vector:
    """The acceleration in a system whose T is quadratic; it is 0 for the time coordinate of an extended system."""
    own, clock = (force[:-1], (Constant(0),)) if system.time_dependent else (force, ())
    if isinstance(system.T, MassKineticEnergy):
        return *system.T.velocity(own, *parameters), *clock
    return *(own if system.unit_masses else kinetic_energy.hessian_times(own, own, *parameters)), *clock
