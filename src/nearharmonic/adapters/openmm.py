"""OpenMM: a method as a ``CustomIntegrator``, at constant energy or as a Langevin thermostat."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from numbers import Integral
from typing import Any

import openmm
from openmm import unit

from nearharmonic.errors import SettingError, bad_setting
from nearharmonic.exchange.method import Move, method_for
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.written import is_real

__all__ = ["integrator"]

#: Largest seed of OpenMM, a 32-bit integer; its 0 stands for a new seed in each context.
LARGEST_SEED = 2**31 - 1


def integrator(
    method: str | Tableau, step: Any, *, temperature: Any = None, friction: Any = None, seed: int | None = None,
    system: openmm.System | None = None,
) -> openmm.CustomIntegrator:  # fmt: skip
    """Return an integrator of OpenMM that runs a splitting method.

    A step has as many forces as the method has stages: OpenMM keeps the force of the last kick for the first kick of
    the next step, as long as no position, parameter or box changes. The method sets the roles, kick first or
    drift first. The kinetic energy of OpenMM is quadratic, so Nystrom methods keep their order.

    With ``temperature`` and ``friction`` the integrator samples the canonical distribution by Langevin dynamics. The
    velocities follow an exact Ornstein-Uhlenbeck flow over half a step before the method and over half a step after it.
    Both flows leave the canonical distribution as it is, so the error of averages has the order of the method. In a
    method of one stage the flow over the whole step is in the middle of the step instead: ``"verlet"`` is BAOAB [2]_,
    whose positions are exact for oscillators. Other methods have no bath in their middle: half of a step has order 1,
    which would leave an error of averages of order 2.

    Constraints are kept: each drift is a step of RATTLE [3]_, symplectic and reversible, of order 2. The method then
    has order 2 on rigid molecules. A barostat or another force that changes the state acts at the beginning of a step,
    as in OpenMM's own integrators, and the force is then evaluated again. Particles of zero mass do not move.

    Virtual sites are not possible. A ``CustomIntegrator`` on the platforms Reference and CPU moves them at the end of a
    step only, so that kicks inside of the step have forces of a former position and the error has order 1. OpenMM tells
    an integrator nothing about its system: ``system`` lets this function refuse. Forces must not depend on velocities,
    which nothing checks.

    Parameters
    ----------
    method : str or Tableau
        Name of an integrator, path of a file, or a tableau, of plain kicks and drifts.
    step : float or Quantity
        Size of a whole step, above 0, in ps if it has no unit. The time of a force is ``step / stages``.
    temperature : float or Quantity, optional
        Temperature of the heat bath, at least 0, in K if it has no unit. By default the energy is constant.
    friction : float or Quantity, optional
        Friction of the heat bath, at least 0, in 1/ps if it has no unit; given with ``temperature``.
    seed : int, optional
        Seed of the random numbers of the heat bath, from 1 to 2147483647. By default OpenMM chooses one.
    system : openmm.System, optional
        System of the run. It is not changed; one with virtual sites raises an error.

    Returns
    -------
    openmm.CustomIntegrator
        Integrator for a ``Context`` or a ``Simulation``. Its global variables ``kT`` in kJ/mol and ``friction`` in 1/ps
        may be changed during a run, as may the step size.

    Raises
    ------
    NearharmonicError
        An unknown method, one with modified potentials or a processor, or a value outside what is allowed.

    References
    ----------
    .. [1] OpenMM, C++ and Python API reference, class ``CustomIntegrator``.
    .. [2] Leimkuhler & Matthews (2013), Appl. Math. Res. Express 2013, 34, doi:10.1093/amrx/abs010.
    .. [3] Andersen (1983), J. Comput. Phys. 52, 24, doi:10.1016/0021-9991(83)90014-1.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> integrator = nh.adapters.openmm.integrator("babs7o7h", 0.014)
    >>> integrator.getStepSize()
    Quantity(value=0.014, unit=picosecond)
    """
    chosen = method_for("OpenMM", method)
    size = _number("step", step, unit.picosecond, "a time above 0, in ps if it has no unit", positive=True)
    bath = _bath(temperature, friction, seed)
    _check_sites(system)
    made = openmm.CustomIntegrator(size)
    made.addPerDofVariable("unconstrained", 0)
    parts: list[Sequence[Move]] = [chosen.moves]
    if bath is not None:
        time, parts = "dt/2", [[], chosen.moves, []]  # the moves between the flows of the heat bath
        if chosen.stages == 1:
            first, middle, last = chosen.moves
            half = Move(middle.flow, middle.coefficient / 2)
            time, parts = "dt", [[first, half], [half, last]]
        # OpenMM computes global variables in double precision on every platform.
        kelvin, rate = bath
        energy = (kelvin * unit.kelvin * unit.MOLAR_GAS_CONSTANT_R) / unit.kilojoule_per_mole
        for name, value in (("kT", energy), ("friction", rate), ("kept", 1), ("noise", 0)):
            made.addGlobalVariable(name, value)
        made.addComputeGlobal("kept", f"exp(-friction*({time}))")
        made.addComputeGlobal("noise", "sqrt(1 - kept*kept)")
    made.addUpdateContextState()
    for i, moves in enumerate(parts):
        if i > 0:
            made.addComputePerDof("v", "kept*v + noise*sqrt(kT/m)*gaussian")
            made.addConstrainVelocities()
        _add(made, moves)
    made.addConstrainVelocities()  # alone at the end: a drift removes the same part of a velocity
    if seed is not None:
        made.setRandomNumberSeed(int(seed))
    return made


def _add(made: openmm.CustomIntegrator, moves: Sequence[Move]) -> None:
    for move in moves:
        if move.coefficient == 0:  # a step of no length would divide by zero below
            continue
        length = f"({move.coefficient!r}*dt)"
        if move.flow == "kick":
            made.addComputePerDof("v", f"v + {length}*f/m")
            continue
        made.addComputePerDof("x", f"x + {length}*v")
        made.addComputePerDof("unconstrained", "x")
        made.addConstrainPositions()
        made.addComputePerDof("v", f"v + (x - unconstrained)/{length}")  # adds an exact 0 where nothing is rigid


def _bath(temperature: Any, friction: Any, seed: Any) -> tuple[float, float] | None:
    """Return temperature and friction of the heat bath as numbers, or None without one."""
    if (temperature is None) != (friction is None):
        raise bad_setting("friction", friction, "both temperature and friction, or neither")
    if temperature is None:
        if seed is not None:
            raise bad_setting("seed", seed, "None without temperature and friction, as there are no random numbers")
        return None
    if seed is not None and not (is_real(seed) and isinstance(seed, Integral) and 0 < int(seed) <= LARGEST_SEED):
        raise bad_setting("seed", seed, f"an integer from 1 to {LARGEST_SEED}")
    kelvin = _number("temperature", temperature, unit.kelvin, "a temperature of at least 0, in K if it has no unit")
    rate = _number("friction", friction, unit.picosecond**-1, "a rate of at least 0, in 1/ps if it has no unit")
    return kelvin, rate


def _check_sites(system: Any) -> None:
    if system is None:
        return
    if not isinstance(system, openmm.System):
        raise bad_setting("system", system, "an openmm.System or None")
    sites = [i for i in range(system.getNumParticles()) if system.isVirtualSite(i)]
    if sites:
        raise SettingError(
            f"particle {sites[0]} is a virtual site: OpenMM moves virtual sites only at the end of a step of a "
            f"CustomIntegrator, so kicks inside of the step would have forces of a former position"
        )


def _number(key: str, given: Any, standard: Any, allowed: str, *, positive: bool = False) -> float:
    """Return a number or a quantity as a finite float of at least 0, or above 0, in the ``standard`` unit."""
    value = given
    if unit.is_quantity(given):
        if not given.unit.is_compatible(standard):
            raise bad_setting(key, given, allowed)
        value = given.value_in_unit(standard)
    if not is_real(value) or not isfinite(value) or value < 0 or (positive and value == 0):
        raise bad_setting(key, given, allowed)
    return float(value)
