"""heyoka's adaptive Taylor series (Biscani & Izzo 2021, doi:10.1093/mnras/stab1032), scalar and in batches of lanes.

The equations are the formulas of the system. For V = -GM/|q| there are also the equations that are best for heyoka,
with ``GM * (x*x + y*y)**-1.5`` written as a power; its own ``model.fixed_centres`` is 4 to 9 % slower than the
formulas, and ``hamiltonian()`` of the system's potential a quarter slower. ``high_accuracy`` stays off, which is the
default.

Where a regularisation is known, the regularised equations are the best that users of heyoka can do. With the fictitious
time s as the variable: u' = v, v' = -dV/du with V of
:class:`nearharmonic.systems.formulas.RegularisedFormulas`, and t' = |u|^2. heyoka's tolerance is
relative to the largest component of the state, so t is scaled by ``t_end``. w = -H is a constant, not a component. Two
choices favour heyoka. The fictitious time at which t = ``t_end`` is computed before the timing, by dense output and
Newton's method. The timed run ends with (u, v, t), without the map to q and p. Errors are those of q and p.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from math import isfinite, nan
from typing import Any

import numpy as np

from nearharmonic.engine.batch import unperturbed
from nearharmonic.systems.formulas import RegularisedFormulas
from nearharmonic.systems.gradients import velocity
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import MOST_STEPS, Attempt, Peer, States, start_of

TAYLOR_TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13, 1e-15)
#: Number of doubles in a batch: a register of AVX-512.
BATCH = 8


def heyoka_taylor(
    system: System, t_end: float, tolerance: float, *, fast_math: bool = False, power: bool = False
) -> Attempt:
    """Prepare ``heyoka.taylor_adaptive``, whose order follows from the tolerance, and ``taylor_adaptive_batch``.

    ``system``: the equations of motion and the initial state. ``t_end``: end of the interval, in the system's unit of
    time. ``tolerance``: relative and absolute tolerance of each step. ``fast_math``: True to let heyoka reorder
    floating-point operations. ``power``: True for the force GM q (q.q)^(-3/2), written as a power, instead of the
    formula of the system.
    """
    import heyoka as hy

    names = [f"{letter}{i}" for letter in "qp" for i in range(system.dimension)]
    variables = hy.make_vars(*names)
    variables = list(variables) if isinstance(variables, list | tuple) else [variables]
    rates = _gravity(system, variables) if power else velocity(system, functions_of(hy))(*variables)
    return taylor_attempt(list(zip(variables, rates, strict=True)), start_of(system), t_end, tolerance, fast_math)


def taylor_attempt(equations: Sequence[Any], start: States, end: float, tolerance: float, fast_math: bool) -> Attempt:
    """Prepare one trajectory and a batch of equal ones.

    ``equations``: pairs of heyoka's variables and their derivatives. ``start`` (n,): the variables at
    0. ``end``: end of the interval of the independent variable. ``tolerance``, ``fast_math``: as in
    :func:`heyoka_taylor`.
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
        return np.array(states), nan

    def lanes() -> Any:
        batch.set_time(0.0)
        batch.state[:] = starts
        batch.propagate_until(end)
        return batch.state

    return Attempt(run=run, path=path, lanes=lanes, members=BATCH)


def _gravity(system: System, variables: Sequence[Any]) -> list[Any]:
    """Return dq/dt and dp/dt for V = -GM/|q|."""
    q, p = variables[: system.dimension], variables[system.dimension :]
    (GM,) = system.constants(float)
    pull = GM * sum(x * x for x in q) ** -1.5
    return [*p, *(-pull * x for x in q)]


def functions_of(hy: Any) -> dict[str, Any]:
    """Return the functions of formulas as heyoka's expressions; missing functions use roots and powers."""
    own = ("sqrt", "sin", "cos", "tan", "exp", "log", "atan2", "tanh", "sinh", "cosh", "erf")
    derived = {
        "abs": lambda x: hy.sqrt(x * x),
        "pow": lambda x, y: (x if isinstance(x, hy.expression) else hy.expression(x)) ** y,
        "cbrt": lambda x: x * (x * x) ** (-1 / 3),
        "hypot": lambda x, y: hy.sqrt(x * x + y * y),
    }
    return {name: getattr(hy, name) for name in own} | derived


