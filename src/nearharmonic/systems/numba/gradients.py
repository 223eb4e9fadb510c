"""Checks of functions of numba in double precision: comparison of grad_V with differences of V, rounding noise of V.

The module is separate from :mod:`nearharmonic.systems.formulas.gradients`, which evaluates formulas in 200 digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.errors import SystemDefinitionError
from nearharmonic.numerics.types import Floats

if TYPE_CHECKING:
    from nearharmonic.systems.numba.potential import NumbaPotential


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
#: Rounding error of a gradient relative to its components: that of some thousand operations.
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

    Raises
    ------
    SystemDefinitionError
        A component differs from the derivative of V, or a function raises an exception at the start.
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

    d = point.size
    candidates: Any = range(d) if d <= SMALL else bisected(contradicts, range(d))
    return next((i for i in candidates if contradicts(range(i, i + 1))), None)


def bisected(contradicts: Callable[[range], bool], indices: range) -> Iterator[int]:
    """The index among ``indices`` that contradicts, if the sum over all of them does.

    If the error of a sum exceeds the sum of the allowed errors, so does that of one of its halves.
    """
    if not contradicts(indices):
        return
    while len(indices) > 1:
        left, right = indices[: len(indices) // 2], indices[len(indices) // 2 :]
        indices = left if contradicts(left) else right
    yield indices[0]


def _slope(
    potential: NumbaPotential, point: Floats, along: Floats, noise: float, parameters: Sequence[float]
) -> tuple[float, float]:
    """The derivative of V along a direction by extrapolated central differences, and its estimated error."""
    steps = STEPS[:, None]
    ahead, behind = (_values(potential, point + s * steps * along, parameters) for s in (1, -1))
    central = (ahead - behind) / (2 * STEPS)
    extrapolated = (4 * central[1:] - central[:-1]) / 3  # Richardson extrapolation from the steps 2 h and h
    rounding = noise + np.maximum(np.abs(ahead), np.abs(behind)) * 2.0**-53
    errors = np.abs(np.diff(extrapolated)) + (2 * rounding / STEPS)[2:]
    if not np.isfinite(errors).any():
        return 0.0, np.inf
    best = int(np.nanargmin(np.where(np.isfinite(errors), errors, np.nan)))
    return float(extrapolated[best + 1]), float(errors[best])


def _values(potential: NumbaPotential, points: Floats, parameters: Sequence[float]) -> Floats:
    """V (N,) at points (N, d)."""
    return np.asarray(potential.value(tuple(points.T), *parameters))


def _noise(
    potential: NumbaPotential, point: Floats, scales: Floats, parameters: Sequence[float], random: np.random.Generator
) -> float:
    """The largest difference of two rounding errors of V near a point."""
    squares = []
    for _ in range(LINES):
        along = APART * random.uniform(-1, 1, point.size) * scales
        values = _values(potential, point + np.arange(-LINE / 2, LINE / 2)[:, None] * along, parameters)
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
