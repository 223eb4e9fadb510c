"""Numerical functions whose results are bitwise identical on every processor, and types of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, localcontext
from functools import cache, reduce
from itertools import combinations
from math import frexp, fsum, isfinite, isqrt, ldexp, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import Floats
from nearharmonic.math import log

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Bools", "Floats", "Integers"]
Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]

# --- Geometric progressions in decimal arithmetic, bitwise identical on every processor, without numpy.
#
# A double means the shortest decimal that it prints as.

#: Digits of the arithmetic: a double rounded from them is correctly rounded, except for one in 10^20.
DIGITS = 40


def geometric(lowest: float, highest: float, count: int) -> list[float]:
    """Return ``count`` numbers from ``lowest`` to ``highest``, evenly in the logarithm; ``lowest`` if one."""
    with localcontext(prec=DIGITS):
        first, last = _decimal(lowest), _decimal(highest)
        inner = [float(first * (last / first) ** (Decimal(i) / (count - 1))) for i in range(1, count - 1)]
    return [float(lowest), *inner, float(highest)][:count]


def decades(lowest: float, per_decade: float, begin: int, end: int) -> list[Decimal]:
    """Return ``lowest`` * 10^(i / ``per_decade``) for ``begin`` <= i < ``end``, not rounded to doubles."""
    count = max(end - begin, 0)
    stride = isqrt(count) + 1
    # Each is the product of two of about 2 sqrt(count) powers: a power takes a hundred times as long as a product. Four
    # more digits make the whole powers of ten exact again.
    with localcontext(prec=DIGITS + 4):
        first, each = _decimal(lowest), _decimal(per_decade)
        coarse = [first * Decimal(10) ** (Decimal(i) / each) for i in range(begin, end, stride)]
        fine = [Decimal(10) ** (Decimal(i) / each) for i in range(min(stride, count))]
    with localcontext(prec=DIGITS):
        return [one * other for one in coarse for other in fine][:count]


def _decimal(x: float) -> Decimal:
    return Decimal(repr(float(x)))


# --- Numerical functions for result files, whose results are bitwise identical on every processor.
#
# numpy, BLAS, LAPACK and the C library select their code by the processor, so the rounding of their logarithms, sines,
# powers and matrix products differs between processors. Here elementary functions come from
# :mod:`nearharmonic.math`, sums are exact and rounded once, and all other operations are ``+ - * /`` and ``sqrt`` in a
# fixed order.

#: Largest number of sweeps of rotations, each of which squares the off-diagonal elements, and their final relative
#: size.
SWEEPS, LEFT = 30, 2.0**-60


def total(terms: Any) -> float:
    """Return the exact sum of the elements of an array, rounded once; infinite or NaN if an element is."""
    values = np.asarray(terms, dtype=float)
    with np.errstate(invalid="ignore"):
        return fsum(values.ravel().tolist()) if np.isfinite(values).all() else float(values.sum())


def totals(rows: Any) -> Floats:
    """Return what :func:`total` does for each row (..., n) of an array (...).

    Rounds take the leading bits of all terms of a row, as many as add up without rounding: Rump, Ogita & Oishi (2008),
    SIAM J. Sci. Comput. 31, 189.
    """
    left = np.asarray(rows, dtype=float)
    shape, spare, parts = left.shape[:-1], left.shape[-1].bit_length() + 1, [np.zeros(left.shape[:-1])]
    while (largest := np.maximum(left.max(-1, initial=0.0), -left.min(-1, initial=0.0))).any():
        if not largest.max() < 2.0**900:  # also for NaN
            return np.array([total(row) for row in left.reshape(-1, left.shape[-1])]).reshape(shape)
        unit = np.ldexp(1.0, np.frexp(largest)[1] + spare)[..., None]
        high = left + unit
        high -= unit
        parts.append(high.sum(axis=-1))
        left = np.subtract(left, high, out=high)
    return np.array([fsum(one) for one in np.stack(parts, axis=-1).reshape(-1, len(parts)).tolist()]).reshape(shape)


def dot(one: Any, other: Any) -> float:
    """Return the exact sum of the rounded products of elements, rounded once."""
    return total(np.asarray(one) * np.asarray(other))


def log10(x: Any) -> Any:
    """Return the logarithm to base 10 of a float or of an array, to about 1 ulp."""
    return log(x) / log(10.0)


def nearest_power_of_two(x: float) -> float:
    """Return the power of two nearest to x > 0 in logarithm; x itself if it is not finite."""
    if not isfinite(x):
        return x
    mantissa, exponent = frexp(x)
    return ldexp(1.0, exponent if mantissa >= sqrt(0.5) else exponent - 1)


def product(rows: Floats, matrix: Floats) -> Floats:
    """Return the matrix product of ``rows`` (..., n) with a matrix (n, m), summed in the order of its rows."""
    found = np.zeros((*rows.shape[:-1], matrix.shape[1]))
    for k, row in enumerate(matrix):
        found += rows[..., k, None] * row
    return found


def eigen(matrices: Any) -> tuple[Floats, Floats]:
    """Return the eigenvalues (..., n), ascending, and eigenvectors in columns of symmetric matrices (..., n, n).

    Jacobi's rotations, row by row: Golub & Van Loan (2013), Matrix Computations, Sec. 8.5.
    """
    A = np.array(matrices, dtype=float)
    n = A.shape[-1]
    vectors = np.broadcast_to(np.eye(n), A.shape).copy()
    for _ in range(SWEEPS):
        if (np.abs(A * (1 - np.eye(n))).max(axis=(-2, -1)) <= LEFT * np.abs(A).max(axis=(-2, -1))).all():
            break
        for i, j in combinations(range(n), 2):
            _rotate(A, vectors, i, j)
    values = np.diagonal(A, axis1=-2, axis2=-1)
    order = np.argsort(values, axis=-1, kind="stable")
    return np.take_along_axis(values, order, -1), np.take_along_axis(vectors, order[..., None, :], -1)


def _rotate(A: Floats, vectors: Floats, i: int, j: int) -> None:
    """Make A[..., i, j] zero by rotations in the plane of i and j, in place."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = (A[..., j, j] - A[..., i, i]) / (2 * A[..., i, j])
        t = np.where(ratio >= 0, 1.0, -1.0) / (np.abs(ratio) + np.sqrt(1 + ratio * ratio))
    t = np.where(A[..., i, j] == 0, 0.0, t)[..., None]
    c = 1 / np.sqrt(1 + t * t)
    s = t * c
    for rows in (A, A.swapaxes(-1, -2), vectors.swapaxes(-1, -2)):
        first, second = rows[..., i, :].copy(), rows[..., j, :].copy()
        rows[..., i, :], rows[..., j, :] = c * first - s * second, s * first + c * second
    A[..., i, j] = A[..., j, i] = 0.0