#: Iterations of Newton's method for the final fictitious time; four are sufficient.
REPEATS = 8


def heyoka_regularised(system: System, t_end: float, tolerance: float, *, fast_math: bool = False) -> Attempt:
    """Prepare ``heyoka.taylor_adaptive`` and ``taylor_adaptive_batch`` on the equations of a regularised system.

    Parameters are those of :func:`heyoka_taylor`.

    Raises TimeoutError: the end is not reached within
    :data:`nearharmonic_paper.experiments.work_precision.peers.peer.MOST_STEPS` steps.
    """
    import heyoka as hy

    maps = system.formulas().regularised
    assert maps is not None
    (*u, w), (*v, _) = maps.from_physical(*system.start(float), *system.constants(float))
    start = np.array([*u, *v, 0.0], dtype=float)
    equations = _equations(hy, system, maps.coordinates, float(w), t_end)
    end = _fictitious_end(hy.taylor_adaptive(equations, list(start), tol=tolerance, fast_math=fast_math))
    attempt = taylor_attempt(equations, start, end, tolerance, fast_math)

    def path() -> tuple[States, float]:
        states, evaluations = attempt.path()
        return _physical(maps, states, float(w)), evaluations

    return Attempt(run=attempt.run, path=path, lanes=attempt.lanes, members=attempt.members)


def _equations(hy: Any, system: System, coordinates: int, w: float, t_end: float) -> list[tuple[Any, Any]]:
    """Return the derivatives of (u, v, t/t_end) by s, as in this package; without perturbation if its strength is 0."""
    d = coordinates - 1
    given = system.regularisation
    assert given is not None
    if given.strength is not None and float(system.parameters[given.strength].value) == 0:
        system = unperturbed(system)
    names = [*(f"u{i}" for i in range(d)), *(f"v{i}" for i in range(d)), "t"]
    variables = hy.make_vars(*names)
    u, v = variables[:d], variables[d:-1]
    # The momentum of w is -t/4.
    *rates, clock = velocity(system, functions_of(hy))(*u, hy.expression(w), *v, hy.expression(0.0))
    return list(zip(variables, [*rates[:d], *rates[d + 1 :], -4 / t_end * clock], strict=True))


def _fictitious_end(solver: Any) -> float:
    """Return the s at which the last component of the state, which increases, is 1."""
    for _ in range(MOST_STEPS):
        before = solver.time
        solver.step(write_tc=True)
        if not isfinite(solver.state[-1]):
            raise ArithmeticError("the run has left its orbit")
        if solver.state[-1] >= 1:
            break
    else:
        raise TimeoutError
    series = solver.tc[-1]
    h = solver.time - before
    for _ in range(REPEATS):
        h -= (np.polyval(series[::-1], h) - 1) / np.polyval(np.polyder(series[::-1]), h)
    return float(before + h)


def _physical(maps: RegularisedFormulas, states: States, w: float) -> States:
    """Return (n, 2 d) physical states of (n, 2 c + 1) states (u, v, t)."""
    c = maps.coordinates - 1
    x, y = (*states[:, :c].T, w), (*states[:, c : 2 * c].T, 0.0)
    q, p = maps.to_physical(x, y)
    return np.array([*q, *p]).T


PEERS = tuple(
    Peer(
        name=name, label=label, module="heyoka", settings=TAYLOR_TOLERANCES,
        attempt=partial(attempt, fast_math=fast_math), gravity_only=name.startswith("heyoka_power"),
        regularised=name.startswith("heyoka_regularised"),
    )
    for name, label, attempt, fast_math in (
        ("heyoka", "heyoka (adaptive Taylor)", heyoka_taylor, False),
        ("heyoka_fast_math", "heyoka, fast_math", heyoka_taylor, True),
        ("heyoka_power", "heyoka, force as a power", partial(heyoka_taylor, power=True), False),
        ("heyoka_power_fast_math", "heyoka, power, fast_math", partial(heyoka_taylor, power=True), True),
        ("heyoka_regularised", "heyoka, regularised equations", heyoka_regularised, False),
        ("heyoka_regularised_fast_math", "heyoka, regularised, fast_math", heyoka_regularised, True),
    )
)  # fmt: skip
