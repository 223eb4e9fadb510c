"""rebound's integrators: its own gravity in C for V = -GM/|q|, other forces as C functions compiled by numba.

IAS15 is that of Rein & Spiegel (2015), doi:10.1093/mnras/stu2164. WHFast is omitted: for two bodies it uses the closed
form of the ellipse. A force in Python instead of C would dominate the time: the leapfrog of order 8 would take about a
hundred times as long.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from ctypes import addressof, c_double
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from nearharmonic.systems.gradients import velocity
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Attempt, Peer, States, start_of

#: Time limit of a path in seconds: the steps of IAS15 can become extremely small if a force passes through 0.
PATH_SECONDS = 2.0
#: First step of an adaptive run, as a fraction of the interval.
FIRST_STEP = 1e-4


def rebound_ias15(system: System, t_end: float, tolerance: float) -> Attempt:
    """IAS15 with ``tolerance`` as its epsilon."""
    return _Setup(system, t_end, "ias15", {"epsilon": tolerance}, steps=0).attempt()


def rebound_leapfrog8(system: System, t_end: float, step: float) -> Attempt:
    """The leapfrog composed to order 8."""
    return _Setup(system, t_end, "leapfrog", {"order": 8}, steps=max(1, round(t_end / step))).attempt()


@dataclass(frozen=True)
class _Setup:
    """Parts of a simulation; ``steps`` of equal length, or 0 if the integrator chooses them."""

    system: System
    t_end: float
    integrator: str
    options: Mapping[str, Any]
    steps: int

    def attempt(self) -> Attempt:
        simulation, body = self.simulation(c_double())
        start = dict(zip(_keys(self.system), map(float, start_of(self.system)), strict=True))

        def run() -> Any:
            self.begin(simulation)
            for key, value in start.items():
                setattr(body, key, value)
            if self.steps:
                simulation.steps(self.steps)
            else:
                simulation.integrate(self.t_end)
            return body

        return Attempt(run=run, path=self.path)

    def simulation(self, count: c_double) -> tuple[Any, Any]:
        """Return a simulation at the start and its moving body; ``count`` counts evaluations of a compiled force."""
        import rebound

        made = rebound.Simulation()
        particle = dict(zip(_keys(self.system), start_of(self.system), strict=True))
        if self.system.gravity:
            (made.G,) = self.system.constants(float)
            made.add(m=1.0)
            made.add(m=0.0, **particle)
        else:
            made.gravity = "none"
            made.add(m=1.0, **particle)
            made.additional_forces = compiled_force(self.system).address
        made.extras, made._extras_ref = addressof(count), count  # the reference keeps the double alive
        self.begin(made)
        return made, made.particles[-1]

    def begin(self, simulation: Any) -> None:
        """Set time, first step and integrator; this resets the integrator's state of an earlier run."""
        simulation.integrator = self.integrator
        for key, value in self.options.items():
            setattr(simulation.integrator, key, value)
        simulation.t = 0.0
        simulation.dt = self.t_end / self.steps if self.steps else self.t_end * FIRST_STEP

    def path(self) -> tuple[States, float]:
        count = c_double()
        simulation, body = self.simulation(count)
        if self.system.gravity:  # rebound does not count evaluations; an additional force that only counts does this
            simulation.additional_forces = compiled_force(None).address
        states = [start_of(self.system)]
        deadline = time.perf_counter() + PATH_SECONDS
        while len(states) <= self.steps if self.steps else simulation.t < self.t_end:
            if self.steps or simulation.t + simulation.dt < self.t_end:
                simulation.steps(1)
            else:
                simulation.integrate(self.t_end)
            states.append(np.array([getattr(body, key) for key in _keys(self.system)]))
            if not np.isfinite(states[-1]).all():
                break
            if time.perf_counter() > deadline:
                raise TimeoutError(f"{self.integrator} is not at the end after {PATH_SECONDS} s")
        return np.array(states), count.value


def _keys(system: System) -> tuple[str, ...]:
    """Return rebound's names of the components of a state (2 d)."""
    d = system.dimension
    return ("x", "y", "z")[:d] + ("vx", "vy", "vz")[:d]


@cache
def compiled_force(system: System | None) -> Any:
    """Compile a C function of a ``reb_simulation`` with numba that sets the acceleration of its first particle.

    It adds 1 to the double that ``extras`` of the simulation points to; if ``system`` is None, it does only that. It
    reads simulation and particle as arrays of eight-byte words, at the offsets of rebound's own ctypes definitions.
    """
    import numba
    import rebound

    def word(structure: Any, name: str) -> int:
        return int(getattr(structure, name).offset) // 8

    space: dict[str, Any] = {}
    body = [f"simulation[{word(rebound.Simulation, 'extras')}][0] += 1.0"]
    if system is not None:
        space["velocity"] = numba.njit(velocity(system), error_model="numpy")
        state = [f"particle[{word(rebound.Particle, key)}]" for key in _keys(system)]
        body += [f"particle = simulation[{word(rebound.Simulation, '_particles')}]"]
        body += [f"rates = velocity({', '.join(state)})"]
        accelerations = ("ax", "ay", "az")[: system.dimension]
        body += [
            f"particle[{word(rebound.Particle, key)}] = rates[{i}]"
            for i, key in enumerate(accelerations, start=system.dimension)
        ]
    exec("def force(simulation):\n" + "".join(f"    {line}\n" for line in body), space)
    doubles = numba.types.CPointer(numba.types.float64)
    return numba.cfunc(numba.types.void(numba.types.CPointer(doubles)), error_model="numpy")(space["force"])


PEERS = (
    Peer(
        name="rebound_ias15", label="rebound IAS15", module="rebound", attempt=rebound_ias15, quadratic_only=True,
        settings=(1e-2, 1e-4, 1e-6, 1e-9),  # the last is its default
    ),
    Peer(
        name="rebound_leapfrog8", label="rebound leapfrog, order 8", module="rebound", attempt=rebound_leapfrog8,
        quadratic_only=True, stages=17,
    ),
)  # fmt: skip
