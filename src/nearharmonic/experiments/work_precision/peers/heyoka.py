"""heyoka's adaptive Taylor series (Biscani & Izzo 2021, doi:10.1093/mnras/stab1032), scalar and in batches of lanes.

The equations are the system's own formulas. On Kepler, ``GM * (x*x + y*y)**-1.5`` written with a power is 6 to 11 %
faster, heyoka's own ``model.fixed_centres`` 4 to 9 % slower, and ``hamiltonian()`` of the system's potential a quarter
slower. ``high_accuracy`` stays off, which is the default.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

from nearharmonic.experiments.work_precision.curve import MODES
from nearharmonic.experiments.work_precision.peers.peer import MOST_STEPS, Attempt, Peer, States, start_of
from nearharmonic.systems.source import velocity
from nearharmonic.systems.system import System

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)


def heyoka_taylor(system: System, t_end: float, tolerance: float, *, fast_math: bool = False) -> Attempt:
    """Prepare ``heyoka.taylor_adaptive``, whose order follows from the tolerance, and ``taylor_adaptive_batch``.

    Parameters
    ----------
    system
        The equations of motion and the initial state.
    t_end
        End of the interval, in the system's unit of time.
    tolerance
        Relative and absolute tolerance of each step.
    fast_math
        Whether heyoka may reorder floating-point operations.
    """
    import heyoka as hy

    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    variables = hy.make_vars(*names)
    variables = list(variables) if isinstance(variables, list | tuple) else [variables]
    rates = velocity(system, functions_of(hy))(*variables)
    equations = list(zip(variables, rates, strict=True))
    start = start_of(system)
    starts = np.repeat(start[:, None], MODES["lanes"], axis=1)
    solver = hy.taylor_adaptive(equations, list(start), tol=tolerance, fast_math=fast_math)
    batch = hy.taylor_adaptive_batch(equations, starts.copy(), tol=tolerance, fast_math=fast_math)

    def reset() -> None:
        solver.time = 0.0
        solver.state[:] = start

    def run() -> Any:
        reset()
        return solver.propagate_until(t_end)

    def path() -> tuple[States, float]:
        reset()
        states = [start]
        while solver.time < t_end and len(states) < MOST_STEPS and np.isfinite(states[-1]).all():
            solver.step(t_end - solver.time)
            states.append(solver.state.copy())
        return np.array(states), math.nan

    def lanes() -> Any:
        batch.set_time(0.0)
        batch.state[:] = starts
        batch.propagate_until(t_end)
        return batch.state

    return Attempt(run=run, path=path, lanes=lanes)


def functions_of(hy: Any) -> dict[str, Any]:
    """The functions of formulas in heyoka's expressions; those that it lacks, in terms of roots and powers."""
    own = ("sqrt", "sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "erf")
    derived = {
        "abs": lambda x: hy.sqrt(x * x),
        "pow": lambda x, y: (x if isinstance(x, hy.expression) else hy.expression(x)) ** y,
        "cbrt": lambda x: x * (x * x) ** (-1 / 3),
        "hypot": lambda x, y: hy.sqrt(x * x + y * y),
    }
    return {name: getattr(hy, name) for name in own} | derived


PEERS = (
    Peer(
        name="heyoka",
        label="heyoka (adaptive Taylor)",
        module="heyoka",
        knob="tolerance",
        settings=TOLERANCES,
        attempt=heyoka_taylor,
    ),
    Peer(
        name="heyoka_fast_math",
        label="heyoka, fast_math",
        module="heyoka",
        knob="tolerance",
        settings=TOLERANCES,
        attempt=partial(heyoka_taylor, fast_math=True),
    ),
)
