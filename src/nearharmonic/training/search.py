"""The search for members of a family: CMA-ES from published methods, from methods of a stage less, and at random.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772; library: pycma, doi:10.5281/zenodo.2559634. All
budgets are numbers of trials, and all random numbers come from one seed: the same seed gives the same rows, on one kind
of processor.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import numpy as np

from nearharmonic.errors import NearharmonicError, SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective

#: First standard deviations of the search: around a known method, around what a search has found, at random.
AROUND_KNOWN, AROUND_FOUND, AT_RANDOM = (0.01, 0.003), (0.003, 0.01, 0.03), (0.03,)
#: Random points of which the best is a start; their mean and spread in units of 1/s.
RANDOM_POINTS, MEAN, SPREAD = 400, 1.0, 1.0
#: Restarts whose objective comes this near to the best have found the same, if their unknowns do too.
SAME_VALUE, SAME_UNKNOWNS = 0.02, 0.02
#: Change of the objective, and of the unknowns, at which an iteration ends.
SMALL_VALUE, SMALL_STEP = 1e-4, 1e-8


@dataclass(frozen=True, kw_only=True)
class Effort:
    """Search effort for one family.

    Attributes
    ----------
    trials : int
        Members tried from each start.
    random : int
        Random starts.
    refinements : int
        Searches around the best found so far.
    population : int
        Members tried at a time.
    """

    trials: int
    random: int
    refinements: int
    population: int = 20


@dataclass(frozen=True, kw_only=True)
class Start:
    """Start of a search: a point, or None for the best of random ones, and the standard deviation around it."""

    origin: str
    point: Floats | None
    spread: float


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of a search: the objective and the unknowns of the best, its origin, and the number of trials."""

    value: float
    unknowns: Floats
    origin: str
    trials: int


@dataclass
class Findings:
    """All that was found of one family, in the order of the search."""

    family: Family
    found: list[Found] = field(default_factory=list)

    @property
    def best(self) -> Found:
        """The one with the least objective."""
        return min(self.found, key=lambda one: one.value)

    @property
    def trials(self) -> int:
        """Members tried."""
        return sum(one.trials for one in self.found)

    @property
    def again(self) -> int:
        """Number of searches that ended at the best, itself included."""
        best = self.best
        return sum(
            one.value < best.value + SAME_VALUE
            and bool(np.abs(one.unknowns - best.unknowns).max(initial=0) < SAME_UNKNOWNS)
            for one in self.found
        )


def starts_of(family: Family, known: Sequence[Tableau], before: Sequence[Findings], effort: Effort) -> Iterator[Start]:
    """Yield where to search a family from: known methods, the best of a stage less, random points.

    Parameters
    ----------
    family : Family
        What is searched.
    known : sequence of Tableau
        Published methods; symmetric ones of the family's shape are starts, and grown ones of a stage less.
    before : sequence of Findings
        What was found of other families; that of a stage less is grown.
    effort : Effort
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
    for findings in before:
        if findings.family == smaller and findings.found:
            point = findings.family.grown(findings.best.unknowns)[1]
            yield from (Start(origin="grown", point=point, spread=s) for s in AROUND_FOUND)
    for i in range(effort.random):
        yield Start(origin="random", point=None, spread=AT_RANDOM[i % len(AT_RANDOM)])


def search(
    objective: Objective, starts: Iterator[Start], effort: Effort, seed: int, report: Callable[[Found], None] | None
) -> Findings:
    """Return what is found from all ``starts``, and around the best of them.

    Parameters
    ----------
    objective : Objective
        What is made small.
    starts : iterator of Start
        Where searches begin.
    effort : Effort
        Trials and refinements.
    seed : int
        Of all random numbers.
    report : callable, optional
        Is told of each search that has ended.
    """
    findings, random = Findings(objective.family), np.random.default_rng(seed)

    def one(start: Start) -> None:
        before = objective.trials
        value, unknowns = descend(objective, start, effort, int(random.integers(1, 2**31)))
        findings.found.append(
            Found(value=value, unknowns=unknowns, origin=start.origin, trials=objective.trials - before)
        )
        if report is not None:
            report(findings.found[-1])

    for start in starts:
        one(start)
    for i in range(effort.refinements if findings.found else 0):
        spread = AROUND_FOUND[i % len(AROUND_FOUND)]
        near = findings.best.unknowns + spread * random.normal(size=objective.family.unknowns)
        one(Start(origin="refined", point=near, spread=spread))
    return findings


def descend(objective: Objective, start: Start, effort: Effort, seed: int) -> tuple[float, Floats]:
    """Return the least objective that CMA-ES finds from a start, and the member (n,) that has it."""
    family, point = objective.family, start.point
    random = np.random.default_rng(seed)
    if point is None:
        points = random.normal(MEAN / family.stages, SPREAD / family.stages, (RANDOM_POINTS, family.unknowns))
        points[:, family.stages - 1 :] *= 1 / family.stages**2  # squares are coefficients of tau^3
        point = points[objective(points).argmin()]
    cma = library()
    options = {
        "verbose": -9, "maxfevals": effort.trials, "popsize": effort.population, "tolfun": SMALL_VALUE,
        "tolx": SMALL_STEP, "CMA_stds": _scales(family),
        # With its own seed, cma would seed the generator that all of NumPy shares.
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
    """Return pycma, which takes a second to load.

    Raises
    ------
    NearharmonicError
        It is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # optional packages that it looks for
            import cma
    except ModuleNotFoundError as error:
        message = "a search for coefficients needs the package cma: pip install 'nearharmonic[tailor]'"
        raise NearharmonicError(message) from error
    return cma


def _scales(family: Family) -> Floats:
    """By what a first standard deviation is multiplied: coefficients of squares are small."""
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
