"""A solver of another library, and one prepared run: common types of the files of all libraries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.systems.system import System

States = NDArray[np.float64]

#: Maximum number of steps, which ends a diverging run.
MOST_STEPS = 200_000


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One prepared run over [0, t_end].

    ``run``: timed call for one trajectory from start to end; it returns an object with the final state, without
    energies. ``path``: returns the states (n + 1, 2 d) at the solver's own steps, including the start, and the number
    of force evaluations (NaN if unknown). ``lanes``: timed call in SIMD lanes: ``members`` trajectories at once, each
    equal to that of ``run``; None if the Python interface of the library has no lanes. ``members``: number of
    trajectories in a call of ``lanes``.
    """

    run: Callable[[], Any]
    path: Callable[[], tuple[States, float]]
    lanes: Callable[[], Any] | None = None
    members: int = 1


@dataclass(frozen=True, kw_only=True)
class Peer:
    """One solver of another library.

    ``name``, ``label``: name in files and name in legends. ``module``: the library, as it is imported, or the name of a
    compiler. ``attempt(system, t_end, setting)`` prepares a run. It includes construction and compilation
    of a solver, which are not timed. ``settings``: tolerances from coarse to fine; empty for step sizes, which come
    from the common grid. ``stages``: force evaluations per step, which convert step sizes per stage to step sizes.
    ``quadratic_only``: True if the solver needs accelerations that depend only on the position, as for T = p.p/2.
    ``gravity_only``: True if the solver is only for V = -GM/|q|. ``regularised``: True if the solver integrates the
    regularised equations of a system and supports no other system; all other solvers integrate the original equations.
    """

    name: str
    label: str
    module: str
    attempt: Callable[[System, float, float], Attempt]
    settings: tuple[float, ...] = ()
    stages: int = 1
    quadratic_only: bool = False
    gravity_only: bool = False
    regularised: bool = False

    @property
    def adaptive(self) -> bool:
        """True if a setting is a tolerance, False if it is a step size."""
        return bool(self.settings)


def start_of(system: System) -> States:
    """Return the initial state (2 d) of ``system``."""
    return np.concatenate(system.start(float))


def gradients_of(system: System) -> tuple[Callable[[States], States], Callable[[States], States]]:
    """Return dT/dp and dV/dq as functions of arrays (d) in numpy."""
    formulas, constants = system.formulas(), system.constants(float)
    if system.unit_masses:
        return lambda p: p, lambda q: np.array(formulas.grad_V(q, *constants))
    return lambda p: np.array(formulas.grad_T(tuple(p), *constants)), lambda q: np.array(formulas.grad_V(q, *constants))
