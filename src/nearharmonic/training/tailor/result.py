"""Gain of a tailored method on starts of the test, with a confidence interval."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt

import numpy as np

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.objective import errors_of
from nearharmonic.training.population import LEAST, Ensemble
from nearharmonic.training.tailor.contenders import CHARGE
from nearharmonic.training.tailor.question import Question
from nearharmonic.training.tailor.search import SearchResult

#: Number of resamples of the starts, and coverage of the interval.
RESAMPLES, CONFIDENCE = 2000, 0.95


@dataclass(frozen=True, kw_only=True)
class Gain:
    """Gain in decades: the mean over the starts, and its 95 % interval by resampling the starts."""

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
    """Comparison of a method with the best of others at each of T step sizes, at equal cost.

    Attributes
    ----------
    tau_per_stage, error, best_error : (T,) array of float
        Step size, and geometric means over the starts of max |dH| of the method and of the best other method.
    best : tuple of T str
        Names of the best other methods.
    overall : Tableau
        The other method with the smallest mean over all step sizes.
    gains : tuple of T Gain
        Gain at each step size.
    gain : Gain
        Mean gain over all step sizes.
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
    """Compare a method with the best of ``others``: at each step size the method with the smallest mean error.

    The gradient of the square of grad V, which some methods need, costs :data:`CHARGE`.
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
    """Return log10 max |dH| (methods, T, M)."""
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
    """A tailored method and its tests.

    Attributes
    ----------
    question : Question
        The request.
    window : pair of float
        Smallest and largest step size per stage, in the unit of time of the system.
    ensemble, held_out : Ensemble
        Starts of the search, and starts of the test, with longer runs.
    tableau : Tableau
        The method.
    search : SearchResult
        Result and extent of the search.
    test, training : Comparison
        Comparisons with the best registered methods, on the starts of the test and of the search.
    published : Comparison
        Comparison with the best methods of other authors, on the starts of the test.
    """

    question: Question
    window: tuple[float, float]
    ensemble: Ensemble
    held_out: Ensemble
    tableau: Tableau
    search: SearchResult
    test: Comparison
    training: Comparison
    published: Comparison

    @property
    def has_gain(self) -> bool:
        """True if the interval of the gain on the starts of the test is above 0."""
        return self.test.gain.is_one

    @property
    def call(self) -> str:
        """Python code that runs the best registered method in the middle of the window."""
        best, middle = self.test.overall, sqrt(self.window[0] * self.window[1])
        tau = float(f"{middle * (best.stages + CHARGE * best.gradients):.3g}")
        return f"nh.integrate({self.question.given}, {best.name!r}, {tau:g})"

    @cached_property
    def losing(self) -> tuple[tuple[float, Gain], ...]:
        """Step sizes of the test at which the interval of the gain is not above 0, with the gain."""
        pairs = zip(self.test.tau_per_stage.tolist(), self.test.gains, strict=True)
        return tuple((tau, gain) for tau, gain in pairs if not gain.is_one)
