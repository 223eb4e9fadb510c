"""Potentials that are functions decorated with ``numba.njit``: evaluation, and substitutes for an expression.

Such functions are not traced, so operations that need an expression of V raise an error.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.number import Constant, Number
from nearharmonic.errors import SystemDefinitionError
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.formulas import Components as Vector
from nearharmonic.systems.formulas import Energy

if TYPE_CHECKING:
    from nearharmonic.core.numba_code import NumbaCode


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
        """Code of both functions, which numba must be able to compile for doubles, and which return the right types."""
        from nearharmonic.core.numba_code import NumbaFunctionError, compiled_code

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
        if any(isinstance(x, Number) for x in numbers):
            emitted = _emitted(formula, count, tuple(q), parameters)
            if emitted is None:
                raise SystemDefinitionError(
                    f"{self.name}: {formula} is a function of numba, which is not traced: what needs its expression "
                    "takes a plain Python function"
                )
            return emitted
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
    from nearharmonic.core.numba_code import called
    from nearharmonic.core.tracing import Double, DoubleDouble

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
        point, along = (np.array(np.broadcast_arrays(*y), float) for y in (x, vector))
        size = np.maximum(np.abs(point).max(axis=0), 2.0**-500) / np.maximum(np.abs(along).max(axis=0), 2.0**-500)
        step = DIFFERENCE * size * along
        ahead, behind = (np.array(self.gradient(tuple(point + s * step), *parameters)) for s in (1, -1))
        return tuple((ahead - behind) / (2 * DIFFERENCE * size))


def is_numba_function(function: object) -> bool:
    """Return True if ``function`` is decorated with ``numba.njit``, without importing numba."""
    dispatcher = sys.modules.get("numba.core.dispatcher")
    return dispatcher is not None and isinstance(function, dispatcher.Dispatcher)


def potential_of(system: Any) -> NumbaPotential | None:
    """Return V and grad_V of ``system`` if they are functions of numba, else None; refuse what such a system cannot
    have.
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
        raise SystemDefinitionError(
            f"{system.name}: V is a function of numba, whose gradient is not derived: give grad_V, which returns one "
            "number per coordinate, as @numba.njit above def grad_V(q, k): return (k * q[0],) for V = k q[0]^2 / 2"
        )
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


def given_function(function: Any) -> Any:
    """Return the function of numba behind a formula of a system; return any other formula unchanged."""
    owner = getattr(function, "__self__", None)
    if isinstance(owner, NumbaPotential):
        return owner.V if function == owner.value else owner.grad_V
    return function


def numba_potential(system: Any) -> NumbaPotential | None:
    """Return the functions of numba of a complete system, or None."""
    owner = getattr(system.V, "__self__", None)
    return owner if isinstance(owner, NumbaPotential) else None


# --- Checks of functions of numba in double precision: comparison of grad_V with differences of V, rounding noise of V.
#
# The module is separate from :mod:`nearharmonic.systems.gradients`, which evaluates formulas in 200 digits.

#: Number of coordinates up to which each component is compared; beyond, the slope along random directions.
SMALL = 12
#: Relative distances of random points from the start; 1 is the box of the initial values.
DISPLACEMENTS = (2.0**-10, 2.0**-4, *[1.0] * 6)
#: Steps of differences, relative to the coordinates. Extrapolated differences have a truncation error of order 4 and a
#: rounding error like 1/step; the best of these steps is used at each point, so a kink of a gradient only leads to a
#: shorter step.
STEPS = 2.0 ** -np.arange(3, 22)
#: A gradient contradicts V if it differs by more than this multiple of the estimated error of the difference. Near the
#: best step the estimate is the difference of two rounding errors, which may be small by chance.
DOUBTS = 16.0
#: Rounding error of a gradient relative to its components: the error of some thousand operations.
ROUNDING = 2.0**-40
#: Number of points on a line, and order of their differences, which estimate rounding noise as the deviation of V from
#: a polynomial: Moré & Wild (2011), Estimating computational noise, doi:10.1137/100786125. The relative distance of
#: neighbouring points is such that V is a polynomial to 2^-100, and rounding errors are independent even if V is
#: computed in single precision.
LINE, ORDER, APART = 12, 6, 2.0**-18
#: Largest difference of two rounding errors over their standard deviation: sqrt(12) for a uniform distribution.
EXTREME = 4.0
#: Number of points at which the noise is sampled, and number of lines through each point. A share of the points with
#: the highest noise is dropped, because a gradient may be discontinuous at a point.
POINTS, DROPPED, LINES = 30, 0.1, 3
#: Largest distances of these points from the start, used alternately, relative to the coordinates.
BOXES = (2.0**-6, 2.0**-3, 0.5, 2.0)


def check_numba_gradient(potential: NumbaPotential, start: Sequence[float], parameters: Sequence[float]) -> None:
    """Compare a gradient with differences of V at random points near the start and in the box of the initial values.

    A point other than the start is skipped if V or the gradient is NaN there.
    """
    q0 = np.array(start)
    _check_start(potential, q0, parameters)
    random, scales = np.random.default_rng(1), _scales(q0)
    for displacement in DISPLACEMENTS:
        point = q0 + displacement * random.uniform(-1, 1, q0.size) * scales
        gradient = np.array(potential.gradient(tuple(point), *parameters))
        if not np.isfinite(gradient).all():
            continue
        weights = scales * random.uniform(0.5, 1, q0.size) * random.choice((-1.0, 1.0), q0.size)
        noise = _noise(potential, point, scales, parameters, random)
        i = _contradiction(potential, point, gradient, weights, noise, parameters)
        if i is not None:
            along = np.where(np.arange(q0.size) == i, scales, 0.0)
            found = _slope(potential, point, along, noise, parameters)[0] / scales[i]
            raise SystemDefinitionError(
                f"{potential.name}: grad_V[{i}] contradicts V: at q = ({', '.join(map(repr, point.tolist()[:12]))}) it "
                f"is {gradient[i]}, and the derivative of V by differences is {found}"
            )


