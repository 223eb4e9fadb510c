"""scipy's integrators: DOP853 of Hairer, Norsett & Wanner (1993), and LSODA of Petzold (1983), doi:10.1137/0904010."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from nearharmonic.systems.gradients import velocity
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import MOST_STEPS, Attempt, Peer, States, start_of

#: Number of outputs of LSODA's path; it does not return its steps.
ODEINT_OUTPUTS = 1001
#: Smallest tolerance of scipy: 2.3e-14.
SCIPY_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 3e-14)


def scipy_dop853(system: System, t_end: float, tolerance: float) -> Attempt:
    """``scipy.integrate.solve_ivp(method="DOP853")`` with the right-hand side compiled by numba."""
    from scipy.integrate import solve_ivp

    rhs, start = _compiled_rhs(system, "t, y"), start_of(system)

    def run() -> Any:
        return solve_ivp(rhs, (0.0, t_end), start, method="DOP853", rtol=tolerance, atol=tolerance)

    def path() -> tuple[States, float]:
        solution = run()
        states = solution.y.T.copy()
        if not solution.success:
            states[-1] = math.nan
        return states, solution.nfev

    return Attempt(run=run, path=path)


def scipy_odeint(system: System, t_end: float, tolerance: float) -> Attempt:
    """``scipy.integrate.odeint`` with the right-hand side compiled by numba."""
    from scipy.integrate import odeint

    rhs, start = _compiled_rhs(system, "y, t"), start_of(system)

    def solve(times: States, **more: Any) -> Any:
        return odeint(rhs, start, times, rtol=tolerance, atol=tolerance, mxstep=MOST_STEPS, **more)

    def path() -> tuple[States, float]:
        states, told = solve(np.linspace(0.0, t_end, ODEINT_OUTPUTS), full_output=True)
        if "successful" not in told["message"]:
            states[-1] = math.nan
        return states, float(solve(np.array([0.0, t_end]), full_output=True)[1]["nfe"][-1])

    return Attempt(run=lambda: solve(np.array([0.0, t_end])), path=path)


@cache
def _compiled_rhs(system: System, arguments: str) -> Callable[..., States]:
    """Return dy/dt as a function of the state y and the time t, in the order of ``arguments``, compiled by numba."""
    import numba

    unpacked = ", ".join(f"y[{i}]" for i in range(2 * system.dimension))
    space: dict[str, Any] = {"inner": numba.njit(velocity(system)), "array": np.array}
    exec(f"def rhs({arguments}):\n    return array(inner({unpacked}))\n", space)
    rhs: Callable[..., States] = numba.njit(space["rhs"])
    rhs(y=start_of(system), t=0.0)
    return rhs


PEERS = tuple(
    Peer(name=name, label=label, module="scipy", settings=SCIPY_TOLERANCES, attempt=attempt)
    for name, label, attempt in (
        ("scipy_dop853", "scipy solve_ivp (DOP853, numba)", scipy_dop853),
        ("scipy_odeint", "scipy odeint (LSODA, numba)", scipy_odeint),
    )
)
