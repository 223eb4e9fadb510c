"""The search for a system's own method: many short searches, of which the best third goes on, until a budget is spent.

Published methods and those of a stage less that are grown are starts in every family, but for those that are far behind
the best. Each has as many trials; the best third has three times as many more, from where they are, and so on. The last
one is searched around, in turns with random starts, until time or trials are spent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import numpy as np

from nearharmonic.errors import SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective
from nearharmonic.training.population import Ensemble
from nearharmonic.training.search import (
    AROUND_FOUND,
    SAME_UNKNOWNS,
    SAME_VALUE,
    Effort,
    Start,
    descend,
    starts_of,
)
from nearharmonic.training.tailor.budget import Budget, BudgetSpentError

#: Methods tried at a time; trials of the first round from each start; starts that it has at most.
POPULATION, FIRST, MOST_STARTS = 20, 200, 24
#: A start whose objective is so much above that of the best of as many stages is left out.
FAR_BEHIND = 3.0
#: The part of the searches that goes on, and how many times the trials that it has: this number, and its inverse.
THIRD = 3
#: Trials of a search around the best, and of one from a random start, when the rounds are over.
AROUND_BEST, FROM_RANDOM = 3000, 1500
#: Orders that families have beyond four: (order, harmonic order, whether T has to be quadratic).
CONDITIONS = ((4, 4, False), (4, 6, False), (6, 6, True))


@dataclass(frozen=True, kw_only=True)
class Best:
    """The best member of all families so far.

    Attributes
    ----------
    value : float
        Its objective.
    family : Family or None
        Its family; None if no member was found.
    unknowns : (n,) array of float
        The member.
    origin : str
        Where its search began.
    advanced : float
        Objective after the last advance by more than searches that found the same differ by.
    trials, seconds : int and float
        When that was.
    """

    value: float = OUTSIDE
    family: Family | None = None
    unknowns: Floats = field(default_factory=lambda: np.zeros(0))
    origin: str = ""
    advanced: float = OUTSIDE
    trials: int = 0
    seconds: float = 0.0


@dataclass
class Record:
    """The best so far, exchanged as a whole: Ctrl-C may come at any time."""

    best: Best = field(default_factory=Best)


@dataclass
class Branch:
    """A start in a family, and how far its search has come."""

    family: Family
    start: Start
    value: float
    unknowns: Floats


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """Result of a search, and its extent.

    Attributes
    ----------
    best : Best
        The best member.
    trials, searches, again : int
        Members tried; searches that ended; those of them that ended at the best.
    seconds : float
        Time taken.
    stopped : str
        Why it ended: "spent" or "Ctrl-C".
    """

    best: Best
    trials: int
    searches: int
    again: int
    seconds: float
    stopped: str


class _Watched(Objective):
    """An objective that keeps the best member at every call, so that a search may be stopped at any time."""

    def __init__(self, record: Record, budget: Budget, family: Family, *others: Any, **settings: Any) -> None:
        super().__init__(family, *others, **settings)
        self._record, self._budget = record, budget
        self.origin = ""

    def __call__(self, points: Floats) -> Floats:
        values = super().__call__(points)
        i = int(values.argmin())
        if values[i] < self._record.best.value:
            self._record.best = self._better(float(values[i]), points[i : i + 1], len(points))
        self._budget.spend(len(points), self._record.best.value)
        return values

    def _better(self, value: float, point: Floats, trials: int) -> Best:
        before, unknowns = self._record.best, self.family.project(point)[0][0]
        found = replace(before, value=value, family=self.family, unknowns=unknowns, origin=self.origin)
        if value < before.advanced - SAME_VALUE:
            found = replace(
                found, advanced=value, trials=self._budget.trials + trials, seconds=self._budget.seconds
            )  # fmt: skip
        return found


class TailorSearch:
    """The search.

    Parameters
    ----------
    ensemble : Ensemble
        The problems.
    tau_per_stage : (T,) array of float
        The window.
    reference : (T,) array of float
        Mean of log10 max |dH| of the best published methods.
    known : sequence of Tableau
        Methods to start from.
    stages : sequence of int
        Stages of the methods that are tried.
    quadratic : bool
        Whether T is quadratic.
    budget : Budget
        When it ends.
    seed : int
        Of all random numbers.
    """

    def __init__(
        self, ensemble: Ensemble, tau_per_stage: Floats, reference: Floats, known: Sequence[Tableau], *,
        stages: Sequence[int], quadratic: bool, budget: Budget, seed: int,
    ) -> None:  # fmt: skip
        self._known, self._budget, self._random = known, budget, np.random.default_rng([seed, 2])
        self.record, self._ends = Record(), list[Branch]()
        self._objectives = {
            family: _Watched(self.record, budget, family, [ensemble], tau_per_stage, [reference], size=POPULATION)
            for family in families(stages, quadratic=quadratic)
        }

    def run(self) -> SearchResult:
        """Return what is found when the budget is spent or Ctrl-C is pressed.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C before anything was found.
        """
        try:
            self._search()
        except BudgetSpentError:
            stopped = "spent"
        except KeyboardInterrupt:
            if self.record.best.family is None:
                raise
            stopped = "Ctrl-C"
        best = self.record.best
        again = sum(_is_same(one, best) for one in self._ends)
        return SearchResult(
            best=best, trials=self._budget.trials, searches=len(self._ends), again=again,
            seconds=self._budget.seconds, stopped=stopped,
        )  # fmt: skip

    def _search(self) -> NoReturn:
        """Search until the budget is spent, which an error tells."""
        branches, trials, turn = self._branches(), FIRST, 0
        while len(branches) > 1:
            for branch in branches:
                self._go_on(branch, trials)
            branches = sorted(branches, key=lambda one: one.value)[: -(-len(branches) // THIRD)]
            trials, turn = THIRD * trials, turn + 1
            for branch in branches:
                spread = AROUND_FOUND[turn % len(AROUND_FOUND)]
                branch.start = Start(origin=branch.start.origin, point=branch.unknowns, spread=spread)
        everywhere = list(self._objectives)
        while True:
            turn += 1
            self._go_on(self._around_best(AROUND_FOUND[turn % len(AROUND_FOUND)]), AROUND_BEST)
            family = everywhere[turn % len(everywhere)]
            start = Start(origin="random", point=None, spread=AROUND_FOUND[-1])
            self._go_on(Branch(family, start, OUTSIDE, np.zeros(family.unknowns)), FROM_RANDOM)

    def _around_best(self, spread: float) -> Branch:
        best = self.record.best
        assert best.family is not None
        point = best.unknowns + spread * self._random.normal(size=best.family.unknowns)
        return Branch(best.family, Start(origin=best.origin, point=point, spread=spread), OUTSIDE, point)

    def _branches(self) -> list[Branch]:
        """The better ones of the methods that are known: in turns the best of each number of stages, then the next."""
        found: dict[int, list[Branch]] = {}
        effort = Effort(trials=FIRST, random=0, refinements=0)
        for family, objective in self._objectives.items():
            starts = {start.origin: start for start in starts_of(family, self._known, [], effort)}
            if starts:
                objective.origin = "a published method"
                points = np.array([start.point for start in starts.values()])
                parts = zip(starts.values(), objective(points).tolist(), points, strict=True)
                found.setdefault(family.stages, []).extend(Branch(family, *part) for part in parts)
        ranked: list[tuple[int, float, Branch]] = []
        for branches in found.values():
            branches.sort(key=lambda one: one.value)
            near = [one for one in branches if one.value < min(branches[0].value + FAR_BEHIND, OUTSIDE)]
            ranked += [(rank, one.value, one) for rank, one in enumerate(near)]
        ranked.sort(key=lambda one: one[:2])
        return [branch for *_, branch in ranked[:MOST_STARTS]]

    def _go_on(self, branch: Branch, trials: int) -> None:
        """Search from where a branch is."""
        objective = self._objectives[branch.family]
        objective.origin = branch.start.origin
        effort = Effort(trials=trials, random=0, refinements=0, population=POPULATION)
        seed = int(self._random.integers(1, 2**31))
        value, unknowns = descend(objective, branch.start, effort, seed)
        if value < branch.value:
            branch.value, branch.unknowns = value, unknowns
        self._ends.append(replace(branch))  # it may go on


def _is_same(branch: Branch, best: Best) -> bool:
    """Return True if a search ended at the best."""
    return (
        branch.family == best.family
        and branch.value < best.value + SAME_VALUE
        and bool(np.abs(branch.unknowns - best.unknowns).max(initial=0) < SAME_UNKNOWNS)
    )


def families(stages: Sequence[int], *, quadratic: bool) -> list[Family]:
    """Return the families that are searched, both roles of each: those that leave coefficients free."""
    found = []
    for s in stages:
        for order, harmonic_order, needs_quadratic in CONDITIONS:
            for first in ("kick", "drift"):
                if needs_quadratic and not quadratic:
                    continue
                try:
                    family = Family(stages=s, first=first, order=order, harmonic_order=harmonic_order)
                except SettingError:
                    continue
                if family.unknowns > len(family.equations):
                    found.append(family)
    return found
