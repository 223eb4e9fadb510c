"""Tangent map of a splitting method: the linear map of deviations from an orbit for each step.

The derivative of a step is the same step applied to a separable Hamiltonian of twice as many coordinates, K = grad
T(p).w + grad V(q).u, with coordinates (q, u) and momenta (w, p): q and p follow the orbit, u and w the linearised
equations. Deviations therefore use the kernels of ordinary systems.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from nearharmonic.engine.runs.problem import Problem
from nearharmonic.math import log
from nearharmonic.numerics.portable import dot
from nearharmonic.numerics.types import Floats
from nearharmonic.systems.definition.quantities import Vector
from nearharmonic.systems.definition.system import System


def tangent_system(system: System) -> System:
    """Return the system K, of 2 d coordinates, of an autonomous ``system`` of d coordinates and no parameters.

    Its initial deviation has length 1, along the first coordinate.
    """
    d, formulas = system.dimension, system.formulas()

    def V(x: Vector) -> Any:
        return _product(formulas.grad_V(x[:d]), x[d:])

    def T(x: Vector) -> Any:
        return _product(formulas.grad_T(x[d:]), x[:d])

    rest = ("0",) * d
    return System(
        name=f"{system.name}_tangent", V=V, T=T, q0=(*system.q0, "1", *rest[1:]), p0=(*rest, *system.p0),
        t_end=system.t_end, source=system.source,
    )  # fmt: skip


def _product(one: Vector, other: Vector) -> Any:
    terms = [a * b for a, b in zip(one, other, strict=True)]
    return sum(terms[1:], terms[0])


def follow(problem: Problem, tau: float, orbit: tuple[Vector, Vector], runs: int) -> tuple[Floats, Floats]:
    """Chain runs of a tangent system; the deviation is rescaled to length 1 after each run to avoid overflow.

    Parameters
    ----------
    problem : Problem
        Runs of :func:`tangent_system` of d coordinates, without energy, over the time between two rescalings.
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
