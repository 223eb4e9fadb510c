"""Number of SIMD lanes; it affects the speed, not the results."""

from __future__ import annotations

from dataclasses import replace

from nearharmonic.engine.settings import WIDTH, Numerics
from nearharmonic.integrators.composition import Composition
from nearharmonic.numerics.types import Integers
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.numba.potential import numba_potential

#: Registers of AVX-512, of which a state may fill half; the other half is for the force.
REGISTERS = 32
#: Time of a step with one, two and four registers of lanes, over that of a step of a single run. One run and one
#: register are bound by the same chain of operations; from two registers on the processor's throughput begins to count.
#: Measured on planar systems: ``python benchmarks/kernels.py``.
TIMES = {1: 1.0, WIDTH: 1.2, 2 * WIDTH: 2.0, 4 * WIDTH: 3.6}
#: Members of an ensemble that an implicit method solves together, beside its stages. One is bound by a chain of
#: operations; four took 0.75 to 0.9 of its time a member, eight 1.1 to 1.2, on a processor with AVX2.
MEMBERS = 4


def most_lanes_of(system: System, numerics: Numerics, step: Composition) -> int:
    """Return the SIMD lanes for many runs of ``system``: one where V is a function of numba."""
    if numba_potential(system) is not None:
        return 1
    if step.implicit:
        return 1 if numerics.precision == "extended" else MEMBERS
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


def lanes_for(steps: Integers, most: int) -> int:
    """Return the lanes with which runs of so many ``steps`` (R,) are done first.

    A queue of runs takes as long as its longest run, or as all steps shared by the lanes if that is more.
    """
    longest, total = int(steps.max()), int(steps.sum())
    return min((w for w in TIMES if w <= most), key=lambda w: max(longest, total / w) * TIMES[w])


def with_lanes(numerics: Numerics, steps: Integers, system: System, step: Composition) -> Numerics:
    """Return ``numerics`` with the lanes that runs of so many steps are done first with, unless it has its own."""
    if numerics.width is not None:
        return numerics
    most = most_lanes_of(system, numerics, step)
    return replace(numerics, width=most if step.implicit and steps.size >= most else lanes_for(steps, most))
