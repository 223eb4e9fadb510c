"""Settings of searches, their starts and their results."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from nearharmonic.numerics.types import Floats
from nearharmonic.training.family import Family

#: Names of the ways from a start to a minimum.
DescentName = Literal["evolution", "tangent_evolution", "gauss_newton"]


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
    descent : {"evolution", "tangent_evolution", "gauss_newton"}
        Way from a start to a minimum.
    tangents : int
        Number of tangent spaces in a tangent evolution, which share its trials.
    population : int
        Number of members per generation, and of those that an objective integrates at once.
    around_known, around_found, at_random : tuple of float
        Initial standard deviations around a known method, around the result of a search, and around random points; used
        in turn.
    random_points, mean, spread : int and float
        Number of random points, whose best one is a start, and their mean and standard deviation in units of 1/s.
    members, member_starts : int
        Number of random points near which members are sought, and of the best of these that are starts.
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
    tangents: int = 4
    population: int = 20
    around_known: tuple[float, ...] = (0.01, 0.003)
    around_found: tuple[float, ...] = (0.003, 0.01, 0.03)
    at_random: tuple[float, ...] = (0.03,)
    random_points: int = 400
    mean: float = 1.0
    spread: float = 1.0
    members: int = 0
    member_starts: int = 5
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
