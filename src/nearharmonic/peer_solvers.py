"""Runs of other libraries' solvers: each function loads its library and prepares one run over [0, t_end].

References are the libraries' own papers: Hairer, Norsett & Wanner (1993) for DOP853; Petzold (1983),
doi:10.1137/0904010, for LSODA; Biscani & Izzo (2021), doi:10.1093/mnras/stab1032, for heyoka; Blanes & Moan (2002),
doi:10.1016/S0377-0427(01)00492-7, for BM6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nearharmonic.formulas import velocity
from nearharmonic.systems.system import System

States = NDArray[np.float64]

#: Outputs at which LSODA's path is seen; it does not give its steps.
ODEINT_OUTPUTS = 1001
#: A bound on steps that ends a run which has gone astray.
MOST_STEPS = 200_000


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One prepared run: ``run()`` is what is timed; ``path()`` gives the states (n + 1, 2 d) at the solver's steps,
    the start included, and the evaluations of the force (NaN if the library does not tell)."""

    run: Callable[[], Any]
    path: Callable[[], tuple[States, float]]


def start_of(system: System) -> States:
    return np.array([float(x) for x in (*system.q0, *system.p0)])


def scipy_dop853(system: System, t_end: float, tolerance: float) -> Attempt:
    """``scipy.integrate.solve_ivp(method="DOP853")`` with the right-hand side in Python."""
    from scipy.integrate import solve_ivp

    function, start = velocity(system), start_of(system)

    def rhs(t: float, y: States) -> Any:
        return function(*y)

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

    rhs, start = _compiled_rhs(system), start_of(system)

    def solve(times: States, **more: Any) -> Any:
        return odeint(rhs, start, times, rtol=tolerance, atol=tolerance, mxstep=MOST_STEPS, **more)

    def path() -> tuple[States, float]:
        states, told = solve(np.linspace(0.0, t_end, ODEINT_OUTPUTS), full_output=True)
        if "successful" not in told["message"]:
            states[-1] = math.nan
        return states, float(solve(np.array([0.0, t_end]), full_output=True)[1]["nfe"][-1])

    return Attempt(run=lambda: solve(np.array([0.0, t_end])), path=path)


@cache
def _compiled_rhs(system: System) -> Callable[[States, float], States]:
    """dy/dt of the state y, compiled by numba."""
    import numba

    unpacked = ", ".join(f"y[{i}]" for i in range(2 * system.dimension))
    space: dict[str, Any] = {"inner": numba.njit(velocity(system)), "array": np.array}
    exec(f"def rhs(y, t):\n    return array(inner({unpacked}))\n", space)
    rhs: Callable[[States, float], States] = numba.njit(space["rhs"])
    rhs(start_of(system), 0.0)
    return rhs


def heyoka_taylor(system: System, t_end: float, tolerance: float) -> Attempt:
    """``heyoka.taylor_adaptive``: Taylor series whose order follows from the tolerance."""
    import heyoka as hy

    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    variables = hy.make_vars(*names)
    variables = list(variables) if isinstance(variables, list | tuple) else [variables]
    rates = velocity(system, {"sqrt": hy.sqrt})(*variables)
    start = start_of(system)
    solver = hy.taylor_adaptive(list(zip(variables, rates, strict=True)), list(start), tol=tolerance)

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

    return Attempt(run=run, path=path)


def pyhamsys_bm6(system: System, t_end: float, step: float) -> Attempt:
    """pyhamsys's sixth-order Blanes-Moan composition, the two flows in numpy."""
    from pyhamsys import HamSys, Parameters

    start = start_of(system)
    grad_T, grad_V = _gradients(system)
    count = [0]

    def chi(h: float, t: float, y: States) -> States:
        q, p = np.split(y, 2)
        count[0] += 1
        p = p - h * grad_V(q)
        return np.concatenate((q + h * grad_T(p), p))

    def chi_star(h: float, t: float, y: States) -> States:
        q, p = np.split(y, 2)
        count[0] += 1
        q = q + h * grad_T(p)
        return np.concatenate((q, p - h * grad_V(q)))

    flows = HamSys(ndof=system.dimension, chi=chi, chi_star=chi_star)
    settings = Parameters(step=step, solver="BM6", display=False)
    ends = np.array([0.0, t_end])

    def path() -> tuple[States, float]:
        states: list[States] = []
        count[0] = 0
        flows.integrate(start, ends, settings, command=lambda t, y: states.append(y.copy()))
        return np.array(states), count[0]

    return Attempt(run=lambda: flows.integrate(start, ends, settings), path=path)


def _gradients(system: System) -> tuple[Callable[[States], States], Callable[[States], States]]:
    """dT/dp and dV/dq of arrays, as one would write them with numpy."""
    constants = [float(Fraction(parameter.value)) for parameter in system.parameters.values()]
    if system.quadratic_kinetic_energy:
        return lambda p: p, lambda q: np.array(system.grad_V(q, *constants))
    return lambda p: np.array(system.grad_T(tuple(p))), lambda q: np.array(system.grad_V(q, *constants))


def numpy_splitting(integrator: str) -> Callable[[System, float, float], Attempt]:
    """The method ``integrator`` of this package in a dozen lines of numpy, the force of a closing kick used again."""

    def attempt(system: System, t_end: float, step: float) -> Attempt:
        from nearharmonic.integrators import integrators

        tableau = integrators[integrator]
        steps = max(1, round(t_end / step))
        tau, start = t_end / steps, start_of(system)
        grad_T, grad_V = _gradients(system)
        outer, inner = (np.array(row) * tau for row in tableau.rows_double())
        kick_first = tableau.first == "kick"
        drifts, kicks = (inner, outer[1:]) if kick_first else (outer[:-1], inner)
        opening, closing = (outer[0], 0.0) if kick_first else (0.0, outer[-1])

        def run(seen: Callable[[States, States], None] | None = None) -> tuple[States, States]:
            q, p = np.split(start.copy(), 2)
            force = grad_V(q)
            for _ in range(steps):
                if kick_first:
                    p = p - opening * force
                for drift, kick in zip(drifts, kicks, strict=True):
                    q = q + drift * grad_T(p)
                    force = grad_V(q)
                    p = p - kick * force
                if not kick_first:
                    q = q + closing * grad_T(p)
                if seen is not None:
                    seen(q, p)
            return q, p

        def path() -> tuple[States, float]:
            states = [start]
            run(lambda q, p: states.append(np.concatenate((q, p))))
            return np.array(states), tableau.stages * steps + 1

        return Attempt(run=run, path=path)

    return attempt
