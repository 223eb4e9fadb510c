"""heyoka on the regularised equations of a system, the best that its users can do where a regularisation is known.

With the fictitious time s as the variable: u' = v, v' = -dV/du with V of
:class:`nearharmonic.systems.formulas.regularisation.RegularisedFormulas`, and t' = |u|^2. heyoka's tolerance is
relative to the largest component of the state, so that t is scaled by ``t_end``; w = -H is a constant, and no
component.

What favours heyoka: the fictitious time at which t = ``t_end`` is found beforehand, by dense output and Newton's
method, and the final state that is timed is (u, v, t), not mapped back to q and p. Errors are those of q and p.
"""

from __future__ import annotations

from functools import partial
from math import isfinite
from typing import Any

import numpy as np

from nearharmonic.engine.batch.regularised import unperturbed
from nearharmonic.reproduction.experiments.work_precision.peers.heyoka import TOLERANCES, functions_of, taylor_attempt
from nearharmonic.reproduction.experiments.work_precision.peers.peer import MOST_STEPS, Attempt, Peer, States
from nearharmonic.systems.definition.system import System
from nearharmonic.systems.formulas.regularisation import RegularisedFormulas
from nearharmonic.systems.formulas.source import velocity

#: Repeats of Newton's method for the fictitious time of the end, which converges in four.
REPEATS = 8


def heyoka_regularised(system: System, t_end: float, tolerance: float, *, fast_math: bool = False) -> Attempt:
    """Prepare ``heyoka.taylor_adaptive`` and ``taylor_adaptive_batch`` on the regularised equations.

    Parameters
    ----------
    system
        A system with a regularisation, and its initial state.
    t_end
        End of the interval, in the system's unit of time.
    tolerance
        Relative and absolute tolerance of each step.
    fast_math
        Whether heyoka may reorder floating-point operations.

    Raises
    ------
    TimeoutError
        The end is not reached within :data:`nearharmonic.reproduction.experiments.work_precision.peers.peer.MOST_STEPS`
        steps.
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
    """Derivatives of (u, v, t/t_end) by s as this package integrates them; no perturbation if its strength is 0."""
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
    """The s at which the last component of the state, which grows, is 1."""
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
    """(n, 2 d) physical states of (n, 2 c + 1) states (u, v, t)."""
    c = maps.coordinates - 1
    x, y = (*states[:, :c].T, w), (*states[:, c : 2 * c].T, 0.0)
    q, p = maps.to_physical(x, y)
    return np.array([*q, *p]).T


PEERS = tuple(
    Peer(
        name=name, label=label, module="heyoka", settings=TOLERANCES, regularised=True,
        attempt=partial(heyoka_regularised, fast_math=fast_math),
    )
    for name, label, fast_math in (
        ("heyoka_regularised", "heyoka, regularised equations", False),
        ("heyoka_regularised_fast_math", "heyoka, regularised, fast_math", True),
    )
)  # fmt: skip
