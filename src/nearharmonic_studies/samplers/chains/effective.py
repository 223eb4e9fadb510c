"""Effective samples of several chains by Geyer's initial monotone sequence, and intervals over the chains.

C. J. Geyer, Statist. Sci. 7, 473 (1992), doi:10.1214/ss/1177011137.
"""

from __future__ import annotations

import numpy as np

from nearharmonic.math import log
from nearharmonic.numerics.portable import Floats

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
