"""Methods as integrators of REBOUND 5, chosen by name as REBOUND's own are.

REBOUND computes the forces. Compiled code drifts and kicks particles in the memory of the simulation: a particle of
REBOUND begins with nine doubles, of position, velocity and acceleration.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import rebound
from llvmlite import ir
from numba import carray, cfunc, types
from numba.extending import intrinsic
from rebound.integrator import Integrator, IntegratorConfiguration

from nearharmonic.errors import MissingPackageError
from nearharmonic.exchange.method import Method, VelocityCheck, identifier, method_for
from nearharmonic.integrators.tableau import Tableau

_C = rebound.clibrebound
_Function = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
_Predicate = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p)
_update_acceleration = _Function(("reb_simulation_update_acceleration", _C))

#: Size of a simulation in bytes, and of a particle in doubles.
SIZE, PARTICLE = ctypes.sizeof(rebound.Simulation), ctypes.sizeof(rebound.Particle) // 8
#: Places of members of a simulation: in units of 8 bytes, and in units of 4 bytes.
T, DT, DT_LAST_DONE, N, N_VAR, PARTICLES, STEPS, ADDITIONAL = (
    getattr(rebound.Simulation, member).offset // 8
    for member in ("t", "dt", "dt_last_done", "N", "N_var", "_particles", "steps_done", "_additional_forces")
)
VELOCITY_DEPENDENT, GRAVITY, GRAVITY_IGNORE, STATUS = (
    getattr(rebound.Simulation, member).offset // 4
    for member in ("force_is_velocity_dependent", "_gravity", "gravity_ignore", "_status")
)
#: Number of the gravity routine in Jacobi coordinates, which leaves out terms of the force.
JACOBI = rebound.simulation.GRAVITIES["jacobi"]
#: REBOUND's status of a simulation after an error, and in the last step of ``integrate``.
GENERIC_ERROR, LAST_STEP = 1, -2

#: Registered methods by name. REBOUND keeps the address of each function, which must live as long as the process.
_REGISTERED: dict[str, tuple[Tableau, Any]] = {}
#: Comparisons of additional forces by the address of the simulation.
_CHECKS: dict[int, VelocityCheck] = {}


@intrinsic
def _pointer(typing_context, address):  # type: ignore[no-untyped-def]
    """Return an address as a pointer, which numba cannot do by itself."""

    def generated(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(address), generated


@_Function  # type: ignore[untyped-decorator]
def _refuse(address: int) -> None:
    """Stop a simulation that splitting methods cannot integrate, with REBOUND's own error and the reason."""
    simulation = rebound.Simulation.from_address(address)
    if simulation.N_var:
        reason = "variational particles need tangent maps, which the methods of nearharmonic do not have here"
    elif simulation.gravity != "jacobi":
        reason = "forces depend on velocities, but a splitting method needs forces of positions and time alone"
    else:
        reason = "gravity = 'jacobi' leaves out forces; set gravity = 'basic'"
    _C.reb_simulation_error(ctypes.byref(simulation), reason.encode())
    simulation._status = GENERIC_ERROR


@_Predicate  # type: ignore[untyped-decorator]
def _depends_on_velocities(address: int) -> bool:
    """Return True if forces of a simulation at several velocities are found to differ; the velocities stay."""
    simulation = rebound.Simulation.from_address(address)
    n, taken, check = simulation.N, simulation.steps_done, _CHECKS.get(address)
    if check is None or taken < check.step:  # another simulation in the memory of an earlier one
        check = _CHECKS[address] = VelocityCheck()
    if not check.due(taken, last=simulation._status == LAST_STEP):
        return False

    def columns(first: int) -> Any:
        doubles = ctypes.POINTER(ctypes.c_double).from_address(address + 8 * PARTICLES)
        return np.ctypeslib.as_array(doubles, (n, PARTICLE))[:, first : first + 3]

    def force(velocities: Any) -> Any:
        columns(3)[:] = velocities
        _update_acceleration(address)
        return columns(6).copy()

    velocities = columns(3).copy()
    try:
        return check.finds(force, velocities, taken)
    finally:
        columns(3)[:] = velocities


