"""An integrator for REBOUND, in Python, registered under a name like REBOUND's example custom_integrator in C.

A particle of REBOUND begins with nine doubles: position, velocity and acceleration. numpy therefore drifts and kicks
all particles at once in the memory of the simulation.
"""

from __future__ import annotations

from string import Template

from nearharmonic.exchange.method import Coefficients, head, names, remarks_of_python

VELOCITIES = (
    "REBOUND: q are positions and p velocities, T is quadratic, and a kick is v += c dt a with REBOUND's forces."
)
OWN_FORCE = (
    "A step evaluates the forces {count} times: REBOUND may change particles between two steps, so that the forces at "
    "the end of a step are not reused."
)
DOUBLES = "REBOUND computes in double precision: digits beyond 17 have no effect."

PROGRAM = Template("""\
$head
# REBOUND 5 or newer. Run: python $name.py

import ctypes

import numpy as np
import rebound
from rebound.integrator import Integrator

KICK = (
$kick
)
DRIFT = (
$drift
)

_C = rebound.clibrebound
_STEP = ctypes.CFUNCTYPE(None, ctypes.POINTER(rebound.Simulation), ctypes.c_void_p)


def positions_velocities_accelerations(simulation):
    \"\"\"Return arrays (N, 3) that share the memory of the particles of a simulation.\"\"\"
    doubles = ctypes.cast(simulation._particles, ctypes.POINTER(ctypes.c_double))
    table = np.ctypeslib.as_array(doubles, (simulation.N, ctypes.sizeof(rebound.Particle) // 8))
    return table[:, 0:3], table[:, 3:6], table[:, 6:9]


def step(pointer, state):
    \"\"\"Take one step of length dt.\"\"\"
    simulation = pointer.contents
    dt = simulation.dt
    q, v, a = positions_velocities_accelerations(simulation)

    def kick(c):
        _C.reb_simulation_update_acceleration(pointer)
        v[:] += c * dt * a

    def drift(c):
        q[:] += c * dt * v
        simulation.t += c * dt  # forces that depend on time are evaluated at the time of the positions

    $outer($OUTER[0])
    for i in range(len($INNER)):
        $inner($INNER[i])
        $outer($OUTER[i + 1])
    simulation.dt_last_done = dt


_step = _STEP(step)  # REBOUND keeps the address of this object, which must live as long
_C.reb_integrator_register.argtypes = [Integrator, ctypes.c_char_p]
_C.reb_integrator_register.restype = None
_C.reb_integrator_register(Integrator(step=ctypes.cast(_step, ctypes.c_void_p)), b"nearharmonic_$name")


# Example, to be replaced: the Henon-Heiles system, V = (x^2 + y^2)/2 + x^2 y - y^3/3, as a force on one particle.
def henon_heiles(pointer):
    particle = pointer.contents.particles[0]
    x, y = particle.x, particle.y
    particle.ax -= x + 2 * x * y
    particle.ay -= y + x * x - y * y


if __name__ == "__main__":
    simulation = rebound.Simulation()
    simulation.add(m=1.0, x=0.3, y=0.0, vx=0.0, vy=0.4)
    simulation.additional_forces = henon_heiles
    simulation.integrator = "nearharmonic_$name"
    simulation.dt = 0.25
    simulation.steps(80)
    particle = simulation.particles[0]
    print("q =", particle.x, particle.y)
    print("p =", particle.vx, particle.vy)
""")


def write(coefficients: Coefficients) -> str:
    """Return the program, which registers the integrator when it is run or imported."""
    remarks = [VELOCITIES, *remarks_of_python(coefficients, OWN_FORCE, DOUBLES)]
    return PROGRAM.substitute(head=head(coefficients, "#", *remarks), **names(coefficients))
