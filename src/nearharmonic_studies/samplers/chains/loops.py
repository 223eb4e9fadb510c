"""Chains of Hamiltonian Monte Carlo with one method, compiled for each target.

The force at the end of a trajectory is that of the next first kick: a trajectory of N steps of s stages takes N s
gradients. A method that begins with a drift evaluates U once more, without its gradient.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp, log
from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic_studies.samplers.targets.target import Target

#: Times of a trajectory are uniform in this range around the chosen one, so that no mode returns to its start.
JITTER = (0.8, 1.2)
#: Leapfrog, with which chains warm up and which searches refer to, in configs without it too.
LEAPFROG = Tableau(
    name="leapfrog", order=2, first="kick", kick=("0.5", "0.5"), drift=("1",), source="Verlet (1967)", digits=14
)


class Chance(NamedTuple):
    """Random numbers of a chain, equal for all methods: momenta (c, n), logarithms and lengths (c,)."""

    momenta: Floats
    logarithms: Floats
    lengths: Floats


def chance(normal: Normal, count: int, n: int) -> Chance:
    """Draw the random numbers of ``count`` proposals."""
    low, high = JITTER
    momenta, accept, length = normal.rows(count, n), normal.uniform.random(count), normal.uniform.random(count)
    return Chance(momenta, -log(1.0 - accept), low + (high - low) * length)


class Chain(NamedTuple):
    """A chain: observables (c, o), energy errors of its proposals (c,), gradients, and the last state (n,)."""

    observed: Floats
    changes: Floats
    gradients: int
    last: Floats

    def acceptance(self) -> float:
        """Return the mean of min(1, exp(-dH)) over the proposals."""
        changes = np.where(np.isfinite(self.changes), np.clip(self.changes, 0.0, 700.0), 700.0)
        return float(exp(-changes).mean())


@compiled
def _kinetic(p):  # type: ignore[no-untyped-def]
    total = 0.0
    for k in range(len(p)):
        total += p[k] * p[k]
    return total / 2


@compiled
def _add(x, time, y):  # type: ignore[no-untyped-def]
    for k in range(len(x)):
        x[k] += time * y[k]


def loop_for(target: Target) -> Callable[..., None]:
    """Compile the chain for a target.

    The result is ``loop(q, momenta, logarithms, counts, kicks_first, outer, inner, observed, changes)``: a proposal for
    each row of the momenta, from q, which holds the last state at the end.
    """
    gradient, observe = target.gradient, target.observe

    @compiled
    def loop(q, momenta, logarithms, counts, kicks_first, outer, inner, observed, changes):  # type: ignore[no-untyped-def]
        slopes, found, trial, p = np.empty(len(q)), np.empty(len(q)), np.empty(len(q)), np.empty(len(q))
        potential = gradient(q, slopes)
        for t in range(len(momenta)):
            p[:], trial[:], found[:] = momenta[t], q, slopes
            before, proposed = _kinetic(p) + potential, potential
            for _ in range(counts[t]):
                for m in range(len(inner)):
                    if kicks_first:
                        _add(p, -outer[m], found)
                        _add(trial, inner[m], p)
                        proposed = gradient(trial, found)
                    else:
                        _add(trial, outer[m], p)
                        gradient(trial, found)
                        _add(p, -inner[m], found)
                if kicks_first:
                    _add(p, -outer[-1], found)
                else:
                    _add(trial, outer[-1], p)
            if not kicks_first:
                proposed = gradient(trial, found)
            changes[t] = (_kinetic(p) - before) + proposed
            if changes[t] <= logarithms[t]:
                q[:], slopes[:] = trial, found
                potential = proposed
            observe(q, potential, observed[t])

    return loop  # type: ignore[no-any-return]


def run(
    target: Target, loop: Callable[..., None], method: Tableau, tau: float, length: float, start: Floats, drawn: Chance
) -> Chain:
    """Return a chain from a start, with steps ``tau`` and trajectories of about ``length``."""
    counts = np.maximum(1, np.rint(length * drawn.lengths / tau)).astype(np.int64)
    outer, inner = (tau * np.array(row) for row in method.rows_double())
    observed, changes = np.empty((len(counts), len(target.observables))), np.empty(len(counts))
    q = start.copy()
    loop(
        q, drawn.momenta, drawn.logarithms, counts, method.first == "kick", outer, inner, observed, changes
    )  # fmt: skip
    return Chain(observed, changes, int(counts.sum()) * method.stages, q)
