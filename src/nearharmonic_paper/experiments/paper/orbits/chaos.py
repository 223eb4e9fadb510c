"""Largest Lyapunov exponents of the Henon-Heiles system: of the paper's orbit, and of a regular one for contrast."""

from __future__ import annotations

from math import sqrt

import numpy as np

from nearharmonic.engine.solution import Problem
from nearharmonic.engine.variation import tangent_system
from nearharmonic.integrators import integrators
from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats, dot
from nearharmonic.numerics.statistics import mean, student_975
from nearharmonic.output.dataset import Contents, Variables, coordinate, variable
from nearharmonic.systems import System, henon_heiles
from nearharmonic.systems.quantities import Vector

#: Initial q and p, decimal strings.
Orbit = tuple[tuple[str, ...], tuple[str, ...]]
#: Orbit -> initial q and p: the paper's (Nielsen 2015, Eq. 18), H = 1/8, and a quarter of it, H = 1/128.
ORBITS: dict[str, Orbit] = {
    "paper": (henon_heiles.SYSTEM.q0, henon_heiles.SYSTEM.p0),
    "regular": (("0.075", "0"), ("0", "0.1")),
}
#: Step size: the energy error of BAB's8o7H on the paper's orbit stays below 1e-7.
TAU = 0.5
#: Time between two rescalings: deviations grow at most by e^50.
SCALED_EVERY = 500
#: Blocks of equal length for the interval. For t = 2e5 their length is 2e4, long compared with the times that the orbit
#: stays near regular orbits. In a test with fifty such parts of a longer run, 45 intervals contained the exponent of
#: the whole run.
BLOCKS = 10

#: Variables over orbit: their further dimensions, their meaning, and the quantity that determines their unit.
MEANINGS = {
    "q0": (("component",), "initial position", "q"),
    "p0": (("component",), "initial momentum", "p"),
    "initial_energy": ((), "initial energy H0", "energy"),
    "energy_error": (("time",), "(H - H0)/|H0|", "1"),
    "lyapunov_exponent": (
        ("time",),
        "largest Lyapunov exponent up to the time, ln|delta(t)|/t of a deviation delta of length 1 at t = 0",
        "1/t",
    ),
    "lyapunov_exponent_interval": (
        (),
        "half width of the 95 % interval of the largest Lyapunov exponent up to the last time, by blocks of time",
        "1/t",
    ),
}


def chaos(integrator: str, t_end: int) -> dict[str, Contents]:
    """Return the contents of the file ``cube``: :func:`lyapunov_exponents` of the Henon-Heiles system.

    The last time ``t_end`` is a multiple of ten times :data:`SCALED_EVERY`.
    """
    system, tableau, scalings = henon_heiles.SYSTEM, integrators[integrator], t_end // SCALED_EVERY
    problem = Problem(tangent_system(system), tableau, t_end=SCALED_EVERY, energy="none")
    variables = lyapunov_exponents(system, problem, scalings)
    attributes = {
        "system": system.name, "system_label": system.label, "integrator": tableau.name, "label": tableau.label,
        "tau": TAU, "blocks": BLOCKS,
    }  # fmt: skip
    evaluations = len(ORBITS) * scalings * tableau.evaluations(problem.steps_of(TAU))
    return {"cube": Contents(variables=variables, attributes=attributes, evaluations=evaluations)}


def lyapunov_exponents(system: System, problem: Problem, scalings: int) -> Variables:
    """Integrate each of :data:`ORBITS` with a deviation from it; the variables are those of :data:`MEANINGS`.

    A call of ``problem`` is a run of the tangent system of ``system``, which has no parameters, over the time between
    two rescalings. Their number is a multiple of :data:`BLOCKS`.
    """
    every, unit = float(problem.end), system.units["t"]
    time = every * np.arange(1.0, scalings + 1)
    found = [_of_orbit(system, problem, orbit, time) for orbit in ORBITS.values()]
    units = {**system.units, "1": "1", "1/t": "1" if unit == "1" else f"1/{unit}"}
    return {
        **coordinate("orbit", list(ORBITS), "orbit"),
        **coordinate("time", time, "time", unit),
        **{
            name: variable(("orbit", *dims), np.array([one[name] for one in found]), text, units[key])
            for name, (dims, text, key) in MEANINGS.items()
        },
    }


def _of_orbit(system: System, problem: Problem, orbit: Orbit, time: Floats) -> dict[str, object]:
    """Return the variables of one orbit."""
    q0, p0 = (tuple(map(float, values)) for values in orbit)
    states, growth = follow(problem, TAU, orbit, time.size)
    q, p = (tuple(rows) for rows in states.transpose(1, 2, 0))
    start, energy = system.energy(q0, p0), system.energy(q, p)
    rates = np.array([mean(block) for block in np.split(growth, BLOCKS)]) / float(problem.end)
    spread = rates - mean(rates)
    return {
        "q0": q0,
        "p0": p0,
        "initial_energy": start,
        "energy_error": (energy - start) / abs(start),
        "lyapunov_exponent": np.cumsum(growth) / time,
        "lyapunov_exponent_interval": student_975(BLOCKS - 1) * sqrt(dot(spread, spread) / (BLOCKS - 1) / BLOCKS),
    }


def follow(problem: Problem, tau: float, orbit: tuple[Vector, Vector], runs: int) -> tuple[Floats, Floats]:
    """Chain n runs of a tangent system; the deviation is rescaled to length 1 after each run to avoid overflow.

    A call of ``problem`` is a run of a tangent system of d coordinates, without energy, over the time between two
    rescalings; the next begins with the doubles where it ends, without the carries. The files of the paper's orbit have
    these bits, which :func:`nearharmonic.tangent` does not repeat: it keeps the carries of the orbit. ``orbit`` is
    the initial q and p; the initial deviation is that of the tangent system. Returned are q and p at the end of each
    run (n, 2, d), and the logarithms of the factors by which the deviation grows (n,).
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