def norms(matrices: Floats) -> Floats:
    """Return the 2-norms (...) of matrices (..., m, n): their largest singular values."""
    squares = (matrices[..., :, :, None] * matrices[..., :, None, :]).sum(axis=-3)
    found: Floats = np.sqrt(eigen(squares)[0][..., -1])
    return found


# --- Statistics of runs: slopes above the round-off plateau, trends and their intervals, Student's t, the jackknife.

#: Points of a curve below this multiple of its lowest point may be round-off errors rather than truncation errors.
PLATEAU = 100.0
#: Above this relative error the leading term does not determine the slope.
ASYMPTOTIC = 1e-4
#: Largest number of points of a slope fit, with the smallest errors above the plateau: half a decade.
SLOPE_POINTS = 20
#: Terms of the Cornish-Fisher series, divided by z: coefficients of even powers of z, and a divisor.
_CORNISH_FISHER = (((1, 1), 4), ((3, 16, 5), 96), ((-15, 17, 19, 3), 384), ((-945, -1920, 1482, 776, 79), 92160))


def observed_order(tau: xr.DataArray, error: xr.DataArray, dimension: str = "tau_per_stage") -> xr.DataArray:
    """Return the slope of log(error) against log(tau) over the points of :func:`truncation`, along their ``dimension``.

    It is NaN with fewer than three points left.
    """
    import xarray as xr

    def slope(x: Any, y: Any) -> float:
        usable = truncation(x, y)
        return power_law(x[usable], y[usable])[0] if usable.size > 2 else np.nan

    fitted: xr.DataArray = xr.apply_ufunc(slope, tau, error, input_core_dims=[[dimension], [dimension]], vectorize=True)
    return fitted.assign_attrs(units="1", long_name="observed order: slope of the maximum energy error above round-off")


