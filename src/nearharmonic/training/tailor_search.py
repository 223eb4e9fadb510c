"""Search for a tailored method within a budget, and the registered methods that it is compared with."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, log, sqrt
from typing import Any, NoReturn

import numpy as np

from nearharmonic.engine.settings import misfit
from nearharmonic.errors import NearharmonicError, SettingError, bad_setting
from nearharmonic.integrators import integrators
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective, mean_errors
from nearharmonic.training.population import LEAST, LOST, Ensemble
from nearharmonic.training.search import Effort, Found, Start, library
from nearharmonic.training.searcher import Searcher, starts_of


# --- Budget of a search, in time or in trials.
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
        """Count trials."""
        self.trials += trials
        parts = [(self.seconds, self._seconds), (self.trials, self._most)]
        spent = max(used / allowed for used, allowed in parts if allowed is not None)
        if self._show is not None:
            self._show(min(spent, 1.0), best)
        if spent >= 1:
            raise BudgetSpentError("the budget of the search is spent")


# --- Search for a tailored method: many short searches, whose best third continues, until a budget is spent.
#
# Starts in every family are registered methods, and methods with one stage less that are extended by a stage. Starts
# far behind the best are omitted. All starts get the same number of trials. The best third continues with three times
# as many trials, and so on. Searches around the last one then alternate with searches from random starts until time
# or trials are spent.

#: Orders of families: (order, harmonic order, True if T has to be quadratic).
CONDITIONS = ((4, 4, False), (4, 6, False), (6, 6, True))


@dataclass(frozen=True, kw_only=True)
class Rounds(Effort):
    """Settings of the search; ``trials`` are those of the first round from each start.

    Attributes
    ----------
    most_starts : int
        Maximum number of starts of the first round.
    far_behind : float
        A start is omitted if its objective exceeds that of the best start with the same stages by more than this.
    third : int
        Inverse of the fraction of searches that continue, and factor of their number of trials.
    around_best, from_random : int
        Trials of a search around the best, and of a search from a random start, after the rounds.
    """

    trials: int = 200
    most_starts: int = 24
    far_behind: float = 3.0
    third: int = 3
    around_best: int = 3000
    from_random: int = 1500


@dataclass(frozen=True, kw_only=True)
class Best(Found):
    """The best member of all families so far, with trials and ``seconds`` at the last significant improvement.

    ``advanced`` is the objective after this improvement.
    """

    advanced: float = OUTSIDE
    seconds: float = 0.0


@dataclass
class Branch:
    """A start in a family, and the best result of its searches."""

    start: Start
    best: Found


@dataclass(frozen=True, kw_only=True)
class SearchResult:
    """Result of a search: the best member, and numbers of members tried, of searches, and of those that ended there.

    ``stopped`` is the reason of the end, "spent" or "Ctrl-C".
    """

    best: Best
    trials: int
    searches: int
    again: int
    seconds: float
    stopped: str


class _Watched(Objective):
    """An objective that stores the best member at every call, so that a search can be stopped at any time."""

    def __init__(self, search: TailorSearch, family: Family, *others: Any, **more: Any) -> None:
        super().__init__(family, *others, **more)
        self._search, self.origin = search, ""

    def __call__(self, points: Floats) -> Floats:
        values, search = super().__call__(points), self._search
        i = int(values.argmin())
        if values[i] < search.value:
            search.best = self._better(float(values[i]), points[i : i + 1], len(points))
        search.budget.spend(len(points), search.value)
        return values

    def _better(self, value: float, point: Floats, trials: int) -> Best:
        before, budget, unknowns = self._search.best, self._search.budget, self.family.project(point)[0][0]
        when = (OUTSIDE, 0, 0.0) if before is None else (before.advanced, before.trials, before.seconds)
        if value < when[0] - self._search.rounds.same_value:
            when = value, budget.trials + trials, budget.seconds
        return Best(
            value=value, family=self.family, unknowns=unknowns, origin=self.origin,
            advanced=when[0], trials=when[1], seconds=when[2],
        )  # fmt: skip


class TailorSearch:
    """Search for a tailored method with one of the numbers of ``stages``, from ``known`` methods.

    The step sizes (T,) are over the cost of a step; the reference (T,) is the mean of log10 max |dH| of the best
    registered methods. ``best`` is replaced as a whole, because Ctrl-C may come at any time.
    """

    def __init__(
        self, ensemble: Ensemble, tau_per_stage: Floats, reference: Floats, known: Sequence[Tableau], *,
        stages: Sequence[int], quadratic: bool, budget: Budget, seed: int, rounds: Rounds = Rounds(),
    ) -> None:  # fmt: skip
        self._known, self.budget, self.rounds = known, budget, rounds
        self.best: Best | None = None
        self._searcher = Searcher(rounds, [seed, 2])
        #: The best of its branch after each search.
        self._ends: list[Found] = []
        self._objectives = {
            family: _Watched(self, family, [ensemble], tau_per_stage, [reference], size=rounds.population)
            for family in families(stages, quadratic=quadratic)
        }

    @property
    def value(self) -> float:
        """Objective of the best member."""
        return OUTSIDE if self.best is None else self.best.value

    def run(self) -> SearchResult:
        """Search until the budget is spent or Ctrl-C is pressed, and return the result."""
        try:
            self._search()
        except BudgetSpentError:
            stopped = "spent"
        except KeyboardInterrupt:
            if self.best is None:
                raise
            stopped = "Ctrl-C"
        best = self.best
        assert best is not None  # registered methods are among the starts
        again = sum(self.rounds.same(one, best) for one in self._ends)
        return SearchResult(
            best=best, trials=self.budget.trials, searches=len(self._ends), again=again,
            seconds=self.budget.seconds, stopped=stopped,
        )  # fmt: skip

    def _search(self) -> NoReturn:
        """Search until :class:`BudgetSpentError` is raised."""
        branches, trials, turn, third = self._branches(), self.rounds.trials, 0, self.rounds.third
        while len(branches) > 1:
            for branch in branches:
                self._go_on(branch, trials)
            branches = sorted(branches, key=lambda one: one.best.value)[: -(-len(branches) // third)]
            trials, turn = third * trials, turn + 1
            for branch in branches:
                branch.start = replace(branch.start, point=branch.best.unknowns, spread=self._searcher.spread(turn))
        everywhere = list(self._objectives)
        while True:
            turn += 1
            assert self.best is not None
            best = self.best
            start = self._searcher.near(best, turn, best.origin)
            self._go_on(_branch(best.family, start), self.rounds.around_best)
            start = Start(origin="random", point=None, spread=self.rounds.at_random[0])
            self._go_on(_branch(everywhere[turn % len(everywhere)], start), self.rounds.from_random)

    def _branches(self) -> list[Branch]:
        """Return the better known methods, alternating between the numbers of stages: first the best of each number."""
        found: dict[int, list[Branch]] = {}
        for family, objective in self._objectives.items():
            starts = {start.origin: start for start in starts_of(family, self._known, [], self.rounds)}
            if starts:
                objective.origin = "a registered method"
                points = np.array([start.point for start in starts.values()])
                parts = zip(starts.values(), objective(points).tolist(), strict=True)
                found.setdefault(family.stages, []).extend(_branch(family, *part) for part in parts)
        ranked: list[tuple[int, float, Branch]] = []
        for branches in found.values():
            branches.sort(key=lambda one: one.best.value)
            farthest = min(branches[0].best.value + self.rounds.far_behind, OUTSIDE)
            near = [one for one in branches if one.best.value < farthest]
            ranked += [(rank, one.best.value, one) for rank, one in enumerate(near)]
        ranked.sort(key=lambda one: one[:2])
        return [branch for *_, branch in ranked[: self.rounds.most_starts]]

    def _go_on(self, branch: Branch, trials: int) -> None:
        """Continue the search of a branch."""
        objective = self._objectives[branch.best.family]
        objective.origin = branch.start.origin
        branch.best = min(
            branch.best, self._searcher.search(objective, branch.start, trials), key=lambda one: one.value
        )
        self._ends.append(branch.best)


def _branch(family: Family, start: Start, value: float = OUTSIDE) -> Branch:
    """Return a branch without searches."""
    point = np.zeros(family.unknowns) if start.point is None else start.point
    return Branch(start, Found(family=family, value=value, unknowns=point, origin=start.origin, trials=0))


def families(stages: Sequence[int], *, quadratic: bool) -> list[Family]:
    """Return the families that are searched, in both roles: families with free coefficients."""
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


# --- Registered methods for comparison with a tailored one, and the window of step sizes.

#: Step sizes per stage, in radians of the fastest oscillation, for the search for a window.
LADDER = np.geomspace(0.01, 1.0, 25)
#: Number of problems in the search for a window.
PROBLEMS = 8
#: Ratio of the largest to the smallest step size of a window that is found.
WIDTH = 1.5
#: Range of rounding errors, in decades above the smallest distinguished error.
ROUNDING = 2.0
#: Decades: a method that is less than this behind the best on the starts of the search may be the best on the starts of
#: the test.
BEHIND = 1.0
#: Assumed cost of the gradient of the square of grad V, in forces, for comparisons at equal cost. Measured costs are
#: below or slightly above it, see docs/reference/methods.md.
CHARGE = 1.0
#: Largest ratio of neighbouring step sizes in a window, and minimum number of step sizes.
RATIO, FEWEST = 1.26, 3


def registered(system: System) -> list[Tableau]:
    """Return the registered splitting methods that fit a system, except processed ones.

    The energy of a processed method is not measured at every step.
    """
    found = [integrators[name] for name in integrators.registered]
    return [one for one in found if not (one.processed or one.implicit or misfit(system, one)[0])]


def step_sizes(window: tuple[float, float], *, between: bool = False) -> Floats:
    """Return step sizes per stage (T,) that cover a window, with intermediate ones if ``between`` is set."""
    count = max(FEWEST, ceil(log(window[1] / window[0]) / log(RATIO)) + 1)
    found: Floats = np.geomspace(*window, 2 * count - 1 if between else count)
    return found


def window_at(ensemble: Ensemble, methods: list[Tableau], error: float, frequency: float) -> tuple[float, float]:
    """Return the window in whose middle the best of some methods has a given error.

    The error is the geometric mean of max |dH| over the problems, relative to the energy; ``frequency`` is the angular
    frequency of the fastest oscillation.
    """
    ladder, few = LADDER / frequency, ensemble.part(slice(PROBLEMS))
    best = np.minimum.accumulate(mean_errors(few, methods, ladder.tolist(), CHARGE).min(axis=0)[::-1])[::-1]
    wanted, lowest, highest = np.log10(error), best[0], best[-1]
    if not lowest < wanted < highest:
        what = (
            f"between {10**lowest:.2g} and {10**highest:.2g}, the errors of the best registered methods at step sizes "
            f"per stage from {ladder[0]:.3g} to {ladder[-1]:.3g}; or give a window"
        )
        raise bad_setting("error", error, what)
    place = int(np.argmax(best > wanted))
    part = (wanted - best[place - 1]) / (best[place] - best[place - 1])
    middle = float(np.exp((1 - part) * np.log(ladder[place - 1]) + part * np.log(ladder[place])))
    low, high = (float(f"{x:.3g}") for x in (middle / sqrt(WIDTH), middle * sqrt(WIDTH)))
    return low, high


def contenders(errors: Mapping[Tableau, Floats]) -> list[Tableau]:
    """Return the methods that are near the best at some step size, by their mean log10 errors (T,)."""
    best = np.min([*errors.values()], axis=0)
    return [one for one, error in errors.items() if (error < best + BEHIND).any()]


def check_window(best: Floats, window: tuple[float, float], unit: str) -> None:
    """Raise an error for a window in which no gain is possible.

    ``best`` (T,) is the mean of log10 max |dH| of the best registered method at each step size of the window; ``unit``
    is the unit of time.
    """
    shown = f"{window[0]:g}:{window[1]:g}"
    time = "" if unit == "1" else f" {unit}"
    if best[-1] >= np.log10(LOST):
        what = f"every registered method loses the energy at {window[1]:g}{time} per stage: take smaller step sizes"
        raise bad_setting("window", shown, what)
    if best[-1] < np.log10(LEAST) + ROUNDING:
        what = f"registered methods err by rounding alone up to {window[1]:g}{time} per stage: take larger step sizes"
        raise bad_setting("window", shown, what)
