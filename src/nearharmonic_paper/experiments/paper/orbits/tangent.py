"""Growth of a deviation along one long orbit, by runs of the tangent system of the library.

Each run ends at a rescaling, and the next begins with the doubles where it ends, without the carries. The files of the
paper's orbit have these bits, which :func:`nearharmonic.tangent` does not repeat: it keeps the carries of the orbit.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from nearharmonic.engine.solution import Problem
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, dot
from nearharmonic.systems.quantities import Vector


def follow(problem: Problem, tau: float, orbit: tuple[Vector, Vector], runs: int) -> tuple[Floats, Floats]:
    """Chain runs of a tangent system; the deviation is rescaled to length 1 after each run to avoid overflow.

    Parameters
    ----------
    problem : Problem
        Runs of a :func:`~nearharmonic.engine.variation.tangent_system` of d coordinates, without energy, over
        the time between two rescalings.
    tau : float
        Step size.
    orbit : (q, p), tuples of d numbers or strings
        Initial state of the orbit. The initial deviation is that of the tangent system.
    runs : int
        Number of runs n.

    Returns
    -------
    states : (n, 2, d) array of float
        q and p at the end of each run.
    growth : (n,) array of float
        Logarithm of the factor by which the deviation grows in each run.
    """
    d = problem.system.dimension // 2
    u: Vector = problem.system.q0[d:]
    w: Vector = problem.system.p0[:d]
    q, p = orbit
    states, growth = np.empty((runs, 2, d)), np.empty(runs)
    for i in range(runs):
        end = problem(tau, (*q, *u), (*w, *p))
        q, u, w, p = (tuple(half) for row in (end.q[-1], end.p[-1]) for half in np.split(row, 2))
        length = sqrt(dot(u, u) + dot(w, w))
        states[i], growth[i] = (q, p), log(length)
        u, w = (tuple(x / length for x in half) for half in (u, w))
    return states, growth
