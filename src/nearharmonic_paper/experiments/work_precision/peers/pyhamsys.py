"""pyhamsys's composition BM6 of Blanes & Moan (2002), doi:10.1016/S0377-0427(01)00492-7."""

from __future__ import annotations

import numpy as np

from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Attempt, Peer, States, gradients_of, start_of


def pyhamsys_bm6(system: System, t_end: float, step: float) -> Attempt:
    """pyhamsys's sixth-order Blanes-Moan composition, the two flows in numpy."""
    from pyhamsys import HamSys, Parameters

    start = start_of(system)
    grad_T, grad_V = gradients_of(system)
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


PEERS = (Peer(name="pyhamsys_bm6", label="pyhamsys BM6", module="pyhamsys", stages=20, attempt=pyhamsys_bm6),)
