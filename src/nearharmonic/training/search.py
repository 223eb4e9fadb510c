"""Search for members of a family, from published methods, methods with one stage less, and random points.

Descents are Gauss-Newton steps (:mod:`nearharmonic.training.gauss_newton`) or an evolution strategy: N. Hansen, The CMA
Evolution Strategy: A Tutorial, arXiv:1604.00772; library: pycma, doi:10.5281/zenodo.2559634. All budgets are numbers of
trials, and all random numbers come from one seed: one seed always gives the same rows on the same type of processor.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import Any, Literal

import numpy as np

from nearharmonic.errors import MissingPackageError, SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.gauss_newton import Descent
from nearharmonic.training.objective import OUTSIDE, Objective

#: Names of the ways from a start to a minimum.
DescentName = Literal["evolution", "gauss_newton"]


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Settings of searches.

    Attributes
    ----------
    trials : int
        Number of members tried from each start.
    random : int
        Number of random starts in each family.
    refinements : int
        Number of searches around the best member so far.
    descent : {"evolution", "gauss_newton"}
        Way from a start to a minimum.
    population : int
        Number of members per generation, and of those that an objective integrates at once.
    around_known, around_found, at_random : tuple of float
        Initial standard deviations around a known method, around the result of a search, and around random points; used
        in turn.
    random_points, mean, spread : int and float
        Number of random points, whose best one is a start, and their mean and standard deviation in units of 1/s.
    screened : int
        Inverse of the fraction of the problems on which a start is tried first; 1 to omit this.
    behind : float
        Largest distance to the best start so far at which a screened start continues with all problems.
    bases : int
        Number of best members that take turns as centres of refinements.
    same_value, same_unknowns : float
        Tolerances of the objective and of the unknowns within which two searches have found the same member.
    small_value, small_step : float
        Changes of the objective and of the unknowns below which a search ends.
    """

    trials: int
    random: int = 0
    refinements: int = 0
    descent: DescentName = "evolution"
    population: int = 20
    around_known: tuple[float, ...] = (0.01, 0.003)
    around_found: tuple[float, ...] = (0.003, 0.01, 0.03)
    at_random: tuple[float, ...] = (0.03,)
    random_points: int = 400
    mean: float = 1.0
    spread: float = 1.0
    screened: int = 1
    behind: float = 0.5
    bases: int = 1
    same_value: float = 0.02
    same_unknowns: float = 0.02
    small_value: float = 1e-4
    small_step: float = 1e-8

    def same(self, one: Found, best: Found) -> bool:
        """Return True if two searches have found the same member."""
        near = one.family == best.family and one.value < best.value + self.same_value
        return near and bool(np.abs(one.unknowns - best.unknowns).max(initial=0) < self.same_unknowns)


