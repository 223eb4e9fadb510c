"""heyoka's adaptive Taylor series (Biscani & Izzo 2021, doi:10.1093/mnras/stab1032), scalar and in batches of lanes.

The equations are the system's own formulas. For V = -GM/|q| there are also those that suit heyoka best, with
``GM * (x*x + y*y)**-1.5`` written as a power; its own ``model.fixed_centres`` is 4 to 9 % slower than the formulas, and
``hamiltonian()`` of the system's potential a quarter slower. ``high_accuracy`` stays off, which is the default.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from nearharmonic.reproduction.experiments.work_precision.peers.peer import MOST_STEPS, Attempt, Peer, States, start_of
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.source import velocity

TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
#: Doubles of a batch: a register of AVX-512.
BATCH = 8


def heyoka_taylor(
    system: System, t_end: float, tolerance: float, *, fast_math: bool = False, power: bool = False
) -> Attempt:
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
    power
        Whether the force is GM q (q.q)^(-3/2), written as a power, instead of the system's formula.
    """
    import heyoka as hy

    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    variables = hy.make_vars(*names)
    variables = list(variables) if isinstance(variables, list | tuple) else [variables]
    rates = _gravity(system, variables) if power else velocity(system, functions_of(hy))(*variables)
    return taylor_attempt(list(zip(variables, rates, strict=True)), start_of(system), t_end, tolerance, fast_math)


def taylor_attempt(equations: Sequence[Any], start: States, end: float, tolerance: float, fast_math: bool) -> Attempt:
    """Prepare one trajectory and a batch of equal ones.

    Parameters
    ----------
    equations
        Pairs of heyoka's variables and their derivatives.
    start : (n,) array of float
        The variables at 0.
    end
        End of the interval in what the equations are derivatives by.
    tolerance, fast_math
        As in :func:`heyoka_taylor`.
    """
    import heyoka as hy

    starts = np.repeat(start[:, None], BATCH, axis=1)
    solver = hy.taylor_adaptive(equations, list(start), tol=tolerance, fast_math=fast_math)
    batch = hy.taylor_adaptive_batch(equations, starts.copy(), tol=tolerance, fast_math=fast_math)

    def reset() -> None:
        solver.time = 0.0
        solver.state[:] = start

    def run() -> Any:
        reset()
        solver.propagate_until(end)
        return solver.state

    def path() -> tuple[States, float]:
        reset()
        states = [start]
        while solver.time < end and len(states) < MOST_STEPS and np.isfinite(states[-1]).all():
            solver.step(end - solver.time)
            states.append(solver.state.copy())
        return np.array(states), math.nan

    def lanes() -> Any:
        batch.set_time(0.0)
        batch.state[:] = starts
        batch.propagate_until(end)
        return batch.state

    return Attempt(run=run, path=path, lanes=lanes, members=BATCH)


def _gravity(system: System, variables: Sequence[Any]) -> list[Any]:
    """dq/dt and dp/dt for V = -GM/|q|."""
    q, p = variables[: system.dimension], variables[system.dimension :]
    (GM,) = system.constants(float)
    pull = GM * sum(x * x for x in q) ** -1.5
    return [*p, *(-pull * x for x in q)]


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


PEERS = tuple(
    Peer(
        name=name, label=label, module="heyoka", settings=TOLERANCES, attempt=partial(heyoka_taylor, **options),
        gravity_only=options.get("power", False),
    )
    for name, label, options in (
        ("heyoka", "heyoka (adaptive Taylor)", {}),
        ("heyoka_fast_math", "heyoka, fast_math", {"fast_math": True}),
        ("heyoka_power", "heyoka, force as a power", {"power": True}),
        ("heyoka_power_fast_math", "heyoka, power, fast_math", {"power": True, "fast_math": True}),
    )
)  # fmt: skip
