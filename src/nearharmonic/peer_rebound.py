"""Runs of rebound's integrators: gravity in its own C for Kepler, any other force as a Python callback.

IAS15 is that of Rein & Spiegel (2015), doi:10.1093/mnras/stu2164. WHFast is left out: for two bodies it moves along the
ellipse in closed form and integrates nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.formulas import velocity
from nearharmonic.peer_solvers import Attempt, States, start_of
from nearharmonic.systems.system import System

#: A bound on the seconds of a path: IAS15's steps can shrink to nothing where a force passes through 0.
PATH_SECONDS = 2.0
#: First step of an adaptive run, in parts of the interval.
FIRST_STEP = 1e-4


def rebound_ias15(system: System, t_end: float, tolerance: float) -> Attempt:
    """IAS15 with ``tolerance`` as its epsilon."""
    return _Setup(system, t_end, "ias15", {"epsilon": tolerance}, steps=0).attempt()


def rebound_leapfrog8(system: System, t_end: float, step: float) -> Attempt:
    """The leapfrog composed to order 8."""
    return _Setup(system, t_end, "leapfrog", {"order": 8}, steps=max(1, round(t_end / step))).attempt()


@dataclass(frozen=True)
class _Setup:
    """What a simulation is made of; ``steps`` of equal length, or 0 if the integrator chooses them."""

    system: System
    t_end: float
    integrator: str
    options: Mapping[str, Any]
    steps: int

    @property
    def gravity(self) -> bool:
        return self.system.name == "kepler" and set(self.system.parameters) == {"GM"}

    @property
    def keys(self) -> tuple[str, ...]:
        d = self.system.dimension
        return ("x", "y", "z")[:d] + ("vx", "vy", "vz")[:d]

    def attempt(self) -> Attempt:
        return Attempt(run=self.run, path=self.path)

    def simulation(self, seen: Callable[[], None] | None = None) -> tuple[Any, Any]:
        """A simulation at the start and its moving body; ``seen`` is called at each evaluation of the force."""
        import rebound

        made = rebound.Simulation()
        particle = dict(zip(self.keys, start_of(self.system), strict=True))
        if self.gravity:
            made.G = float(Fraction(self.system.parameters["GM"].value))
            made.add(m=1.0)
            made.add(m=0.0, **particle)
        else:
            made.gravity = "none"
            made.add(m=1.0, **particle)
        made.integrator = self.integrator
        for key, value in self.options.items():
            setattr(made.integrator, key, value)
        made.dt = self.t_end / self.steps if self.steps else self.t_end * FIRST_STEP
        body = made.particles[-1]
        calls = [call for call in (None if self.gravity else self._push(body), seen) if call is not None]
        if len(calls) == 1:
            made.additional_forces = lambda _: calls[0]()
        elif calls:
            made.additional_forces = lambda _: [call() for call in calls]
        return made, body

    def _push(self, body: Any) -> Callable[[], None]:
        """A function that sets the acceleration of ``body`` from its position."""
        function, d = velocity(self.system), self.system.dimension
        accelerations = ("ax", "ay", "az")[:d]

        def push() -> None:
            rates = function(*(getattr(body, key) for key in self.keys))
            for key, component in zip(accelerations, rates[d:], strict=True):
                setattr(body, key, component)

        return push

    def run(self) -> Any:
        simulation, _ = self.simulation()
        if self.steps:
            simulation.steps(self.steps)
        else:
            simulation.integrate(self.t_end)
        return simulation

    def path(self) -> tuple[States, float]:
        count = [0]

        def seen() -> None:
            count[0] += 1

        simulation, body = self.simulation(seen)
        states = [start_of(self.system)]
        deadline = time.perf_counter() + PATH_SECONDS
        while len(states) <= self.steps if self.steps else simulation.t < self.t_end:
            if self.steps or simulation.t + simulation.dt < self.t_end:
                simulation.steps(1)
            else:
                simulation.integrate(self.t_end)
            states.append(np.array([getattr(body, key) for key in self.keys]))
            if not np.isfinite(states[-1]).all():
                break
            if time.perf_counter() > deadline:
                message = f"{self.integrator} is not at the end after {PATH_SECONDS} s"
                raise TimeoutError(message)
        return np.array(states), count[0]
