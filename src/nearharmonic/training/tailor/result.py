"""Gain of a method made for a system on starts that were not used, with an interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Ensemble
from nearharmonic.training.tailor.question import Question
from nearharmonic.training.tailor.search import SearchResult

#: Resamples of the starts, and the part of them that an interval holds.
RESAMPLES, CONFIDENCE = 2000, 0.95
#: Cost of the gradient of the square of grad V, in forces, by which methods are compared at equal cost: what kernels
#: are taken to need. Measured costs are below and little above it, see docs/methods.md.
CHARGE = 1.0


@dataclass(frozen=True, kw_only=True)
class Gain:
    """By how many decades an error is smaller: the mean over the starts, and its 95 % interval by resampling them."""

    mean: float
    low: float
    high: float

    @property
    def is_one(self) -> bool:
        """True if the interval is above 0."""
        return self.low > 0

    def __str__(self) -> str:
        return f"{self.mean:.2f} ({self.low:.2f} to {self.high:.2f})"


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A method beside the best of others at each of T step sizes, at equal cost.

    Attributes
    ----------
    tau_per_stage, error, best_error : (T,) array of float
        Step size, and mean over the starts, by the logarithm, of max |dH| of the method and of the best of the others.
    best : tuple of T str
        Names of the best.
    overall : Tableau
        The one of the others with the least mean over all step sizes.
    gains : tuple of T Gain
        At each step size.
    gain : Gain
        Over all of them: the mean.
    """

    tau_per_stage: Floats
    error: Floats
    best_error: Floats
    best: tuple[str, ...]
    overall: Tableau
    gains: tuple[Gain, ...]
    gain: Gain


def comparison(
    method: Tableau, others: Sequence[Tableau], ensemble: Ensemble, tau_per_stage: Floats, seed: int
) -> Comparison:
    """Return a method beside the best of ``others``, which at each step size is that of the smallest mean error.

    The gradient of the square of grad V, which some of them need, costs :data:`CHARGE`.
    """
    errors = _logarithms(ensemble, [method, *others], tau_per_stage)
    means = errors.mean(axis=2)
    best = means[1:].argmin(axis=0)
    won = errors[1 + best, np.arange(len(best))] - errors[0]
    draws = np.random.default_rng([seed, 3]).integers(ensemble.size, size=(RESAMPLES, ensemble.size))
    return Comparison(
        tau_per_stage=tau_per_stage,
        error=10 ** means[0],
        best_error=10 ** means[1:].min(axis=0),
        best=tuple(others[i].name for i in best),
        overall=others[int(means[1:].mean(axis=1).argmin())],
        gains=tuple(_gain(row, draws) for row in won),
        gain=_gain(won.mean(axis=0), draws),
    )


def _logarithms(ensemble: Ensemble, methods: Sequence[Tableau], tau_per_stage: Floats) -> Floats:
    """log10 max |dH| (methods, T, M)."""
    errors = np.stack([errors_of(ensemble, one, tau_per_stage.tolist(), CHARGE) for one in methods])
    found: Floats = np.log10(np.maximum(errors, LEAST))
    return found


def _gain(won: Floats, draws: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> Gain:
    means = won[draws].mean(axis=1)
    tail = 50 * (1 - CONFIDENCE)
    low, high = np.percentile(means, [tail, 100 - tail])
    return Gain(mean=float(won.mean()), low=float(low), high=float(high))


@dataclass(frozen=True, kw_only=True)
class Tailored:
    """A method that was made for a system, and what it is worth.

    Attributes
    ----------
    question : Question
        What was asked.
    window : pair of float
        Step sizes per stage, in the system's unit of time.
    ensemble, held_out : Ensemble
        Starts that coefficients were chosen by, and those of the test, with longer runs.
    tableau : Tableau
        The method.
    search : SearchResult
        How far the search came.
    test, training : Comparison
        Beside the best published methods, on the starts of the test and on those of the search.
    trained : Comparison or None
        Beside the best of the methods that were trained on ensembles, on the starts of the test.
    modified : Comparison or None
        Beside the best of the methods with kicks of a modified potential, on the starts of the test.
    """

    question: Question
    window: tuple[float, float]
    ensemble: Ensemble
    held_out: Ensemble
    tableau: Tableau
    search: SearchResult
    test: Comparison
    training: Comparison
    trained: Comparison | None
    modified: Comparison | None = None

    @property
    def has_gain(self) -> bool:
        """True if the interval of the gain on starts that were not used is above 0."""
        return self.test.gain.is_one

    @cached_property
    def losing(self) -> tuple[tuple[float, Gain], ...]:
        """Step sizes of the test at which the interval of the gain is not above 0, with it."""
        pairs = zip(self.test.tau_per_stage.tolist(), self.test.gains, strict=True)
        return tuple((tau, gain) for tau, gain in pairs if not gain.is_one)
