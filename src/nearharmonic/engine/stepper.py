"""A step as a function of numba, for programs that compose steps themselves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from nearharmonic.core.layout import ADVANCE, STEP
from nearharmonic.engine.kernels import kernel_of, physics_of
from nearharmonic.engine.numbers import moves, parameters_at_run_time
from nearharmonic.engine.settings import KINETIC_POTENTIAL
from nearharmonic.engine.setup import Setup, start_of
from nearharmonic.errors import bad_setting
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System

if TYPE_CHECKING:
    from nearharmonic.core.stepper import Step


def stepper(
    system: str | System,
    integrator: str | Tableau,
    *,
    summation: str = "plain",
    parameters: Mapping[str, Any] | None = None,
    first: str | None = None,
    precision: str = "double",
    split: str = KINETIC_POTENTIAL,
) -> Any:
    """Return a function of numba that advances a state by one step.

    Parameters
    ----------
    system, integrator
        As for :func:`nearharmonic.integrate`.
    summation : {"plain", "compensated"}
        Summation of the steps.
    parameters : mapping, optional
        Values of parameters by name in place of the system's own, as for :func:`nearharmonic.integrate`.
    first
        As for :func:`nearharmonic.integrate`.
    precision, split
        "double" and "kinetic_potential": a step has no others.

    Returns
    -------
    callable
        ``step(q, p, tau)``, or ``step(q, p, carry_q, carry_p, tau)`` for compensated sums, compiled by numba and to be
        called from functions of numba, in threads if wanted, or from Python. The C-contiguous float64 arrays (d,) are
        changed in place; those of a system that depends on time end with the time and its momentum. ``tau`` is a
        finite number of either sign and means its binary value. A call has the bits of a run of one step of
        :func:`nearharmonic.integrate`. Arrays of another length raise ValueError, and from Python other arguments
        SettingError.

    Raises
    ------
    NearharmonicError
        An unknown name, or a setting outside what is allowed.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> import numpy as np
    >>> q, p = np.array([1.0]), np.array([0.0])
    >>> nh.stepper("sho", "leapfrog")(q, p, 0.5)
    >>> print(q, p)
    [0.875] [-0.46875]
    """
    from nearharmonic.core import stepper as compiled

    problem = Setup(
        system, integrator, summation=summation, first=first, precision=precision, split=split, energy="none"
    )
    check_single_step(problem)
    return compiled.stepper(step_of(problem, parameters))


def step_of(problem: Setup, parameters: Mapping[str, Any] | None = None) -> Step:
    """Return the machine code and the coefficients of a step of ``problem``."""
    from nearharmonic.core.kernel import build_step, room
    from nearharmonic.core.stepper import Step

    system, tableau = problem.system, problem.tableau
    numerics = replace(problem.numerics, width=1)
    given = parameters_at_run_time(system, numerics, start_of(problem, parameters=parameters).parameters)
    table, flags, power = coefficients_of(tableau)
    physics = physics_of(system, **tableau.kernel_options)
    in_memory = physics.loops is not None or tableau.implicit
    if in_memory:
        function = kernel_of(system, numerics.compiled, **tableau.kernel_options).advance
    else:
        function = build_step(physics, compensated=numerics.compensated)
    return Step(
        name=system.name,
        address=function.address,
        signature=ADVANCE if in_memory else STEP,
        dimension=physics.dimension,
        room=room(physics, extended=False),
        stages=physics.stage_count,
        compensated=numerics.compensated,
        kick_first=tableau.first_same_as_last,
        table=table,
        flags=flags,
        power=power,
        parameters=given[0].copy(),
    )


def coefficients_of(tableau: Tableau) -> tuple[Floats, Floats, int]:
    """Return table, flags and power of the moves: see :func:`nearharmonic.core.stepper.fill`."""
    from nearharmonic.core.stepper import table_of

    rows, flags, power = tableau.moves(), np.zeros(tableau.moves_per_step + 2), 2
    if tableau.modified:
        power, flags = 3, np.ascontiguousarray(moves(tableau, [Fraction(1)], 1)[0, :, -1])
    else:
        rows = [(k, e, k * e) for k, e, _ in rows]
    return table_of(rows, (1, 1, power)), flags, power


def check_single_step(problem: Setup) -> None:
    """Raise an error for settings that a single step does not have."""
    system, tableau, numerics = problem.system, problem.tableau, problem.numerics
    if numerics.parts > 1:
        raise bad_setting("precision", numerics.precision, "the arrays of a step are doubles")
    if numerics.exact_oscillator:
        raise bad_setting("split", numerics.split, "the sines of a step size are computed before a run, in decimals")
    if system.regularisation is not None:
        raise bad_setting("system", system.name, "it is regularised, and its steps are those of a fictitious time")
    if tableau.processed:
        what = "it is processed: each step by itself would begin and end with its processor"
        raise bad_setting("integrator", tableau.name, what)
