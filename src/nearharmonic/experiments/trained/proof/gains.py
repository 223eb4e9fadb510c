"""By how much the best trained method is ahead of the best published one, with intervals over the problems."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import frexp, ldexp

import numpy as np
from numpy.typing import NDArray

from nearharmonic.training.population import Floats

#: Resamples of the problems, and the part of them that an interval holds.
RESAMPLES = 1000
CONFIDENCE = 0.95

Integers = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Gains:
    """Of T step sizes.

    Attributes
    ----------
    published, trained : (T,) array of int
        Places of the best of each among the methods, by the mean over the problems; -1 where there is none.
    gain : (T,) array of float
        Mean of the logarithm to base 10 of the error of the best published method, less that of the best trained one:
        decades. NaN where there is none of either.
    interval : (T, 2) array of float
        Its interval by resampling the problems; the best of each are chosen anew in each resample.
    """

    published: Integers
    trained: Integers
    gain: Floats
    interval: Floats


def gains(logarithms: Floats, kinds: Sequence[str], seed: int, resamples: int = RESAMPLES) -> Gains:
    """Return the gains of the best trained over the best published method.

    Parameters
    ----------
    logarithms : (A, T, M) array of float
        Logarithms to base 10 of the errors of A methods on M problems.
    kinds : sequence of A str
        "trained", "published", or another kind that takes no part.
    seed : int
        Of the resamples.
    resamples : int
        Resamples of the problems.
    """
    published, trained = (np.flatnonzero(np.array(kinds) == kind) for kind in ("published", "trained"))
    _, points, problems = logarithms.shape
    if not published.size or not trained.size:
        nothing = np.full(points, np.nan)
        places = [_best(logarithms.mean(axis=-1), which) for which in (published, trained)]
        return Gains(published=places[0], trained=places[1], gain=nothing, interval=np.stack([nothing] * 2, axis=-1))
    means = logarithms.mean(axis=-1)
    again = means_of(logarithms, resampled(problems, resamples, seed))
    found = again[published].min(axis=0) - again[trained].min(axis=0)
    return Gains(
        published=_best(means, published), trained=_best(means, trained),
        gain=means[published].min(axis=0) - means[trained].min(axis=0), interval=bounds(found),
    )  # fmt: skip


def resampled(problems: int, resamples: int, seed: int) -> Integers:
    """Return how often (R, M) each of M problems is in each of R resamples."""
    return np.random.default_rng(seed).multinomial(problems, np.full(problems, 1 / problems), resamples)


def means_of(logarithms: Floats, counts: Integers) -> Floats:
    """Return the means (..., R) over the last axis, of M problems, each taken as often as ``counts`` (R, M) says.

    A matrix product adds in an order of each processor's own. The finite logarithms are rounded to multiples of a power
    of two that makes all sums exact, whatever their order: by 10^-12 at most for 192 problems.
    """
    sizes = counts.sum(axis=1)
    _, exponent = frexp(float(np.abs(logarithms).max()) * int(sizes.max()))
    unit = ldexp(1.0, exponent - 52)
    found: Floats = np.rint(logarithms / unit) @ counts.T.astype(float) * unit / sizes
    return found


def bounds(samples: Floats) -> Floats:
    """Return the interval (..., 2) that holds :data:`CONFIDENCE` of the resamples along the last axis."""
    tails = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)
    return np.moveaxis(np.quantile(samples, tails, axis=-1), 0, -1)


def _best(means: Floats, which: Integers) -> Integers:
    """Places (T,) of the least of ``means`` (A, T) among the rows ``which``; -1 if there is none."""
    if not which.size:
        return np.full(means.shape[1], -1)
    return np.asarray(which[means[which].argmin(axis=0)])
