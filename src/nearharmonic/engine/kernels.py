"""Kernels of systems: description of a system for the compiler, and compiled code for one choice of arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from math import isfinite
from typing import TYPE_CHECKING

from nearharmonic.core.number import Constant
from nearharmonic.core.tracing import Hamiltonian, Physics, Rules
from nearharmonic.engine.settings import WIDTH, Numerics
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.collocation import stage_table
from nearharmonic.integrators.tableau import Composition
from nearharmonic.numerics.portable import Floats, Integers
from nearharmonic.systems.formulas import quadratic_T
from nearharmonic.systems.gradients import check_gradients, frequencies_of, remainder_formulas, square_gradient
from nearharmonic.systems.numba_potential import numba_potential, rounding_noise
from nearharmonic.systems.remembered import remembered
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.core.kernel import Kernel


# --- Runs of systems whose V is a function of numba: settings that they refuse, and the floor of their energy errors.

#: An energy error of at most so many times the floor is near it.
NEAR_FLOOR = 10.0
#: Members of an ensemble whose floors are measured, at most.
MEMBERS = 8


def check_precision(system: System, precisions: Sequence[str], key: str = "precision") -> None:
    """Raise an error about the setting ``key`` for extended precision with a V that is computed in doubles."""
    if "extended" in precisions and numba_potential(system) is not None:
        needed = f"V of {system.name} is a function of numba, which computes in double precision"
        raise bad_setting(key, "extended", needed)


def energy_floor(system: System, scale: float, start: Floats, parameters: Floats, H0: Floats) -> dict[str, float]:
    """Return the attribute ``energy_floor`` of results; none unless V is a function of numba.

    It is the rounding noise of V relative to what energy errors are relative to, of several runs the largest of the
    first :data:`MEMBERS`: for initial states ``start`` (R or 1, 4 d), ``parameters`` (R or 1, 2 P) and energies ``H0``
    (R,).
    """
    potential = numba_potential(system)
    if potential is None:
        return {}
    d, largest = system.dimension, 0.0
    for i, energy in enumerate(H0[:MEMBERS].tolist()):
        if not isfinite(energy):
            continue
        row, given = (rows[i if len(rows) > 1 else 0] for rows in (start, parameters))
        noise = rounding_noise(potential, row[:d].tolist(), given[::2].tolist(), energy)
        largest = max(largest, noise / (scale or abs(energy) or 1.0))
    return {"energy_floor": largest}


def floor_in_words(floor: float) -> str:
    """Return the sentence about energy errors near a floor."""
    return f"near {floor:.1e}, the rounding of V, which is computed in doubles: no method makes such an error smaller"


#: Default numerics.
STANDARD = Numerics()


@remembered
def kernel_of(system: System, numerics: Numerics = STANDARD, *, modified: bool = False, stages: int = 0) -> Kernel:
    """Return the compiled kernel for ``system``, from the cache on disk if it is there.

    The code depends on the settings that :attr:`Numerics.compiled` keeps; the default lanes fill one register.
    ``modified`` is True if kicks are of a modified potential. ``stages`` is the number of stages of a collocation
    method, 0 for a splitting method. A formula that fails or uses what formulas cannot, and a gradient that contradicts
    its potential, raise SystemDefinitionError; extended precision or several lanes for a V of numba SettingError.
    """
    from nearharmonic.core.kernel import build

    check_precision(system, [numerics.precision])
    width = 1 if system.formulas().are_loops else numerics.width or WIDTH
    if numba_potential(system) is not None:
        if numerics.width is not None and numerics.width > 1:
            needed = f"V of {system.name} is a function of numba, which takes one position at a time: 1, or None"
            raise bad_setting("width", numerics.width, needed)
        width = 1
    return build(
        physics_of(system, numerics, modified=modified, stages=stages),
        extended=numerics.precision == "extended",
        compensated=numerics.compensated,
        width=width,
        energy=numerics.energy,
    )


@remembered
def cost_of(system: System, numerics: Numerics, *, modified: bool = False, stages: int = 0) -> int:
    """Return the time of a force evaluation in units of at most a few nanoseconds."""
    from nearharmonic.core.kernel import cost

    return cost(
        physics_of(system, numerics, modified=modified, stages=stages), extended=numerics.precision == "extended"
    )


@remembered
def formulas_digest(system: System) -> str:
    """Return a digest of the equations of motion: the instructions of the formulas, with parameters as values."""
    from nearharmonic.core.emission import fingerprint

    return fingerprint(Rules(physics_of(system), extended=True, compensated=True))


def physics_of(system: System, numerics: Numerics = STANDARD, *, modified: bool = False, stages: int = 0) -> Physics:
    """Return the description of ``system`` for the compiler; its gradients are compared with its energies first.

    Of ``numerics`` only ``split`` is used; oscillators that cannot be solved exactly raise SettingError.
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


# --- Number of SIMD lanes; it affects the speed, not the results.

#: Registers of AVX-512, of which a state may fill half; the other half is for the force.
REGISTERS = 32
#: Time of a step with one, two and four registers of lanes, over the time of a step of a single run. One run and one
#: register are bound by the same chain of operations; from two registers on the processor's throughput begins to count.
#: Measured on planar systems: ``python benchmarks/kernels.py``.
TIMES = {1: 1.0, WIDTH: 1.2, 2 * WIDTH: 2.0, 4 * WIDTH: 3.6}
#: The same in extended precision, whose longer chains leave the processor more time for a second register.
EXTENDED_TIMES = {1: 1.0, WIDTH: 1.05, 2 * WIDTH: 1.5, 4 * WIDTH: 2.4}
#: Members of an ensemble that an implicit method solves together, beside its stages. One is bound by a chain of
#: operations; four took 0.75 to 0.9 of its time a member, eight 1.1 to 1.2, on a processor with AVX2.
MEMBERS_TOGETHER = 4


def most_lanes_of(system: System, numerics: Numerics, step: Composition | None = None) -> int:
    """Return the SIMD lanes for many runs of ``system``, by default explicit: one where V is a function of numba."""
    if numba_potential(system) is not None:
        return 1
    if step is not None and step.implicit:
        return 1 if numerics.precision == "extended" else MEMBERS_TOGETHER
    d = system.formulas().dimension
    return most_lanes(d, compensated=numerics.compensated, extended=numerics.precision == "extended")


def most_lanes(dimension: int, *, compensated: bool, extended: bool) -> int:
    """Return the SIMD lanes for many runs of so many coordinates: as many as leave half of the registers to the force.

    Doubles that a lane holds from step to step are 2 a coordinate, and as many carries unless the summation is plain.
    """
    held = dimension * (2 + 2 * compensated) * (2 if extended else 1)
    width = WIDTH
    while width < 4 * WIDTH and held * 2 * width // WIDTH <= REGISTERS // 2:
        width *= 2
    return width


def with_lanes(numerics: Numerics, steps: Integers, system: System, step: Composition) -> Numerics:
    """Return ``numerics`` with the lanes that runs of so many ``steps`` (R,) are done first with, or with its own.

    A queue of runs takes as long as its longest run, or as all steps shared by the lanes if that is more.
    """
    if numerics.width is not None:
        return numerics
    most, times = most_lanes_of(system, numerics, step), EXTENDED_TIMES if numerics.precision == "extended" else TIMES
    if step.implicit and steps.size >= most:
        return replace(numerics, width=most)
    longest, total, widths = int(steps.max()), int(steps.sum()), [w for w in times if w <= most]
    return replace(numerics, width=min(widths, key=lambda w: max(longest, total / w) * times[w]))
