"""A target exp(-U) of Hamiltonian Monte Carlo with unit masses: gradient, observables and starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from nearharmonic.math import cos, log
from nearharmonic.numerics.types import Floats

#: A trajectory that diverges has an infinite energy: a division by zero is no error.
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


@dataclass(frozen=True, kw_only=True)
class Target:
    """A target.

    Attributes
    ----------
    name, label : str
        Name, and name in figures.
    dimension : int
        Number of coordinates, n.
    highest : float
        A frequency near the highest one, in whose unit step sizes are given.
    lengths : tuple of float
        Times of a trajectory, from which each method takes its best.
    gradient : callable
        ``gradient(q, out)``: numba function that writes dU/dq (n,) into ``out`` and returns U.
    observe : callable
        ``observe(q, potential, out)``: numba function that writes the observables of a state.
    observables : tuple of str
        Names of the observables.
    start : callable
        ``start(normal)``: a state (n,); one from the target itself if ``warm`` is 0.
    warm : int
        Proposals from a start to the first that counts.
    """

    name: str
    label: str
    dimension: int
    highest: float
    lengths: tuple[float, ...]
    gradient: Any
    observe: Any
    observables: tuple[str, ...]
    start: Callable[[Normal], Floats]
    warm: int = 0
