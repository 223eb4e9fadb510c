"""Methods of this package in a dozen lines of numpy, written without a library."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nearharmonic.integrators import blanes_2013, nielsen_2015
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.systems.system import System
from nearharmonic_paper.experiments.work_precision.peers.peer import Attempt, Peer, States, gradients_of, start_of


def numpy_splitting(tableau: Tableau) -> Callable[[System, float, float], Attempt]:
    """Return the method ``tableau`` in numpy; the next step reuses the force of the last kick."""

    def attempt(system: System, t_end: float, step: float) -> Attempt:
        steps = max(1, round(t_end / step))
        tau, start = t_end / steps, start_of(system)
        grad_T, grad_V = gradients_of(system)
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


#: One method with the drift first and one with the kick first, imported from their files so that the code digest covers
#: these.
METHODS = ("aba864", "babps9o7h")

PEERS = tuple(
    Peer(
        name=f"numpy_{tableau.name}", label=f"{tableau.label} in plain numpy", module="numpy", stages=tableau.stages,
        attempt=numpy_splitting(tableau),
    )
    for tableau in (*blanes_2013.TABLEAUS, *nielsen_2015.TABLEAUS)
    if tableau.name in METHODS
)  # fmt: skip