def truncation(tau: Floats, error: Floats) -> NDArray[np.intp]:
    """Return the indices of the smallest truncation errors, by increasing step size, over at most half a decade.

    They exclude all points up to the largest step size whose error is within a factor of 100 of the lowest error of the
    curve, and errors above 1e-4. The points (n,) are in any order.
    """
    finite = np.isfinite(error) & (error > 0) & np.isfinite(tau)
    if not finite.any():
        return np.zeros(0, dtype=np.intp)
    near_floor = finite & (error < PLATEAU * max(error[finite].min(), np.finfo(float).eps / 2))
    usable = np.flatnonzero(finite & (tau > tau[near_floor].max(initial=0.0)) & (error < ASYMPTOTIC))
    return usable[np.argsort(tau[usable], kind="stable")][:SLOPE_POINTS]


def power_law(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the slope of log(y) against log(x), as :func:`line_fit` does for x and y above 0, both (n,)."""
    abscissas = log(x)
    return line_fit(abscissas - mean(abscissas), log(y))


def unwrapped(t: Any, angle: Any) -> tuple[Floats, Floats, Bools]:
    """Return the points of :func:`line_fit` for rows of ``t`` and of an angle in rad: x, y, and where there are some.

    x is ``t`` less its mean and y the unwrapped angle, at points where both are finite, in front of zeros; a row of
    fewer than three such points has none. The residuals of an angle are periodic rather than independent, so over
    complete orbits the interval of its slope is too wide rather than too narrow.
    """
    finite = np.isfinite(angle) & np.isfinite(t)
    if (finite[..., 1:] > finite[..., :-1]).any():
        order = np.argsort(~finite, axis=-1, kind="stable")
        t, angle, finite = (np.take_along_axis(row, order, axis=-1) for row in (t, angle, finite))
    there = finite & (finite.sum(axis=-1, keepdims=True) > 2)
    x, y = (np.where(there, row, 0.0) for row in (t, angle))
    return _centred(x, there), np.where(there, np.unwrap(y), 0.0), there


def trend_linearity(x: Floats, y: Floats, there: Bools) -> tuple[Any, Any]:
    """Return R^2 of the fit of points of :func:`unwrapped`, and the slope of their second half over the first's.

    For an odd number of points, both halves contain the middle one. NaN with fewer than three points, or if a
    denominator is zero.
    """
    y, count, place = _centred(y, there), there.sum(axis=-1)[..., None], np.arange(x.shape[-1])
    with np.errstate(all="ignore"):
        spread, half = totals(y * y), (count + 1) // 2
        residual = np.where(there, y - (totals(x * y) / totals(x * x))[..., None] * x, 0.0)
        sides = (_centred(x, there & side) for side in (place < half, place >= count - half))
        first, second = (totals(one * y) / totals(one * one) for one in sides)
        determination = np.where(spread, 1 - totals(residual * residual) / spread, np.nan)
        return determination, np.where(first, second / first, np.nan)


def _centred(x: Floats, there: Bools) -> Floats:
    """``x`` less the mean of each row where there are points, and 0 elsewhere."""
    with np.errstate(invalid="ignore"):
        means = totals(np.where(there, x, 0.0)) / there.sum(axis=-1)
    return np.where(there, x - means[..., None], 0.0)


def line_fit(x: Floats, y: Floats, there: Any = True) -> tuple[Any, Any]:
    """Return the slopes of rows of ``y`` against ``x``, both (..., n), by least squares, and half the width of their
    95 % intervals; NaN with fewer than three points.

    The mean of x is 0. Points that are not ``there`` do not count; x and y are 0 at them. The interval assumes
    independent residuals.
    """
    there = np.broadcast_to(there, x.shape)
    freedom = np.maximum(there.sum(axis=-1) - 2, 0)
    with np.errstate(all="ignore"):
        spread = totals(x * x)
        slope = totals(x * y) / spread
        residual = np.where(there, _centred(y, there) - slope[..., None] * x, 0.0)
        deviation = np.sqrt(totals(residual * residual) / freedom / spread)
    student = np.vectorize({n: student_975(n) if n else np.nan for n in np.unique(freedom).tolist()}.get)(freedom)
    return np.where(freedom, slope, np.nan)[()], student * deviation


def mean(x: Floats) -> float:
    """Return the mean of an array: its exact sum, rounded, divided by its size."""
    return total(x) / x.size


def jackknife_interval(without: Floats) -> float:
    """Return half the width of the 95 % interval of an estimate from n samples, by the jackknife.

    ``without`` (n,) are the estimates from all samples but one, for each of the samples.
    """
    n = len(without)
    distance = without - mean(without)
    deviation = sqrt((n - 1) / n * dot(distance, distance))
    return student_975(n - 1) * deviation


def student_975(freedom: int) -> float:
    """Return the 97.5 % point of Student's t with ``freedom`` degrees of freedom.

    It is exact for 1 and 2 degrees of freedom, otherwise from the Cornish-Fisher series (Abramowitz & Stegun 26.7.5).
    The relative error is below 2e-3 from 3 degrees of freedom on, and falls with their fifth power.
    """
    if freedom == 1:
        return 12.706204736174694  # tan(0.475 pi)
    if freedom == 2:
        return 0.95 * sqrt(2 / (1 - 0.95 * 0.95))
    z = 1.959963984540054
    terms = [z * _polynomial(z * z, coefficients) / divisor for coefficients, divisor in _CORNISH_FISHER]
    return z + _polynomial(1 / freedom, [0.0, *terms])


def _polynomial(x: float, coefficients: Sequence[float]) -> float:
    return reduce(lambda total, c: c + total * x, reversed(coefficients))


# --- Quasi-random points that are bitwise identical on every machine for the same seed.
def quasi_random(count: int, dimension: int, seed: int) -> Floats:
    """Return points (count, dimension) of the additive recurrence x_n = x_0 + n alpha mod 1, in [0, 1).

    alpha_k = 1/phi^k, with phi the root of phi^(dimension + 1) = phi + 1. The points are computed exactly, in integers
    modulo 2^64. The seed determines x_0.

    Roberts (2018), "The unreasonable effectiveness of quasirandom sequences".
    """
    offset = np.array([_mixed(seed * dimension + k) for k in range(dimension)], dtype=np.uint64)
    index = np.arange(1, count + 1, dtype=np.uint64)[:, None]
    points = offset + index * np.array(_generators(dimension), dtype=np.uint64)  # wraps around, as intended
    return np.asarray((points >> np.uint64(11)).astype(np.float64) / 2.0**53)


@cache
def _generators(dimension: int) -> tuple[int, ...]:
    """alpha_k 2^64 rounded to odd integers, so that the full period is 2^64."""
    with localcontext(prec=40):
        phi = Decimal(2)
        for _ in range(120):  # each iteration gains at least half a digit
            phi = (1 + phi) ** (Decimal(1) / (dimension + 1))
        return tuple(int(2**64 / phi ** (k + 1)) | 1 for k in range(dimension))


def _mixed(number: int) -> int:
    """64 well-mixed bits of an integer: splitmix64 (Steele, Lea & Flood 2014, doi:10.1145/2660193.2660195)."""
    mask = 2**64 - 1
    z = (number + 1) * 0x9E3779B97F4A7C15 & mask
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & mask
    z = (z ^ z >> 27) * 0x94D049BB133111EB & mask
    return z ^ z >> 31
