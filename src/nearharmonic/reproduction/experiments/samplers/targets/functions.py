"""Exponential and logarithm of compiled gradients: unlike those of libm, their bits are equal on every processor."""

from __future__ import annotations

from math import factorial, frexp, ldexp

import numpy as np

from nearharmonic.numerics.compiled import compiled

#: ln 2 in two parts; a multiple below 2^20 of the first is exact.
_LN2 = (0.6931471803691238, 1.9082149292705877e-10)
_POWERS = np.array([ldexp(1.0, k) for k in range(-1023, 1024)])
_F = np.array([1 / factorial(k) for k in range(14)])


@compiled
def exponential(x):  # type: ignore[no-untyped-def]
    """Return exp(x) to about 1 ulp, 0 or infinity beyond 700."""
    if not -700.0 <= x <= 700.0:  # or no number
        return 0.0 if x < 0.0 else np.inf
    whole = np.floor(x * 1.4426950408889634 + 0.5)
    r = (x - whole * _LN2[0]) - whole * _LN2[1]
    total = _F[13]
    for k in range(12, -1, -1):
        total = _F[k] + r * total
    return total * _POWERS[int(whole) + 1023]


@compiled
def logarithm(x):  # type: ignore[no-untyped-def]
    """Return log(x) of a positive number to about 1 ulp, by the series of artanh; infinite without one."""
    if not 0.0 < x < np.inf:
        return np.inf
    m, e = frexp(x)
    if m < 0.7071067811865476:
        m, e = 2.0 * m, e - 1
    y = (m - 1.0) / (m + 1.0)
    square, total = y * y, 0.0
    for k in range(21, 0, -2):
        total = 1.0 / k + square * total
    return (e * _LN2[1] + 2.0 * y * total) + e * _LN2[0]
