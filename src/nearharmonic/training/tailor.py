"""Tailored methods: the search within a budget, gains on starts of the test, and provenance."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt
from textwrap import fill, wrap
from typing import Any, NoReturn

import numpy as np

from nearharmonic.engine.numbers import standard_parameters
from nearharmonic.errors import NearharmonicError, SettingError, warn_caller
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau
from nearharmonic.numerics.portable import Floats
from nearharmonic.systems.system import System
from nearharmonic.theory.order import harmonic_order
from nearharmonic.theory.oscillator import stability_limit
from nearharmonic.training import question as asking
from nearharmonic.training.family import Family, palindrome_lines, published
from nearharmonic.training.objective import (
    LEAST,
    OUTSIDE,
    Ensemble,
    Objective,
    errors_of,
    mean_errors,
    tableau_of,
)
from nearharmonic.training.question import question
from nearharmonic.training.search import Effort, Found, Searcher, Start, library, starts_in


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
    """Settings of the search; ``trials`` is their number in the first round from each start.

    Attributes
    ----------
    most_starts : int
        Maximum number of starts of the first round.
    far_behind : float
        A start is omitted if its objective exceeds the best start's, with the same stages, by more than this.
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
            starts = {start.origin: start for start in starts_in(family, self._known, [], self.rounds)}
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
        for order, of_oscillator, needs_quadratic in CONDITIONS:
            for first in ("kick", "drift"):
                if needs_quadratic and not quadratic:
                    continue
                try:
                    family = Family(stages=s, first=first, order=order, harmonic_order=of_oscillator)
                except SettingError:
                    continue
                if family.unknowns > len(family.equations):
                    found.append(family)
    return found


# --- Gain of a tailored method on starts of the test, with a confidence interval.

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

    ``error`` and ``best_error`` (T,) are geometric means over the starts of max |dH| of the method and of the best
    other method. ``best`` has the names of the latter; ``overall`` has the smallest mean over all step sizes. ``gain``
    is the mean gain over all step sizes.
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

    The gradient of the square of grad V, which some methods need, costs :data:`nearharmonic.training.question.CHARGE`.
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
    errors = np.stack([errors_of(ensemble, one, tau_per_stage.tolist(), asking.CHARGE) for one in methods])
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

    ``window`` has the smallest and largest step size per stage, in the unit of time of the system. ``ensemble`` has
    starts for the search, ``held_out`` starts for the test, with longer runs. ``test`` and ``training`` are comparisons
    with the best registered methods, on the starts of the test and of the search; ``published`` is one with the best
    methods of other authors, on the starts of the test.
    """

    question: asking.TailorRequest
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
        tau = float(f"{middle * (best.stages + asking.CHARGE * best.gradients):.3g}")
        return f"nh.integrate({self.question.given}, {best.name!r}, {tau:g})"

    @cached_property
    def losing(self) -> tuple[tuple[float, Gain], ...]:
        """Step sizes of the test at which the interval of the gain is not above 0, with the gain."""
        pairs = zip(self.test.tau_per_stage.tolist(), self.test.gains, strict=True)
        return tuple((tau, gain) for tau, gain in pairs if not gain.is_one)


# --- Provenance of a tailored method, in the fields of its tableau and as a Python file.

#: Width of the lines of a file, except for coefficients, which are not wrapped.
WIDTH = 100


def source_of(found: Tailored) -> str:
    """Return a description of the search that is sufficient to repeat it."""
    from nearharmonic import __version__

    asked, search = found.question, found.search
    drawn = "given" if asked.starts is not None else "drawn"
    return (
        f"nearharmonic {__version__}, tailor: {asked.system.name}, {window_text(found)} per stage, seed {asked.seed}, "
        f"{search.trials} trials from {drawn} starts, the best from {search.best.origin}"
    )


def note_of(found: Tailored) -> str:
    """Return the purpose of the method and its gain."""
    test = found.test
    others = ", ".join(dict.fromkeys(test.best))
    return (
        f"for {found.question.system.label} alone: step sizes per stage of {window_text(found)}, where max |dH| on "
        f"{found.held_out.size} starts that were not used is {test.gain} decades smaller than with the best registered "
        f"methods, {others}, at equal cost"
    )


def window_text(found: Tailored) -> str:
    """Return the window with its unit, as text."""
    unit = found.question.system.units["t"]
    return f"{found.window[0]:g} to {found.window[1]:g}{'' if unit == '1' else f' {unit}'}"


def file_text(tableau: Tableau, name: str) -> str:
    """Return a Python file that defines the method as TABLEAU, with this ``name``."""
    kind = "quadratic T" if tableau.requires else "every separable H"
    paragraphs = [
        f"Order {tableau.order} for {kind}, proved; harmonic order {tableau.harmonic_order}, stability limit of the "
        f"oscillator {float(stability_limit(tableau)):.4g}; {tableau.stages} stages, {tableau.first} first.",
        f"Made {tableau.note}.",
    ]
    title = f'"""{_plain(tableau.label)}: a symplectic method made for one system.'
    head = "\n\n".join([title, *map(_filled, paragraphs)])
    fields = {
        "name": name,
        "label": tableau.label,
        "order": tableau.order,
        "harmonic_order": tableau.harmonic_order,
        "first": tableau.first,
    }
    if tableau.requires == QUADRATIC_KINETIC_ENERGY:
        fields["requires"] = tableau.requires
    lines = [f"    {key}={_literal(value)}," for key, value in fields.items()]
    for key in ("kick", "drift"):
        lines += palindrome_lines(key, getattr(tableau, key), "    ")
    lines += [f"    {key}={_literal(getattr(tableau, key))}," for key in ("digits", "source", "note")]
    body = "\n".join(["TABLEAU = Tableau(", *lines, ")"])
    return f'{head}\n"""\n\nfrom nearharmonic import Tableau, palindrome\n\n{body}\n'


