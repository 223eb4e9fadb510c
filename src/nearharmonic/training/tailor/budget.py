"""Budget of a search, in time or in trials."""

from __future__ import annotations

import time
from collections.abc import Callable

from nearharmonic.errors import NearharmonicError
from nearharmonic.training.search.descent import library


class BudgetSpentError(NearharmonicError):
    """Time or trials of a search are spent; the results so far are kept."""


class Budget:
    """Time, or a number of trials, that a search may take; None for no limit.

    ``show`` is called with the spent fraction, from 0 to 1, and the smallest objective.
    """

    def __init__(
        self, seconds: float | None, trials: int | None, show: Callable[[float, float], None] | None = None
    ) -> None:
        library()  # the time of the import does not count
        self._seconds, self._most, self._show = seconds, trials, show
        self._begin = time.monotonic()
        self.trials = 0

    @property
    def seconds(self) -> float:
        """Time since the search began."""
        return time.monotonic() - self._begin

    def spend(self, trials: int, best: float) -> None:
        """Count trials.

        Raises
        ------
        BudgetSpentError
            The budget is spent.
        """
        self.trials += trials
        parts = [(self.seconds, self._seconds), (self.trials, self._most)]
        spent = max(used / allowed for used, allowed in parts if allowed is not None)
        if self._show is not None:
            self._show(min(spent, 1.0), best)
        if spent >= 1:
            raise BudgetSpentError("the budget of the search is spent")
