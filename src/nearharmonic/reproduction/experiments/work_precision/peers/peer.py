"""A solver of another library, and one prepared run of it: what the file of each library is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.systems.definition.system import System

States = NDArray[np.float64]

#: A bound on steps that ends a run which has gone astray.
MOST_STEPS = 200_000


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One prepared run over [0, t_end].

    Attributes
    ----------
    run
        What is timed: the whole call for one trajectory from start to end, which returns an object that holds the final
        state. The energy is not looked at.
    path
        Returns the states (n + 1, 2 d) at the solver's own steps, the start included, and the evaluations of the
        force (NaN if the library does not tell).
    lanes
        What is timed in SIMD lanes: ``members`` trajectories at once, each equal to that of ``run``; None if the
        library offers a Python user no lanes.
    members
        Trajectories of a call of ``lanes``.
    """

    run: Callable[[], Any]
    path: Callable[[], tuple[States, float]]
    lanes: Callable[[], Any] | None = None
    members: int = 1


@dataclass(frozen=True, kw_only=True)
class Peer:
    """One solver of another library.

    Attributes
    ----------
    name, label
        Name in files and name in legends.
    module
        The library, as it is imported, or the name of a compiler.
    attempt
        ``attempt(system, t_end, setting)`` prepares a run. Building a solver, compiling included, is part of this and
        not timed.
    settings
        Tolerances from coarse to fine; empty for step sizes, which come from the common grid.
    stages
        Evaluations of the force a step, which turn step sizes per stage into step sizes.
    quadratic_only
        Whether the solver takes accelerations as functions of position alone, which T = p.p/2 allows.
    gravity_only
        Whether the solver is written for V = -GM/|q| alone.
    regularised
        Whether the solver integrates the regularised equations of a system that has them, and fits no other; all
        other solvers integrate the original ones.
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
    """Return dT/dp and dV/dq of arrays (d), as one would write them with numpy."""
    formulas, constants = system.formulas(), system.constants(float)
    if system.unit_masses:
        return lambda p: p, lambda q: np.array(formulas.grad_V(q, *constants))
    return lambda p: np.array(formulas.grad_T(tuple(p), *constants)), lambda q: np.array(formulas.grad_V(q, *constants))
