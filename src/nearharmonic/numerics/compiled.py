"""Decorator of the compiled loops of experiments, and normally distributed numbers for them."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from nearharmonic.math import cos, log
from nearharmonic.numerics.types import Floats

#: A run that diverges has infinite energies: a division by zero is no error.
compiled: Any = numba.njit(error_model="numpy")


class Normal:
    """Normally distributed numbers with equal bits on every processor: the method of Box and Muller (1958)."""

    def __init__(self, seed: list[int]) -> None:
        self.uniform = np.random.default_rng(seed)

    def rows(self, count: int, n: int) -> Floats:
        """Return ``count`` rows of n numbers of variance 1."""
        u, v = (self.uniform.random((count, n)) for _ in range(2))
        found: Floats = np.sqrt(-2.0 * log(1.0 - u)) * cos(2 * np.pi * v)
        return found