def _filled(text: str) -> str:
    return fill(_plain(text), WIDTH, break_long_words=False, break_on_hyphens=False)


def _plain(text: str) -> str:
    """Return a text that is valid in a docstring."""
    return text.replace("\\", "/").replace('"""', "'''")


def _literal(value: object) -> str:
    """Return the Python literal of a number or a text; a long text is wrapped in brackets."""
    if not isinstance(value, str) or len(value) <= WIDTH:
        return repr(value) if not isinstance(value, str) else _quoted(value)
    lines = wrap(value, WIDTH, drop_whitespace=False, break_long_words=False, break_on_hyphens=False)
    return "\n".join(["(", *(f"        {_quoted(line)}" for line in lines), "    )"])


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)  # Python reads the same text from them


# --- ``nearharmonic.tailor``: starts, window, search, digits and test of a method for one system, in this order.

Starts = Callable[[asking.TailorRequest, asking.Orbit], tuple[Ensemble, Ensemble]]

#: Ratio of the lengths of runs of the test and of the search.
LONGER = 4.0
#: Minimum number of steps per run, and maximum numbers of evaluations per run of the search and of the test.
FEWEST_STEPS, MOST_EVALUATIONS, MOST_IN_TEST = 24, 1600, 16000


class NoGainWarning(UserWarning):
    """A search found no method better than the registered ones."""


def tailor(
    system: str | os.PathLike[str] | System,
    *,
    stages: int | tuple[int, int] | str = 8,
    window: tuple[float, float] | str | None = None,
    error: float | str | None = None,
    seconds: float | None = None,
    trials: int | None = None,
    starts: Floats | str | os.PathLike[str] | None = None,
    energy: float | str | None = None,
    seed: int = 0,
) -> Tableau:
    """Make a symplectic method of order four for one system, and test it on other starts.

    The coefficients minimise the energy error. :func:`nearharmonic.integrate` and all other functions accept the
    returned method; its ``note`` describes the purpose and the gain.

    Parameters
    ----------
    system : str, path or System
        System, its name, or the path of a Python file that defines SYSTEM.
    stages : int, pair of int or str
        Number of stages of the method, 4 to 20; a pair, or "6:10", for the best in a range.
    window : pair of float or str, optional
        Smallest and largest step size over stages, in the unit of time of the system; their ratio is 1.2 to 10.
    error : float or str, optional
        Instead of a window: the energy error of the best registered method in its middle, by default 1e-6.
    seconds : float, optional
        Time of the search, by default 30.
    trials : int, optional
        Number of methods in the search. Without ``seconds`` it is the only budget, and equal seeds give equal methods.
    starts : (R, 2 d) array of float or path, optional
        Starts in place of drawn ones, at least eight: positions and then momenta, or a CSV file with such lines.
    energy : float or str, optional
        Energy of all drawn starts; "same" for the energy of the given one. By default starts are drawn in a box around
        the orbit of the given one.
    seed : int
        Of all random numbers.

    Returns
    -------
    Tableau
        The method, or the best registered method if the new method is not better on the starts of the test.

    Raises
    ------
    NearharmonicError
        An unknown name or an invalid setting, before any search.
    KeyboardInterrupt
        Ctrl-C before or after the search. Ctrl-C during the search ends it, and the best method so far is tested and
        returned.

    Warns
    -----
    NoGainWarning
        The returned method is a registered one.

    Examples
    --------
    >>> import nearharmonic as nh
    >>> method = nh.tailor("henon_heiles", stages=8, window=(0.1, 0.15), trials=1000)
    >>> method.name, method.order
    ('tailored_henon_heiles_8', 4)
    """
    asked = question(
        system, stages=stages, window=window, error=error, seconds=seconds, trials=trials, starts=starts,
        energy=energy, seed=seed,
    )  # fmt: skip
    found = tailored(asked)
    if found.has_gain:
        return found.tableau
    best = found.test.overall
    message = (
        f"no gain over registered methods on starts that were not used: {found.test.gain} decades; this is {best.name}"
    )
    warn_caller(message, NoGainWarning)
    return best