@dataclass(frozen=True, kw_only=True)
class Start:
    """Start of a search: a point, or None for the best of random points, and the standard deviation around it.

    An evolution begins with points around it, and a Gauss-Newton descent at one such point.
    """

    origin: str
    point: Floats | None
    spread: float


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of a search: the objective and the unknowns of the best, its origin, and the number of trials."""

    family: Family
    value: float
    unknowns: Floats
    origin: str
    trials: int


class Searcher:
    """Successive searches with one random generator, and their results.

    Parameters
    ----------
    effort : Effort
        Settings of each search.
    seed : int or sequence of int
        Of all random numbers.
    """

    def __init__(self, effort: Effort, seed: int | Sequence[int]) -> None:
        self.effort, self._random = effort, np.random.default_rng(seed)
        self.found: list[Found] = []

    @property
    def best(self) -> Found:
        """The result with the smallest objective."""
        return min(self.found, key=lambda one: one.value)

    @property
    def trials(self) -> int:
        """Members tried."""
        return sum(one.trials for one in self.found)

    @property
    def again(self) -> int:
        """Number of searches that ended at the best member."""
        return sum(self.effort.same(one, self.best) for one in self.found)

    def centre(self, turn: int) -> Found:
        """Return a result around which a search begins: one of the best different ones, in turns."""
        different: list[Found] = []
        for one in sorted(self.found, key=lambda one: one.value):
            if not any(self.effort.same(one, other) for other in different):
                different.append(one)
            if len(different) == self.effort.bases:
                break
        return different[turn % len(different)]

    def search(self, objective: Objective, start: Start, trials: int | None = None) -> Found:
        """Search from a start, with this number of ``trials`` or that of the settings."""
        before, seed = objective.trials, int(self._random.integers(1, 2**31))
        effort = self.effort if trials is None else replace(self.effort, trials=trials)
        value, unknowns = descend(objective, start, effort, seed)
        self.found.append(
            Found(
                family=objective.family, value=value, unknowns=unknowns, origin=start.origin,
                trials=objective.trials - before,
            )
        )  # fmt: skip
        return self.found[-1]

    def near(self, best: Found, turn: int, origin: str) -> Start:
        """Return a start near a member, at a distance that depends on ``turn``."""
        spread = self.spread(turn)
        if self.effort.descent == "gauss_newton":
            return Start(origin=origin, point=best.unknowns, spread=spread)
        point = best.unknowns + spread * self._random.normal(size=len(best.unknowns))
        return Start(origin=origin, point=point, spread=spread)

    def spread(self, turn: int) -> float:
        """Return the standard deviation around a result, which depends on ``turn``."""
        return self.effort.around_found[turn % len(self.effort.around_found)]


def starts_of(family: Family, known: Sequence[Tableau], before: Sequence[Found], effort: Effort) -> Iterator[Start]:
    """Yield the starts in a family: known methods, the best method with one stage less, random points.

    Parameters
    ----------
    family : Family
        Family that is searched.
    known : sequence of Tableau
        Published methods: symmetric methods of the shape of the family are starts, and so are extended methods with one
        stage less.
    before : sequence of Found
        The best members of other families; that with one stage less is extended by a stage.
    effort : Effort
        Number of random starts, and standard deviations.
    """
    for one in known:
        if _has_shape(one, family):
            yield from (Start(origin=one.name, point=family.unknowns_of(one), spread=s) for s in effort.around_known)
    smaller = _a_stage_less(family)
    for one in known:
        if smaller and _has_shape(one, smaller):
            point = smaller.grown(smaller.unknowns_of(one))[1]
            yield Start(origin=f"{one.name}, grown", point=point, spread=effort.around_known[0])
    for found in before:
        if found.family == smaller:
            point = found.family.grown(found.unknowns)[1]
            yield from (Start(origin="grown", point=point, spread=s) for s in effort.around_found)
    for i in range(effort.random):
        yield Start(origin="random", point=None, spread=effort.at_random[i % len(effort.at_random)])


def search(
    objective: Objective, starts: Iterator[Start], effort: Effort, seed: int, report: Callable[[Found], None] | None
) -> Searcher:
    """Search from all ``starts``, and then around the best result.

    Parameters
    ----------
    objective : Objective
        Objective that is minimised.
    starts : iterator of Start
        Starts of the searches.
    effort : Effort
        Numbers of trials and refinements.
    seed : int
        Of all random numbers.
    report : callable, optional
        Function that is called after each search.
    """
    searcher, screen = Searcher(effort, seed), _Screen(objective, effort, np.random.default_rng([seed, 1]))
    refined = (
        searcher.near(searcher.centre(turn), turn, "refined") for turn in range(effort.refinements) if searcher.found
    )
    for start in chain(starts, refined):
        promising = screen(start) if effort.screened > 1 else start
        if promising is not None:
            found = searcher.search(objective, promising)
            if report is not None:
                report(found)
    return searcher


class _Screen:
    """Short descents from starts on a part of the problems, of which the better ones continue."""

    def __init__(self, objective: Objective, effort: Effort, random: np.random.Generator) -> None:
        self._objective, self._random = objective, random
        self._effort = replace(effort, trials=-(-effort.trials // effort.screened))
        self._part, self._share, self._best = objective.part(effort.screened), effort.screened, OUTSIDE

    def __call__(self, start: Start) -> Start | None:
        """Return the end of a descent as a start, or None if it is too far behind the best one."""
        before = self._part.trials
        value, unknowns = descend(self._part, start, self._effort, int(self._random.integers(1, 2**31)))
        # A trial is the integration of all problems.
        self._objective.trials += -(-(self._part.trials - before) // self._share)
        self._best = min(self._best, value)
        if value > self._best + self._effort.behind:
            return None
        again = 0.0 if self._effort.descent == "gauss_newton" else start.spread
        return replace(start, point=unknowns, spread=again)


def descend(objective: Objective, start: Start, effort: Effort, seed: int) -> tuple[float, Floats]:
    """Return the smallest objective that a descent from a start finds, and its member (n,)."""
    family, point = objective.family, start.point
    random = np.random.default_rng(seed)
    if point is None:
        stages, shape = family.stages, (effort.random_points, family.unknowns)
        points = random.normal(effort.mean / stages, effort.spread / stages, shape)
        points[:, stages - 1 :] *= 1 / stages**2  # squares are coefficients of tau^3
        point = points[objective(points).argmin()]
    if effort.descent == "gauss_newton":
        if start.point is not None:
            point = point + start.spread * random.standard_normal(len(point))
        point = Descent(objective).minimise(point, effort.trials, effort.small_value)
        value = float(objective(point[None])[0])
    else:
        value, point = _evolution(objective, point, start.spread, effort, random)
    return value, family.project(point[None])[0][0] if value < OUTSIDE else point


def _evolution(
    objective: Objective, point: Floats, spread: float, effort: Effort, random: np.random.Generator
) -> tuple[float, Floats]:
    """Return the best value and point of CMA-ES around a point."""
    options = {
        "verbose": -9, "maxfevals": effort.trials, "popsize": effort.population, "tolfun": effort.small_value,
        "tolx": effort.small_step, "CMA_stds": _scales(objective.family),
        # If cma gets a seed, it seeds the global generator of NumPy.
        "seed": np.nan, "randn": lambda *shape: random.standard_normal(shape),
    }  # fmt: skip
    strategy = library().CMAEvolutionStrategy(point, spread, options)
    while not strategy.stop():
        points = strategy.ask()
        strategy.tell(points, objective(np.array(points)).tolist())
    best = strategy.result.xbest
    return float(strategy.result.fbest), np.array(point if best is None else best)


def library() -> Any:
    """Import pycma, which takes a second.

    Raises
    ------
    MissingPackageError
        It is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings about optional packages
            import cma
    except ModuleNotFoundError as error:
        raise MissingPackageError("a search for coefficients", "cma", "tailor") from error
    return cma


def _scales(family: Family) -> Floats:
    """Return factors of the initial standard deviation: coefficients of squares are small."""
    scales = np.ones(family.unknowns)
    scales[family.stages - 1 :] = 1 / family.stages
    return scales


def _has_shape(method: Tableau, family: Family) -> bool:
    """Return True if a method has the stages and the role of a family, and no squares but those of the family."""
    squares = {i for i, m in enumerate(getattr(method, "square", ())) if Fraction(m) and 2 * i < len(method.kick)}
    return (
        method.symmetric
        and (method.first, method.stages) == (family.first, family.stages)
        and squares <= set(family.squares)
    )


def _a_stage_less(family: Family) -> Family | None:
    try:
        return replace(family, stages=family.stages - 1)
    except SettingError:
        return None
