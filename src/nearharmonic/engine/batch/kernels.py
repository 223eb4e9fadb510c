"""Kernels of systems: description of a system for the compiler, and compiled code for one choice of arithmetic."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from nearharmonic.core.formulas.number import Constant
from nearharmonic.core.formulas.physics import Hamiltonian, Physics
from nearharmonic.engine.batch.numba_runs import check_precision
from nearharmonic.engine.settings import WIDTH, Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.collocation import stage_table
from nearharmonic.systems.definition.remembered import remembered
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.gradients import check_gradients
from nearharmonic.systems.formulas.kinetic_energy import quadratic_T
from nearharmonic.systems.formulas.modified_potential import square_gradient
from nearharmonic.systems.formulas.oscillator import frequencies_of, remainder_formulas
from nearharmonic.systems.numba.potential import numba_potential

if TYPE_CHECKING:
    from nearharmonic.core.loops.kernel import Kernel

#: Default numerics.
STANDARD = Numerics()


@remembered
def kernel_of(system: System, numerics: Numerics = STANDARD, *, modified: bool = False, stages: int = 0) -> Kernel:
    """Return the compiled kernel for ``system``, from the cache on disk if it is there.

    Parameters
    ----------
    system : System
        Its gradients are compared with its energies when it is first used in this process.
    numerics : Numerics
        The code depends on the settings that :attr:`Numerics.compiled` keeps. The default number of lanes is that of
        one register.
    modified : bool
        True if kicks are of a modified potential.
    stages : int
        Stages of a collocation method; 0 for a splitting method.

    Raises
    ------
    SystemDefinitionError
        A formula fails or uses what formulas cannot (a branch, a function of math), or a gradient contradicts its
        potential.
    SettingError
        Extended precision, or several SIMD lanes, for a V that is a function of numba.
    CompiledCodeError
        The machine code cannot be loaded.
    """
    from nearharmonic.core.loops.kernel import build

    check_precision(system, [numerics.precision])
    width = _width(system, numerics.width)
    return build(
        physics_of(system, numerics, modified=modified, stages=stages),
        extended=numerics.precision == "extended",
        compensated=numerics.compensated,
        width=width,
        energy=numerics.energy,
    )


def _width(system: System, width: int | None) -> int:
    """The SIMD lanes of a kernel: one for loops, and for a V that takes one position at a time."""
    if numba_potential(system) is None:
        return 1 if system.formulas().are_loops else width or WIDTH
    if width is not None and width > 1:
        needed = f"V of {system.name} is a function of numba, which takes one position at a time: 1, or None"
        raise bad_setting("width", width, needed)
    return 1


@remembered
def cost_of(system: System, numerics: Numerics, *, modified: bool = False, stages: int = 0) -> int:
    """Return the time of a force evaluation in units of at most a few nanoseconds."""
    from nearharmonic.core.loops.kernel import cost

    return cost(
        physics_of(system, numerics, modified=modified, stages=stages), extended=numerics.precision == "extended"
    )


@remembered
def formulas_digest(system: System) -> str:
    """Return a digest of the equations of motion: the instructions of the formulas, with parameters as values."""
    from nearharmonic.core.formulas.emission import fingerprint
    from nearharmonic.core.formulas.rules import Rules

    return fingerprint(Rules(physics_of(system), extended=True, compensated=True))


def physics_of(system: System, numerics: Numerics = STANDARD, *, modified: bool = False, stages: int = 0) -> Physics:
    """Return the description of ``system`` for the compiler; its gradients are compared with its energies first.

    Of ``numerics`` only ``split`` is used.

    Raises
    ------
    SystemDefinitionError
        A gradient contradicts its potential.
    SettingError
        The oscillators of the system are to be solved exactly, and cannot be.
    """
    check_gradients(system)
    exact = numerics.exact_oscillator
    formulas, at_run_time = remainder_formulas(system) if exact else system.formulas(), system.parameters_at_run_time
    loops, numba = None, numba_potential(system)
    if formulas.are_loops:
        V, T = formulas.energies
        loops = V.looped(at_run_time), T.looped(at_run_time)
    shared = {field.name: getattr(formulas, field.name) for field in fields(Hamiltonian)}
    if exact or not system.quadratic_kinetic_energy:
        shared["acceleration"] = None
    return Physics(
        **shared,
        parameters=len(system.parameters) if at_run_time else 0,
        constants=() if at_run_time else system.constants(Constant),
        measured=None if formulas.regularised is None else formulas.regularised.energies,
        loops=loops,
        unit_masses=system.T is quadratic_T and not system.time_dependent,
        turning=frequencies_of(system)[1] if exact else None,
        modified=square_gradient(system) if modified else None,
        stages=stage_table(stages) if stages else None,
        numba=None if numba is None else numba.code,
        timed=loops is not None and system.time_dependent,
    )
