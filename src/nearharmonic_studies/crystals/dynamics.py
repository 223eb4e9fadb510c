"""Loops over steps of a crystal: without thermostat, and with friction and noise in the middle of each step.

They are compiled for the gradient of one crystal. The force at the end of a step is that of the next first kick, and
its evaluation also gives V there: the energy after each step costs nothing if a step begins with a kick.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp
from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats


class Loops(NamedTuple):
    """Compiled loops of one crystal.

    ``run(u, p, masses, kicks_first, outer, inner, steps, every, energies)``: steps without thermostat from (u,
    p), which hold the state at the end. ``energies`` (k, 2) takes kinetic and potential energy at the start and after
    each ``every`` steps. ``thermostatted(u, p, masses, moves, kicks, ends, keep, noise, average)``:
    symmetric steps with friction and noise, which multiply p by ``keep`` and add a row of ``noise``. ``moves`` and
    ``kicks`` are the first half of a step. The bath acts in the middle of each step, with one row, or at both ends,
    with two. ``average`` (2,) gains the sums of V and of K after each step.
    """

    run: Callable[..., None]
    thermostatted: Callable[..., None]


@compiled
def _kinetic(p, masses):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(len(p)):
        total += p[k] * p[k] / masses[k]
    return total / 2


@compiled
def _drift(u, p, masses, time):  # type: ignore[no-untyped-def]
    for k in range(len(u)):
        u[k] += time * p[k] / masses[k]


@compiled
def _kick(p, slopes, time):  # type: ignore[no-untyped-def]
    for k in range(len(p)):
        p[k] -= time * slopes[k]


@compiled
def _bath(p, keep, noise):  # type: ignore[no-untyped-def]
    for k in range(len(p)):
        p[k] = keep * p[k] + noise[k]


def loops_for(gradient: Any) -> Loops:
    """Compile both loops for a gradient."""

    @compiled
    def run(u, p, masses, kicks_first, outer, inner, steps, every, energies):  # type: ignore[no-untyped-def]
        slopes = np.empty(len(u))
        potential = gradient(u, slopes)
        energies[0, 0], energies[0, 1] = _kinetic(p, masses), potential
        for step in range(1, steps + 1):
            for m in range(len(inner)):
                if kicks_first:
                    _kick(p, slopes, outer[m])
                    _drift(u, p, masses, inner[m])
                else:
                    _drift(u, p, masses, outer[m])
                potential = gradient(u, slopes)
                if not kicks_first:
                    _kick(p, slopes, inner[m])
            if kicks_first:
                _kick(p, slopes, outer[-1])
            else:
                _drift(u, p, masses, outer[-1])
            if step % every == 0:
                if not kicks_first:
                    potential = gradient(u, slopes)
                energies[step // every, 0], energies[step // every, 1] = _kinetic(p, masses), potential

    @compiled
    def thermostatted(u, p, masses, moves, kicks, ends, keep, noise, average):  # type: ignore[no-untyped-def]
        slopes = np.empty(len(u))
        stale = True
        half, rows = len(moves), 2 if ends else 1
        for step in range(len(noise) // rows):
            if ends:
                _bath(p, keep, noise[2 * step])
            for m in range(2 * half):
                if m == half and not ends:
                    _bath(p, keep, noise[step])
                k = min(m, 2 * half - 1 - m)
                if kicks[k]:
                    if stale:
                        gradient(u, slopes)
                        stale = False
                    _kick(p, slopes, moves[k])
                else:
                    _drift(u, p, masses, moves[k])
                    stale = True
            if ends:
                _bath(p, keep, noise[2 * step + 1])
            average[0] += gradient(u, slopes)
            average[1] += _kinetic(p, masses)
            stale = False

    return Loops(run, thermostatted)


def halves(tableau: Tableau, tau: float) -> tuple[Floats, np.ndarray]:
    """Return the moves of the first half of a symmetric step, the middle one cut in two, and which of them kick."""
    outer, inner = tableau.rows_double()
    row = [c for pair in zip(outer, (*inner, 0.0), strict=True) for c in pair][:-1]
    half = row[: len(row) // 2 + 1]
    half[-1] /= 2
    kicks = [(k % 2 == 0) == (tableau.first == "kick") for k in range(len(half))]
    return tau * np.array(half), np.array(kicks)


def equilibrated(
    loops: Loops, masses: Floats, energy: float, tau: float, steps: int, friction: float, normal: Normal
) -> tuple[Floats, Floats]:
    """Return displacements and momenta of a crystal at k_B T = ``energy``, after Langevin steps from the lattice sites.

    The steps are those of leapfrog around friction and noise, BAOAB: Leimkuhler & Matthews (2013), Appl. Math. Res.
    eXpress 2013, 34. The total momentum is then removed.
    """
    n = len(masses)
    u, p = np.zeros(n), np.sqrt(2 * energy * masses) * normal.rows(1, n)[0]
    keep, average = float(exp(-friction * tau)), np.zeros(2)
    width = np.sqrt((1 - keep * keep) * energy * masses)
    moves, kicks = np.array([tau / 2, tau / 2]), np.array([True, False])
    for begin in range(0, steps, 64):
        noise = width * normal.rows(min(64, steps - begin), n)
        loops.thermostatted(u, p, masses, moves, kicks, False, keep, noise, average)
    return u, _at_rest(p, masses)


def _at_rest(p: Floats, masses: Floats) -> Floats:
    """Remove the motion of the centre of mass: three components, or one if the masses are those of a chain."""
    dimension = 3 if np.array_equal(masses[::3], masses[1::3][: len(masses[::3])]) else 1
    momenta, weights = p.reshape(-1, dimension), masses.reshape(-1, dimension)
    found: Floats = momenta - weights * (momenta.sum(axis=0) / weights.sum(axis=0))
    return found.ravel()
