"""Searches for members of a family, from published methods, methods with one stage less, and random points.

All budgets are numbers of trials, and all random numbers come from one seed: one seed always gives the same rows on the
same type of processor.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain

import numpy as np

from nearharmonic.errors import SettingError
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.training.family import Family
from nearharmonic.training.objective import OUTSIDE, Objective
from nearharmonic.training.search import Effort, Found, Start, descend, random_members


class Searcher:
    """Successive searches with the settings ``effort`` and one random generator, and their results."""

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
        if self.effort.descent != "evolution":
            return Start(origin=origin, point=best.unknowns, spread=spread)
        point = best.unknowns + spread * self._random.normal(size=len(best.unknowns))
        return Start(origin=origin, point=point, spread=spread)

    def spread(self, turn: int) -> float:
        """Return the standard deviation around a result, which depends on ``turn``."""
        return self.effort.around_found[turn % len(self.effort.around_found)]


def starts_of(family: Family, known: Sequence[Tableau], before: Sequence[Found], effort: Effort) -> Iterator[Start]:
    """Yield the starts in a family: known methods, the best method with one stage less, random points.

    Symmetric methods of the shape of the family are starts. Methods with one stage less are extended by a stage, those
    that are known, and the best member of their family among those found ``before``.
    """
    for one in known:
        if _has_shape(one, family):
            yield from (Start(origin=one.name, point=family.unknowns_of(one), spread=s) for s in effort.around_known)
    try:
        smaller = replace(family, stages=family.stages - 1)
    except SettingError:
        smaller = None
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


def search(objective: Objective, starts: Iterator[Start], effort: Effort, seed: int) -> Searcher:
    """Search from the best members near random points, from all ``starts``, and then around the best result."""
    searcher, screen = Searcher(effort, seed), _Screen(objective, effort, np.random.default_rng([seed, 1]))
    refined = (
        searcher.near(searcher.centre(turn), turn, "refined") for turn in range(effort.refinements) if searcher.found
    )
    for start in chain(_best_members(objective, effort, seed), starts, refined):
        promising = screen(start) if effort.screened > 1 else start
        if promising is not None:
            searcher.search(objective, promising)
    return searcher


def _best_members(objective: Objective, effort: Effort, seed: int) -> list[Start]:
    """Return the best members near random points as starts."""
    members = random_members(objective.family, effort.members, np.random.default_rng([seed, 2]))
    parts = [members[i : i + effort.population] for i in range(0, len(members), effort.population)]
    order = np.argsort(np.concatenate([np.zeros(0), *map(objective, parts)]), kind="stable")
    chosen = members[order[: effort.member_starts]]
    return [Start(origin="random member", point=one, spread=effort.around_found[0]) for one in chosen]


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


def _has_shape(method: Tableau, family: Family) -> bool:
    """Return True if a method has the stages and the role of a family, and no squares but those of the family."""
    squares = {i for i, m in enumerate(getattr(method, "square", ())) if Fraction(m) and 2 * i < len(method.kick)}
    return (
        method.symmetric
        and (method.first, method.stages) == (family.first, family.stages)
        and squares <= set(family.squares)
    )
