"""Quasi-random points that are bitwise identical on every machine for the same seed."""

from __future__ import annotations

from decimal import Decimal, localcontext
from functools import cache

import numpy as np

from nearharmonic.numerics.types import Floats


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
