"""Potentials that are functions decorated with ``numba.njit``: evaluation, and substitutes for an expression.

Such functions are not traced, so operations that need an expression of V raise an error.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import TYPE_CHECKING, Any

from nearharmonic.core.formulas.constant import Constant, Value
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.systems.definition.members import Members
from nearharmonic.systems.formulas.energy import Energy, Vector

if TYPE_CHECKING:
    from nearharmonic.core.machine.numba_functions import NumbaCode

#: Step of a difference of gradients, relative to the coordinates: truncation and rounding errors are then equally
#: large.
DIFFERENCE = 2.0**-17
#: Largest number of coordinates: a kernel takes 0.5 s to compile for 9, 2 s for 64 and 18 s for 256.
MOST_COORDINATES = 256


@dataclass(frozen=True, eq=False)
class NumbaPotential:
    """V and grad_V of a system, functions of numba of the coordinates (a tuple or an array) and of the parameters."""

    name: str
    V: Any
    grad_V: Any
    dimension: int
    parameters: int

    @cached_property
    def code(self) -> NumbaCode:
        """Code of both functions.

        Raises
        ------
        SystemDefinitionError
            numba cannot compile them for doubles, or they return wrong types.
        """
        from nearharmonic.core.machine.numba_functions import NumbaFunctionError, compiled_code

        try:
            return compiled_code(self.V, self.grad_V, self.dimension, self.parameters)
        except NumbaFunctionError as error:
            raise SystemDefinitionError(f"{self.name}: {error}") from error

    def value(self, q: Vector, *parameters: Any) -> Any:
        """Return V in double precision: a number, an array of numbers, or a value of a kernel."""
        (V,) = self._evaluated("V", 1, q, parameters)
        return V

    def gradient(self, q: Vector, *parameters: Any) -> Vector:
        """Return the components of the gradient in double precision, as :meth:`value` returns V."""
        return self._evaluated("grad_V", self.dimension, q, parameters)

    def _evaluated(self, formula: str, count: int, q: Vector, parameters: Vector) -> Vector:
        numbers = (*q, *parameters)
        if any(isinstance(x, Value) for x in numbers):
            emitted = _emitted(formula, count, tuple(q), parameters)
            if emitted is None:
                raise SystemDefinitionError(
                    f"{self.name}: {formula} is a function of numba, which is not traced: what needs its expression "
                    "takes a plain Python function"
                )
            return emitted
        import numpy as np

        function = getattr(self, formula)
        arrays = np.broadcast_arrays(*(np.asarray(x, float) for x in numbers))
        table = np.stack([x.ravel() for x in arrays], axis=-1)
        found = np.array([self._at(function, row) for row in table]).reshape(-1, count).T
        shape = arrays[0].shape
        return tuple(x.reshape(shape) if shape else float(x[0]) for x in found)

    def _at(self, function: Any, row: Any) -> Any:
        """A value at one point; NaN if the function raises an exception, as in a kernel."""
        q, parameters = row[: self.dimension], row[self.dimension :].tolist()
        given = tuple(q.tolist()) if self.code.takes_tuple else q.copy()
        try:
            return function(given, *parameters)
        except Exception:  # of any type
            return nan if function is self.V else [nan] * self.dimension


def _emitted(formula: str, count: int, q: Vector, parameters: Vector) -> Vector | None:
    """Results of a call in a kernel, in double precision; None if the arguments are not values of a kernel."""
    from nearharmonic.core.formulas.tracing import Double, DoubleDouble
    from nearharmonic.core.machine.numba_functions import called

    like = next((x for x in q if isinstance(x, Double | DoubleDouble)), None)
    if like is None:
        return None
    first = like.high if isinstance(like, DoubleDouble) else like.carrier
    values = [
        first.constant(float(x)) if isinstance(x, Constant) else x.high if isinstance(x, DoubleDouble) else x.carrier
        for x in (*q, *parameters)
    ]
    found = called(formula, count, values[: len(q)], values[len(q) :])
    if isinstance(like, DoubleDouble):
        return tuple(DoubleDouble(x, x.constant(0.0)) for x in found)
    return tuple(Double(x) for x in found)


class NumbaEnergy(Energy):
    """V of numba in place of an expression: its gradient is given, its Hessian is computed by differences."""

    traced = is_long = False
    parameters_at_run_time = True

    def __init__(self, potential: NumbaPotential, parameters: tuple[Constant, ...]) -> None:
        super().__init__(potential.name, "V", potential.value, potential.dimension, parameters)
        self.potential = potential

    def trace(self) -> None:
        """Compile the functions, unless they are compiled already."""
        _ = self.potential.code

    def gradient(self, x: Vector, *parameters: Any) -> Vector:
        return self.potential.gradient(x, *parameters)

    def gradient_and_value(self, x: Vector, *parameters: Any) -> Vector:
        return (*self.potential.gradient(x, *parameters), self.potential.value(x, *parameters))

    def hessian_times(self, x: Vector, vector: Vector, *parameters: Any) -> Vector:
        """Return the Hessian times ``vector`` by a central difference of gradients, in double precision."""
        import numpy as np

        point, along = (np.array(np.broadcast_arrays(*y), float) for y in (x, vector))
        size = np.maximum(np.abs(point).max(axis=0), 2.0**-500) / np.maximum(np.abs(along).max(axis=0), 2.0**-500)
        step = DIFFERENCE * size * along
        ahead, behind = (np.array(self.gradient(tuple(point + s * step), *parameters)) for s in (1, -1))
        return tuple((ahead - behind) / (2 * DIFFERENCE * size))


def is_numba_function(function: object) -> bool:
    """Return True if ``function`` is decorated with ``numba.njit``, without importing numba."""
    dispatcher = sys.modules.get("numba.core.dispatcher")
    return dispatcher is not None and isinstance(function, dispatcher.Dispatcher)


def potential_of(system: Members) -> NumbaPotential | None:
    """Return V and grad_V of ``system`` if they are functions of numba, else None.

    Raises
    ------
    SystemDefinitionError
        Only one of them is a function of numba, T is one, or the system declares a property of expressions.
    """
    V, grad_V = given_function(system.V), given_function(system.grad_V)
    for formula in ("T", "grad_T"):
        if is_numba_function(getattr(system, formula)):
            raise SystemDefinitionError(
                f"{system.name}: {formula} is a function of numba, which V and grad_V alone may be: give a plain "
                "Python function, or masses"
            )
    compiled = is_numba_function(V)
    if compiled and grad_V is None:
        raise SystemDefinitionError(f"{system.name}: {_HOW}")
    if compiled != is_numba_function(grad_V):
        one, other = ("V", "grad_V") if compiled else ("grad_V", "V")
        message = f"{one} is a function of numba and {other} is not: both must be, or neither"
        raise SystemDefinitionError(f"{system.name}: {message}")
    if not compiled:
        return None
    for key in ("time_dependent", "regularisation", "harmonic", "gravity"):
        if getattr(system, key):
            raise SystemDefinitionError(
                f"{system.name}: {key} = {getattr(system, key)!r} is not allowed for a V of numba: it needs the "
                "expression of V, and functions of numba are not traced"
            )
    if len(system.q0) > MOST_COORDINATES:
        raise SystemDefinitionError(
            f"{system.name}: q0 has {len(system.q0)} components, and a system with a V of numba has at most "
            f"{MOST_COORDINATES}: its states are kept in variables of their own, and compiling more takes minutes"
        )
    kept = getattr(system.V, "__self__", None)
    wanted = V, grad_V, len(system.q0), len(system.parameters)
    if isinstance(kept, NumbaPotential) and (kept.V, kept.grad_V, kept.dimension, kept.parameters) == wanted:
        return kept
    return NumbaPotential(system.name, *wanted)


#: Message for a missing gradient.
_HOW = (
    "V is a function of numba, whose gradient is not derived: give grad_V, which returns one number per coordinate, as "
    "@numba.njit above def grad_V(q, k): return (k * q[0],) for V = k q[0]^2 / 2"
)


def given_function(function: Any) -> Any:
    """Return the function of numba behind a formula of a system; return any other formula unchanged."""
    owner = getattr(function, "__self__", None)
    if isinstance(owner, NumbaPotential):
        return owner.V if function == owner.value else owner.grad_V
    return function


def numba_potential(system: Members) -> NumbaPotential | None:
    """Return the functions of numba of a complete system, or None."""
    owner = getattr(system.V, "__self__", None)
    return owner if isinstance(owner, NumbaPotential) else None