def tailored(
    asked: asking.TailorRequest, show: Callable[[float, float], None] | None = None, starts: Starts | None = None
) -> Tailored:
    """Return the tailored method and its test.

    ``show`` is called with the spent fraction of the budget and the smallest objective. ``starts`` returns the starts
    of the search and of the test in place of :func:`ensembles`.
    """
    subject, methods = asked.system, asking.registered(asked.system)
    orbit = asking.orbit_of(subject)
    ensemble, held_out = (starts or ensembles)(asked, orbit)
    window = asked.window or asking.window_at(ensemble, methods, asked.error, orbit.frequency)
    ensemble = _fitted(ensemble, window, asked, MOST_EVALUATIONS)
    held_out = _fitted(held_out, window, asked, MOST_IN_TEST)
    taus = asking.step_sizes(window)
    errors = mean_errors(ensemble, methods, taus.tolist(), asking.CHARGE)
    asking.check_window(errors.min(axis=0), window, subject.units["t"])
    budget = Budget(asked.seconds, asked.trials, show)
    search = TailorSearch(
        ensemble, taus, errors.min(axis=0), [one for one in methods if not one.modified], stages=asked.stages,
        quadratic=subject.quadratic_kinetic_energy, budget=budget, seed=asked.seed,
    ).run()  # fmt: skip
    return tested(asked, window, (ensemble, held_out), search, dict(zip(methods, errors, strict=True)))


def ensembles(asked: asking.TailorRequest, orbit: asking.Orbit) -> tuple[Ensemble, Ensemble]:
    """Return the starts of the search, for runs of twelve periods, and of the test, for runs four times as long."""
    subject = asked.system
    t_end = asking.RADIANS / orbit.frequency
    step = min(asking.STEP / orbit.frequency, np.inf if asked.window is None else asked.window[0])
    rows = asking.starts_of(asked, orbit, LONGER * t_end, step)
    first, second = (
        Ensemble(
            name=name, system=subject, start=row, parameters=standard_parameters(subject)[None, :], t_end=end,
            scale=asked.scale,
        )
        for name, row, end in zip(("search", "test"), rows, (t_end, LONGER * t_end), strict=True)
    )  # fmt: skip
    return first, second


def _fitted(ensemble: Ensemble, window: tuple[float, float], asked: asking.TailorRequest, most: int) -> Ensemble:
    """Adapt the length of the runs: enough steps at the upper end of the window, and not too many at the lower end."""
    least, highest = FEWEST_STEPS * max(asked.stages) * window[1], most * window[0]
    t_end = float(np.clip(ensemble.t_end, least, max(highest, least)))
    return replace(ensemble, t_end=float(f"{t_end:.3g}"))


def tested(
    asked: asking.TailorRequest, window: tuple[float, float], ensembles: tuple[Ensemble, Ensemble],
    search: SearchResult, errors: Mapping[Tableau, Floats],
) -> Tailored:  # fmt: skip
    """Return the result of a search as a tableau, compared with methods of known ``errors`` (T,)."""
    (ensemble, held_out), best, taus = ensembles, search.best, asking.step_sizes(window, between=True)
    stages, label = best.family.stages, asked.system.label
    name = f"tailored_{asked.system.name}_{stages}"
    tableau = tableau_of(best.family, best.unknowns.tolist(), name=name, label=f"{label}, {stages} stages", source="-")
    others = asking.contenders(errors)
    of_others = asking.contenders({one: errors[one] for one in published(errors)})
    found = Tailored(
        question=asked, window=window, ensemble=ensemble, held_out=held_out, tableau=tableau, search=search,
        test=comparison(tableau, others, held_out, taus, asked.seed),
        training=comparison(tableau, others, ensemble, taus, asked.seed),
        published=comparison(tableau, of_others, held_out, taus, asked.seed),
    )  # fmt: skip
    tableau = replace(tableau, harmonic_order=harmonic_order(tableau), source=source_of(found), note=note_of(found))
    return replace(found, tableau=tableau)
