"""Chains of Hamiltonian Monte Carlo, and their effective samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.math import exp, log
from nearharmonic.numerics.compiled import Normal, compiled
from nearharmonic.numerics.portable import Floats
from nearharmonic_studies.samplers.targets import Target

# --- Effective samples of several chains by Geyer's initial monotone sequence, and intervals over the chains.
#
# C. J. Geyer, Statist. Sci. 7, 473 (1992), doi:10.1214/ss/1177011137.

#: Autocovariances are formed up to this lag at most, and up to a quarter of a chain; the number that is tried first.
LAGS, FIRST = 400, 32
#: Student's t for a probability of 0.975, by degrees of freedom: Abramowitz & Stegun (1964), Table 26.10.
STUDENT = {1: 12.706, 2: 4.303, 3: 3.182, 5: 2.571, 7: 2.365, 11: 2.201, 15: 2.131, 23: 2.069, 31: 2.040}


def covariances(chains: Floats, lags: int = LAGS) -> Floats:
    """Return the autocovariances (chains, lags) of chains (chains, c) around their common mean, up to c/4."""
    y = chains - chains.mean()
    c = y.shape[1]
    return np.array([[(row[: c - lag] * row[lag:]).sum() / c for lag in range(min(c // 4, lags))] for row in y])


def enough(chains: Floats) -> Floats:
    """Return autocovariances up to LAGS, or fewer if the sums of :func:`time_of` end before, without any one chain."""
    lags, most = FIRST, min(LAGS, chains.shape[1] // 4)
    while True:
        found = covariances(chains, min(lags, most))
        if lags >= most or all(_ends(np.delete(found, k, axis=0).mean(axis=0)) for k in range(len(found))):
            return found
        lags *= 4


def _pairs(covariance: Floats) -> Floats:
    found: Floats = covariance[: len(covariance) // 2 * 2].reshape(-1, 2).sum(axis=1)
    return found


def _ends(covariance: Floats) -> bool:
    return not covariance[0] > 0 or bool((_pairs(covariance) <= 0).any())


def time_of(covariance: Floats) -> float:
    """Return the integrated autocorrelation time, 1 + 2 sum of autocorrelations, of autocovariances (lags,).

    Pairs of neighbouring lags are summed up to the first that is not positive, none above the one before.
    """
    if not covariance[0] > 0:
        return np.inf
    pairs = _pairs(covariance) / covariance[0]
    positive = np.flatnonzero(pairs <= 0)
    kept = np.minimum.accumulate(pairs[: positive[0] if positive.size else len(pairs)])
    return float(max(2 * kept.sum() - 1, 1e-3))


def costs(chains: Floats, gradients: Floats) -> Floats:
    """Return log(gradients per effective sample of the slowest observable), of all chains and without each of them.

    ``chains`` (chains, c, observables): observables of each proposal. ``gradients`` (chains,): gradients of each chain.
    :func:`error_of` has the standard error from the result (chains + 1,).
    """
    of_each = [enough(chains[..., k]) for k in range(chains.shape[-1])]
    every = np.arange(len(chains))

    def cost(kept: np.ndarray) -> float:
        time = max(time_of(one[kept].mean(axis=0)) for one in of_each)
        return float(log(gradients[kept].mean() / chains.shape[1] * time))

    return np.array([cost(every >= 0), *(cost(every != k) for k in every)])


def error_of(values: Floats) -> float:
    """Return the standard error of a value of :func:`costs`, or of a difference of two: the jackknife over chains."""
    parts = values[1:]
    return float(np.sqrt((len(parts) - 1) * ((parts - parts.mean()) ** 2).mean()))


def student(degrees: int) -> float:
    """Return Student's t at a probability of 0.975, for at least this number of degrees of freedom in a table."""
    return STUDENT[max(one for one in STUDENT if one <= degrees)]


# --- Chains of Hamiltonian Monte Carlo with one method, compiled for each target.
#
# The force at the end of a trajectory is that of the next first kick: a trajectory of N steps of s stages takes N s
# gradients. A method that begins with a drift evaluates U once more, without its gradient.

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