def register(method: str | Tableau) -> str:
    """Register a method with REBOUND, and return the name under which ``simulation.integrator`` takes it.

    q are positions and v velocities: the kinetic energy is quadratic, as some methods require, with the masses of
    the particles. ``simulation.dt`` is the step, in the simulation's unit of time. ``simulation.integrate`` reaches its
    end by a shorter last step; with ``exact_finish_time=0`` all steps are equal.

    A kick evaluates REBOUND's gravity and ``additional_forces``, at the time of the positions. A step of a method with
    drifts first costs ``stages`` forces, and of a method with kicks first ``stages + 1``. Users, collisions and
    boundaries may change particles between two steps, and REBOUND does not tell an integrator of all changes. Forces
    are therefore not kept from one step to the next, and a changed state never meets a stale force.

    Test particles (``N_active``), collisions and boundaries work: REBOUND handles them in the forces and between two
    steps. Variational particles need tangent maps, and forces that depend on velocities have no potential. Both are
    refused by ``simulation.steps`` and ``simulation.integrate``, with RuntimeError: REBOUND's flag
    ``force_is_velocity_dependent`` decides, and without it forces at several velocities, which are compared if there
    are ``additional_forces``. This costs four forces before the first step, two before steps 2, 3, 5, 9, 17, ..., and
    two before the last step of ``integrate`` unless a comparison was near. The energy is not compared: a step that is
    too large for a close encounter raises no error.

    The step is compiled, which takes about a second for each method. It then costs what its forces cost.

    Parameters
    ----------
    method : str or Tableau
        Name of a registered integrator, path of a file, or a tableau. It runs in its own role.

    Returns
    -------
    str
        The name, such as "nearharmonic_babs7o7h". A method has one name; another tableau with the name of a registered
        one gets a name of its own.

    Raises
    ------
    SettingError
        The method has modified potentials or a processor.
    UnknownNameError
        There is no such integrator; the message has the nearest names.
    MissingPackageError
        REBOUND is older than version 5.

    References
    ----------
    ``reb_integrator_register`` of REBOUND, https://rebound.readthedocs.io/en/latest/integrators

    Examples
    --------
    >>> import rebound, nearharmonic as nh
    >>> simulation = rebound.Simulation()
    >>> simulation.add(m=1.0); simulation.add(m=1e-3, a=1.0, e=0.2)
    >>> simulation.integrator, simulation.dt = nh.adapters.rebound.register("aba864"), 0.1
    >>> energy = simulation.energy(); simulation.integrate(100.0); print(f"{simulation.energy() / energy - 1:.1e}")
    -1.7e-08
    """
    splitting = method_for("REBOUND", method)
    stem = name = f"nearharmonic_{identifier(splitting.tableau)}"
    number = 1
    while name in _REGISTERED:
        if _REGISTERED[name][0] == splitting.tableau:
            return name
        number += 1
        name = f"{stem}_{number}"
    step = _compiled(splitting)
    _add(Integrator(step=step.address), name)
    _REGISTERED[name] = splitting.tableau, step
    return name


def _compiled(method: Method) -> Any:
    """Return the step of a method as machine code that REBOUND can call."""
    kicks, coefficients = map(np.array, zip(*((m.flow == "kick", m.coefficient) for m in method.flows), strict=True))

    @cfunc(types.void(types.voidptr, types.voidptr))
    def step(simulation, state):  # type: ignore[no-untyped-def]
        doubles, sizes, integers = (
            carray(simulation, SIZE // 8, np.float64),
            carray(simulation, SIZE // 8, np.uint64),
            carray(simulation, SIZE // 4, np.int32),
        )
        integers[GRAVITY_IGNORE] = 0  # an integrator used before may have left out terms of the force
        taken = sizes[STEPS]
        due = sizes[ADDITIONAL] and (taken & (taken - 1) == 0 or integers[STATUS] == LAST_STEP)
        refused = sizes[N_VAR] or integers[VELOCITY_DEPENDENT] or integers[GRAVITY] == JACOBI
        if refused or (due and _depends_on_velocities(simulation)):
            _refuse(simulation)
            return
        start, dt, drifted, n = doubles[T], doubles[DT], 0.0, np.int64(sizes[N])
        for move in range(kicks.size):
            length = coefficients[move] * dt
            if kicks[move]:
                _update_acceleration(simulation)
            # The force may have been computed in Python, which may have added particles.
            particles = carray(_pointer(sizes[PARTICLES]), (n, PARTICLE), np.float64)
            first, other = (3, 6) if kicks[move] else (0, 3)
            for i in range(n):
                for k in range(3):
                    particles[i, first + k] += length * particles[i, other + k]
            if not kicks[move]:
                drifted += coefficients[move]
                doubles[T] = start + drifted * dt
        doubles[T] = start + dt  # without the rounding of the sum of coefficients
        doubles[DT_LAST_DONE] = dt

    return step


def _add(integrator: Integrator, name: str) -> None:
    """Add an entry to REBOUND's table of integrators.

    REBOUND 5.2 does not return from the registration of a second integrator: it compares the new name with the name
    of the entry behind the last. Each is therefore registered in an empty table, and the tables are joined.
    """
    try:
        pointer = ctypes.POINTER(IntegratorConfiguration).in_dll(_C, "reb_integrator_configurations_custom")
    except ValueError as error:
        raise MissingPackageError("nh.adapters.rebound", "rebound >= 5", "rebound") from error
    address = ctypes.c_void_p.from_address(ctypes.addressof(pointer))
    earlier, count = address.value, 0
    while earlier and pointer[count].name:
        count += 1
    address.value = None
    _C.reb_integrator_register.argtypes = [Integrator, ctypes.c_char_p]
    _C.reb_integrator_register.restype = None
    _C.reb_integrator_register(integrator, name.encode())
    if not earlier:
        return
    size = ctypes.sizeof(IntegratorConfiguration)
    libc = ctypes.CDLL(None)
    libc.realloc.argtypes, libc.realloc.restype = [ctypes.c_void_p, ctypes.c_size_t], ctypes.c_void_p
    libc.free.argtypes, libc.free.restype = [ctypes.c_void_p], None
    added, joined = address.value, libc.realloc(earlier, (count + 2) * size)
    ctypes.memmove(joined + count * size, ctypes.c_void_p(added), 2 * size)
    libc.free(added)
    address.value = joined
