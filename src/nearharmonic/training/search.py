"""Search for members of a family by CMA-ES, from published methods, methods with one stage less, and random points.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; library: pycma, doi:10.5281/zenodo.2559634. All
budgets are numbers of trials, and all random numbers come from one seed: one seed always gives the same rows on the
same type of processor.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain
from typing import Any

import numpy as np

from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective

#: Number of members per generation.
POPULATION = 20
#: Initial standard deviations around a known method and around the result of a search, used in turn, and around random
#: points.
AROUND_KNOWN, AROUND_FOUND, AT_RANDOM = (0.01, 0.003), (0.003, 0.01, 0.03), 0.03
#: Number of random points, whose best one is a start. Their mean and their standard deviation are 1/s.
RANDOM_POINTS = 400
#: Tolerances of the objective and of the unknowns within which two searches have found the same member.
SAME_VALUE, SAME_UNKNOWNS = 0.02, 0.02
#: Changes of the objective and of the unknowns below which a search ends.
SMALL_VALUE, SMALL_STEP = 1e-4, 1e-8


@dataclass(frozen=True, kw_only=True)
class Start:
    """Start of a search: a point, or None for the best of random points, and the standard deviation around it."""

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

    def is_same(self, best: Found) -> bool:
        """Return True if two searches have found the same member."""
        near = self.family == best.family and self.value < best.value + SAME_VALUE
        return near and bool(np.abs(self.unknowns - best.unknowns).max(initial=0) < SAME_UNKNOWNS)


class Searcher:
    """Successive searches with one random generator, and their results."""

    def __init__(self, seed: int | Sequence[int]) -> None:
        self._random = np.random.default_rng(seed)
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
        return sum(one.is_same(self.best) for one in self.found)

    def search(self, objective: Objective, start: Start, trials: int) -> Found:
        """Search from a start with this number of ``trials``."""
        before, seed = objective.trials, int(self._random.integers(1, 2**31))
        value, unknowns = descend(objective, start, trials, seed)
        self.found.append(
            Found(
                family=objective.family, value=value, unknowns=unknowns, origin=start.origin,
                trials=objective.trials - before,
            )
        )  # fmt: skip
        return self.found[-1]

    def near(self, best: Found, turn: int, origin: str) -> Start:
        """Return a start near a member, at a distance that depends on ``turn``."""
        spread = spread_of(turn)
        point = best.unknowns + spread * self._random.normal(size=len(best.unknowns))
        return Start(origin=origin, point=point, spread=spread)


def spread_of(turn: int) -> float:
    """Return the standard deviation around a result, which depends on ``turn``."""
    return AROUND_FOUND[turn % len(AROUND_FOUND)]


def starts_of(family: Family, known: Sequence[Tableau], before: Sequence[Found], random: int) -> Iterator[Start]:
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
    random : int
        Number of random starts.
    """
    for one in known:
        if _has_shape(one, family):
            yield from (Start(origin=one.name, point=family.unknowns_of(one), spread=s) for s in AROUND_KNOWN)
    smaller = _a_stage_less(family)
    for one in known:
        if smaller and _has_shape(one, smaller):
            point = smaller.grown(smaller.unknowns_of(one))[1]
            yield Start(origin=f"{one.name}, grown", point=point, spread=AROUND_KNOWN[0])
    for found in before:
        if found.family == smaller:
            point = found.family.grown(found.unknowns)[1]
            yield from (Start(origin="grown", point=point, spread=s) for s in AROUND_FOUND)
    for _ in range(random):
        yield Start(origin="random", point=None, spread=AT_RANDOM)


def search(objective: Objective, starts: Iterator[Start], trials: int, refinements: int, seed: int) -> Searcher:
    """Search from all ``starts``, then several times around the best result, each time with a number of ``trials``."""
    searcher = Searcher(seed)
    refined = (searcher.near(searcher.best, turn, "refined") for turn in range(refinements) if searcher.found)
    for start in chain(starts, refined):
        searcher.search(objective, start, trials)
    return searcher


def descend(objective: Objective, start: Start, trials: int, seed: int) -> tuple[float, Floats]:
    """Return the smallest objective that CMA-ES finds from a start, and its member (n,)."""
    family, point = objective.family, start.point
    random = np.random.default_rng(seed)
    if point is None:
        stages, shape = family.stages, (RANDOM_POINTS, family.unknowns)
        points = random.normal(1 / stages, 1 / stages, shape)
        points[:, stages - 1 :] *= 1 / stages**2  # squares are coefficients of tau^3
        point = points[objective(points).argmin()]
    cma = library()
    options = {
        "verbose": -9, "maxfevals": trials, "popsize": POPULATION, "tolfun": SMALL_VALUE, "tolx": SMALL_STEP,
        "CMA_stds": _scales(family),
        # If cma gets a seed, it seeds the global generator of NumPy.
        "seed": np.nan, "randn": lambda *shape: random.standard_normal(shape),
    }  # fmt: skip
    strategy = cma.CMAEvolutionStrategy(point, start.spread, options)
    while not strategy.stop():
        points = strategy.ask()
        strategy.tell(points, objective(np.array(points)).tolist())
    best = np.array(strategy.result.xbest if strategy.result.xbest is not None else point)
    value = float(strategy.result.fbest)
    return value, family.project(best[None])[0][0] if value < OUTSIDE else best


def library() -> Any:
    """Import pycma, which takes a second.

    Raises
    ------
    NearharmonicError
        It is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings about optional packages
            import cma
    except ModuleNotFoundError as error:
        message = "a search for coefficients needs the package cma: pip install 'nearharmonic[tailor]'"
        raise NearharmonicError(message) from error
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
