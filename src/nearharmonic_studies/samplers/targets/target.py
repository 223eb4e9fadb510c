"""A target exp(-U) of Hamiltonian Monte Carlo with unit masses: gradient, observables and starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from nearharmonic.numerics.compiled import Normal
from nearharmonic.numerics.portable import Floats


@dataclass(frozen=True, kw_only=True)
class Target:
    """A target.

    ``name``, ``label``: name, and name in figures. ``dimension``: number of coordinates, n. ``highest``: a frequency
    near the highest one, in whose unit step sizes are given. ``lengths``: times of a trajectory, from which each method
    takes its best. ``gradient(q, out)``: numba function that writes dU/dq (n,) into ``out`` and returns
    U. ``observe(q, potential, out)``: numba function that writes the observables of a state.
    ``observables``: names of the observables. ``start(normal)``: a state (n,); one from the target itself if
    ``warm`` is 0. ``warm``: proposals from a start to the first that counts.
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
