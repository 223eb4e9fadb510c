"""Numerical functions whose results are bitwise identical on every processor, and types of arrays."""

from __future__ import annotations

from decimal import Decimal, localcontext
from itertools import combinations
from math import frexp, fsum, isfinite, isqrt, ldexp, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.core.layout import Floats
from nearharmonic.math import log

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


__all__ = ["Bools", "Floats", "Integers"]

# --- Types of arrays.

Integers = NDArray[np.int64]
Bools = NDArray[np.bool_]


# --- Numerical functions for result files, whose results are bitwise identical on every processor.
#
# numpy, BLAS, LAPACK and the C library select their code by the processor, so the rounding of their logarithms, sines,
# powers and matrix products differs between processors. Here elementary functions are those of
# :mod:`nearharmonic.math`,
# sums are exact and rounded once, and all other operations are ``+ - * /`` and ``sqrt`` in a fixed order.

#: Largest number of sweeps of rotations, each of which squares the off-diagonal elements, and their final relative
#: size.
SWEEPS, LEFT = 30, 2.0**-60


def total(terms: Any) -> float:
    """Return the exact sum of the elements of an array, rounded once; infinite or NaN if an element is."""
    values = np.asarray(terms, dtype=float)
    with np.errstate(invalid="ignore"):
        return fsum(values.ravel().tolist()) if np.isfinite(values).all() else float(values.sum())


def dot(one: Any, other: Any) -> float:
    """Return the exact sum of the rounded products of elements, rounded once."""
    return total(np.asarray(one) * np.asarray(other))


def log10(x: Any) -> Any:
    """Return the logarithm to base 10 of a float or of an array, to about 1 ulp."""
    return log(x) / log(10.0)


def nearest_power_of_two(x: float) -> float:
    """Return the power of two whose logarithm is nearest to that of x > 0; x itself if it is not finite."""
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