def _check_start(potential: NumbaPotential, q0: Floats, parameters: Sequence[float]) -> None:
    """Refuse functions that raise an exception at the start, and gradients of a wrong length."""
    for formula in ("V", "grad_V"):
        given = tuple(q0.tolist()) if potential.code.takes_tuple else q0.copy()
        try:
            found = getattr(potential, formula)(given, *parameters)
        except Exception as error:
            where = f"raises {type(error).__name__} at the start: {error}"
            raise SystemDefinitionError(f"{potential.name}: {formula} {where}") from error
    if len(found) != q0.size:
        expected = f"expected one number per coordinate: {q0.size}"
        raise SystemDefinitionError(f"{potential.name}: grad_V returns {len(found)} components, {expected}")


def _scales(q0: Floats) -> Floats:
    """Length scales of the coordinates; a coordinate that starts at 0 gets the largest."""
    largest = np.abs(q0).max() or 1.0
    return np.where(q0 == 0, largest, np.abs(q0))


def _contradiction(
    potential: NumbaPotential,
    point: Floats,
    gradient: Floats,
    weights: Floats,
    noise: float,
    parameters: Sequence[float],
) -> int | None:
    """A component that contradicts V: found by comparison of each if there are few, otherwise by bisection."""

    def contradicts(indices: range) -> bool:
        along = np.zeros_like(point)
        along[indices.start : indices.stop] = weights[indices.start : indices.stop]
        slope, error = _slope(potential, point, along, noise, parameters)
        terms = gradient * along
        return bool(abs(terms.sum() - slope) > DOUBTS * error + ROUNDING * np.abs(terms).sum())

    indices = range(point.size)
    if point.size <= SMALL:
        return next((i for i in indices if contradicts(indices[i : i + 1])), None)
    if not contradicts(indices):
        return None
    while len(indices) > 1:  # if a sum has a larger error than allowed, one of its halves has, too
        left, right = indices[: len(indices) // 2], indices[len(indices) // 2 :]
        indices = left if contradicts(left) else right
    return indices[0] if contradicts(indices) else None


def _slope(
    potential: NumbaPotential, point: Floats, along: Floats, noise: float, parameters: Sequence[float]
) -> tuple[float, float]:
    """The derivative of V along a direction by extrapolated central differences, and its estimated error."""
    steps = STEPS[:, None]
    ahead, behind = (potential.value(tuple((point + s * steps * along).T), *parameters) for s in (1, -1))
    central = (ahead - behind) / (2 * STEPS)
    extrapolated = (4 * central[1:] - central[:-1]) / 3  # Richardson extrapolation from the steps 2 h and h
    rounding = noise + np.maximum(np.abs(ahead), np.abs(behind)) * 2.0**-53
    errors = np.abs(np.diff(extrapolated)) + (2 * rounding / STEPS)[2:]
    if not np.isfinite(errors).any():
        return 0.0, np.inf
    best = int(np.nanargmin(np.where(np.isfinite(errors), errors, np.nan)))
    return float(extrapolated[best + 1]), float(errors[best])


def _noise(
    potential: NumbaPotential, point: Floats, scales: Floats, parameters: Sequence[float], random: np.random.Generator
) -> float:
    """The largest difference of two rounding errors of V near a point."""
    squares = []
    for _ in range(LINES):
        along = APART * random.uniform(-1, 1, point.size) * scales
        points = point + np.arange(-LINE / 2, LINE / 2)[:, None] * along
        values = potential.value(tuple(points.T), *parameters)
        squares.append(np.mean(np.diff(values, ORDER) ** 2) / comb(2 * ORDER, ORDER))
    return EXTREME * float(np.sqrt(np.mean(squares)))


def rounding_noise(
    potential: NumbaPotential, start: Sequence[float], parameters: Sequence[float], highest: float
) -> float:
    """Return the largest rounding error of V, in its unit; smaller energy errors cannot be measured.

    It is the maximum of the difference of two rounding errors and of the change of V by the rounding of its arguments
    to doubles, over random points around the start where V <= ``highest``, without the highest tenth. The bound is the
    energy of the orbit.
    """
    q0, random = np.array(start), np.random.default_rng(2)
    scales, found = _scales(q0), []
    for i in range(POINTS):
        point = q0 + BOXES[i % len(BOXES)] * random.uniform(-1, 1, q0.size) * scales
        V = potential.value(tuple(point), *parameters)
        gradient = np.array(potential.gradient(tuple(point), *parameters))
        if not (np.isfinite(V) and np.isfinite(gradient).all()) or highest < V:
            continue
        arguments = float((np.abs(gradient) * np.spacing(np.abs(point))).sum()) / 2
        noise = _noise(potential, point, scales, parameters, random) + arguments
        found += [noise] * bool(np.isfinite(noise))
    return float(np.quantile(found, 1 - DROPPED, method="lower")) if found else 0.0
