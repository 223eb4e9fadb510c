"""Decorator of the compiled loops of experiments, and random numbers, exponential and logarithm for them.

Unlike those of libm, the bits of the functions are equal on every processor.
"""

from __future__ import annotations

from math import factorial, frexp
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types as numba_types
from numba.extending import intrinsic

from nearharmonic.core.machine.reals import jit_compiled as compiled
from nearharmonic.math import cos, log
from nearharmonic.numerics.portable import Floats

__all__ = ["Normal", "compiled", "exponential", "logarithm", "types"]

#: ln 2 in two parts; a multiple below 2^20 of the first is exact. With the second number a sum is rounded to a whole
#: number, whose bits are the last of the sum.
_LN2, _ROUND = (0.6931471803691238, 1.9082149292705877e-10), 1.5 * 2.0**52
_F = tuple(1 / factorial(k) for k in range(14))
types: Any = numba_types
_WORD = ir.IntType(64)


@intrinsic
def _power_of_two(typing, rounded):  # type: ignore[no-untyped-def]
    """Return 2^k for k + _ROUND, from its last bits."""

    def codegen(context, builder, signature, values):  # type: ignore[no-untyped-def]
        exponent = builder.add(builder.bitcast(values[0], _WORD), _WORD(1023))
        return builder.bitcast(builder.shl(exponent, _WORD(52)), ir.DoubleType())

    return types.float64(types.float64), codegen


@compiled
def exponential(x):  # type: ignore[no-untyped-def]
    """Return exp(x) to about 1 ulp, 0 or infinity beyond 700.

    There is no branch, so that a loop over an array has several values in a vector.
    """
    inside = x if x < 700.0 else 700.0
    inside = inside if inside > -700.0 else -700.0
    rounded = inside * 1.4426950408889634 + _ROUND
    whole = rounded - _ROUND
    r = (inside - whole * _LN2[0]) - whole * _LN2[1]
    square = r * r
    total = _F[12] + r * _F[13]  # pairs of terms, which a processor sums side by side
    total = _F[10] + r * _F[11] + square * total
    total = _F[8] + r * _F[9] + square * total
    total = _F[6] + r * _F[7] + square * total
    total = _F[4] + r * _F[5] + square * total
    total = _F[2] + r * _F[3] + square * total
    found = (1.0 + (r + square * total)) * _power_of_two(rounded)
    return 0.0 if x < -700.0 else (found if x <= 700.0 else np.inf)


@compiled
def logarithm(x):  # type: ignore[no-untyped-def]
    """Return log(x) of a positive number to about 1 ulp, by the series of artanh; infinite for any other."""
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


class Normal:
    """Normally distributed numbers with equal bits on every processor: the method of Box and Muller (1958)."""

    def __init__(self, seed: list[int]) -> None:
        self.uniform = np.random.default_rng(seed)

    def rows(self, count: int, n: int) -> Floats:
        """Return ``count`` rows of n numbers of variance 1."""
        u, v = (self.uniform.random((count, n)) for _ in range(2))
        found: Floats = np.sqrt(-2.0 * log(1.0 - u)) * cos(2 * np.pi * v)
        return found
