"""Statistics of runs: slopes above the round-off plateau, trends, Student's t, the jackknife; quasi-random points."""

from __future__ import annotations

from decimal import Decimal, localcontext
from functools import cache
from math import sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, dot, total

if TYPE_CHECKING:
    import xarray as xr


# --- Statistics of runs: slopes above the round-off plateau, trends and their intervals, Student's t, the jackknife.
#
# All results may be written to result files, so they are computed by :mod:`nearharmonic.numerics.portable`.

#: Points of a curve below this multiple of its lowest point may be round-off errors rather than truncation errors.
PLATEAU = 100.0
#: Above this relative error the leading term does not determine the slope.
ASYMPTOTIC = 1e-4
#: Largest number of points of a slope fit, with the smallest errors above the plateau: half a decade.
SLOPE_POINTS = 20
#: Terms of the Cornish-Fisher series, divided by z: coefficients of even powers of z, and a divisor.
_CORNISH_FISHER = (
    ((1, 1), 4),
    ((3, 16, 5), 96),
    ((-15, 17, 19, 3), 384),
    ((-945, -1920, 1482, 776, 79), 92160),
)


def observed_order(tau: xr.DataArray, error: xr.DataArray, dimension: str = "tau_per_stage") -> xr.DataArray:
    """Return the slope of log(error) against log(tau) over the points of :func:`truncation`, along their ``dimension``.

    It is NaN with fewer than three points left.
    """
    import xarray as xr

    def slope(x: Any, y: Any) -> float:
        usable = truncation(x, y)
        if usable.size < 3:
            return float("nan")
        return power_law(x[usable], y[usable])[0]

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


def linear_trend(t: Any, angle: Any) -> tuple[float, float]:
    """Return the slope of an unwrapped angle (n,) in rad against ``t`` (n,), and half the width of its 95 % interval.

    Points that are not finite are excluded; both are NaN with fewer than three points. The residuals are periodic
    rather than independent, so over complete orbits the interval is too wide rather than too narrow.
    """
    x, y = _unwrapped(t, angle)
    if x.size < 3:
        return float("nan"), float("nan")
    return line_fit(x - mean(x), y)


def trend_linearity(t: Any, angle: Any) -> tuple[float, float]:
    """Return R^2 of the fit of :func:`linear_trend`, and the slope of the second half of the points over the first's.

    For an odd number of points, both halves contain the middle one. NaN with fewer than three points, or if a
    denominator is zero.
    """
    x, y = _unwrapped(t, angle)
    if x.size < 3:
        return float("nan"), float("nan")
    x, y = x - mean(x), y - mean(y)
    spread, half = dot(y, y), (x.size + 1) // 2
    residual = y - line_slope(x, y) * x
    first, second = (line_slope(x[part] - mean(x[part]), y[part]) for part in (slice(half), slice(-half, None)))
    return (
        1 - dot(residual, residual) / spread if spread else float("nan"),
        second / first if first else float("nan"),
    )


def _unwrapped(t: Any, angle: Any) -> tuple[Floats, Floats]:
    """``t`` and the unwrapped ``angle`` at the points where both are finite."""
    finite = np.isfinite(angle) & np.isfinite(t)
    return t[finite], np.unwrap(angle[finite])


def line_slope(x: Floats, y: Floats) -> float:
    """Return the slope of :func:`line_fit` alone, for abscissas ``x`` (n,) of mean 0 and ordinates ``y`` (n,)."""
    return dot(x, y) / dot(x, x)


def line_fit(x: Floats, y: Floats) -> tuple[float, float]:
    """Return the slope of ``y`` against ``x``, both (n,), by least squares, and half the width of its 95 % interval.

    The mean of x is 0, and n > 2. The interval assumes independent residuals.
    """
    spread = dot(x, x)
    slope = dot(x, y) / spread
    residual = y - mean(y) - slope * x
    deviation = sqrt(dot(residual, residual) / (x.size - 2) / spread)
    return slope, student_975(x.size - 2) * deviation


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
    z, n = 1.959963984540054, float(freedom)
    square = z * z
    terms = [z * polyval(square, coefficients) / divisor for coefficients, divisor in _CORNISH_FISHER]
    return z + float(polyval(1 / n, [0.0, *terms]))


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
