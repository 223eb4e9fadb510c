"""diffrax's Dopri8 (Kidger 2022, arXiv:2202.02435) with adaptive steps, in double precision on the processor.

The equations are the formulas of the system. JAX compiles the whole integration, without gradients.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from nearharmonic.systems.gradients import velocity
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Attempt, Peer, States, start_of

#: Maximum number of steps of a path.
LONGEST_PATH = 2**15


def diffrax_dopri8(system: System, t_end: float, tolerance: float) -> Attempt:
    """``diffrax.diffeqsolve`` with ``Dopri8`` and a ``PIDController``, under ``jax.jit``."""
    import diffrax
    import jax

    last, every = _compiled_solver(system)
    start = start_of(system)

    def run() -> States:
        with jax.enable_x64(True):
            return np.asarray(last(start, t_end, tolerance))

    def path() -> tuple[States, float]:
        with jax.enable_x64(True):
            found = every(start, t_end, tolerance)
            steps, attempted = (int(found.stats[f"num_{which}steps"]) for which in ("accepted_", ""))
            states = np.concatenate([start[None], np.asarray(found.ys)[:steps]])
            reached = bool(found.result == diffrax.RESULTS.successful)
        if not reached:
            states[-1] = np.nan
        return states, float(STAGES * attempted)

    for call in (run, path):
        call()  # the first call for a system compiles
    return Attempt(run=run, path=path)


@cache
def _compiled_solver(system: System) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Functions of the initial state, the end and the tolerance: the final state, and a solution with every step."""
    import diffrax
    import jax

    names = ("sqrt", "sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "hypot", "cbrt", "pow")
    functions = {name: getattr(jax.numpy, name) for name in names} | {"erf": jax.scipy.special.erf}
    rates = velocity(system, functions)

    def vector_field(t: Any, y: Any, args: Any) -> Any:
        return jax.numpy.stack(rates(*y))

    def solve(y0: Any, t_end: Any, tolerance: Any, save: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(vector_field), diffrax.Dopri8(), 0.0, t_end, None, y0, saveat=save, max_steps=LONGEST_PATH,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance), throw=False,
        )  # fmt: skip

    return (
        jax.jit(lambda y0, t_end, tolerance: solve(y0, t_end, tolerance, diffrax.SaveAt(t1=True)).ys[-1]),
        jax.jit(lambda y0, t_end, tolerance: solve(y0, t_end, tolerance, diffrax.SaveAt(steps=True))),
    )


#: Evaluations per step; the first is the last of the previous step.
STAGES = 13

PEERS = (
    Peer(
        name="diffrax_dopri8", label="diffrax Dopri8 (JAX, compiled)", module="diffrax", attempt=diffrax_dopri8,
        settings=(1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13),
    ),
)  # fmt: skip
