"""Comparison of printed sets with derived solutions: isolated roots and families.

A set in a family with free parameters is proved, continued to more digits, and ranked among random members.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp

from nearharmonic.exact.decimals import as_mpf
from nearharmonic.exact.newton import Proof, prove, rank_and_pivots
from nearharmonic.integrators import integrators
from nearharmonic.integrators.nielsen_2015 import TABLEAUS
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.search import RandomStarts
from nearharmonic_paper.experiments.derivation.conditions import (
    Equations,
    PolishedSolution,
    agreeing_decimals,
    equations_of,
    polish,
)
from nearharmonic_paper.experiments.derivation.isolated import IsolatedSolutions
from nearharmonic_paper.experiments.derivation.search.starts import sample

#: The sets of Nielsen (2015), Table 4, that the conditions determine uniquely.
UNIQUE = tuple(tableau.name for tableau in TABLEAUS if equations_of(tableau).free_parameters == 0)
#: The sets of Nielsen (2015), Table 4, with free parameters.
PRINTED = tuple(tableau.name for tableau in TABLEAUS if equations_of(tableau).free_parameters > 0)
#: Number of orders above the harmonic order that are the "higher order SHO errors" of the paper's criterion.
HIGHER_ORDERS = 4


@dataclass(frozen=True)
class Agreement:
    """A printed set that is a derived root: index ``root`` in its case, agreement to ``decimals`` decimals."""

    name: str
    root: int | None
    decimals: int


@dataclass(frozen=True)
class PrintedPoint:
    """One printed set as a solution of its own conditions.

    ``rank`` is the rank of the Jacobian there, in multiprecision; it determines the number of ``free_parameters``.
    ``printed_residual`` is the largest |kappa| of the printed set up to its harmonic order. ``proof`` concerns the
    solution whose unknowns with the indices ``fixed`` are exactly as printed; the conditions determine the others best.
    ``continued`` is the solution nearest to the printed set: it is corrected in the directions that the conditions
    determine, and unchanged along the family. ``decimals`` is the number of decimals to which every unknown of it
    agrees with the printed set.
    """

    name: str
    equations: Equations
    rank: int
    free_parameters: int
    fixed: tuple[int, ...]
    printed_residual: Any
    proof: Proof
    continued: PolishedSolution
    decimals: int


@dataclass(frozen=True)
class Ranking:
    """Rank of a printed set among the members of its family that are found from random starts.

    ``sum_of_absolute_values`` and ``higher`` (|kappa| of the next four orders) are the paper's criteria;
    ``smaller_sum`` and ``smaller_higher`` are the fractions of members with smaller values. ``better_in_all`` is the
    number of members that are better by all criteria. ``smallest_sum`` is the smallest sum found. ``nearest`` is the
    distance (largest difference of an unknown) of the nearest member from the printed set. ``sum_slope`` and
    ``higher_slope`` are the lengths of the gradients of the sum and of the first higher |kappa| along the family: if
    both are nonzero, the printed set is not at the minimum of a criterion, and no criterion can reproduce its digits.
    """

    name: str
    starts: int
    members: int
    sum_of_absolute_values: float
    higher: tuple[float, ...]
    smaller_sum: float
    smaller_higher: tuple[float, ...]
    better_in_all: int
    smallest_sum: float
    nearest: float
    sum_slope: float
    higher_slope: float


def agreement(name: str, isolated: Sequence[IsolatedSolutions]) -> Agreement:
    """Find the root of the cases that equals a printed set, and the number of equal decimals."""
    tableau = integrators[name]
    (roots,) = (case.roots for case in isolated if case.equations.stages == tableau.stages)
    decimals = [agreeing_decimals(tableau, root.outer, root.inner) for root in roots]
    most = max(decimals, default=0)
    return Agreement(name, decimals.index(most) if most else None, most)


def printed_point(name: str, *, digits: int = 128) -> PrintedPoint:
    """Prove a printed set, and continue it to ``digits`` decimals."""
    tableau = integrators[name]
    equations = equations_of(tableau)
    printed = equations.tableau_unknowns(tableau)
    rank, pivots = rank_and_pivots(equations.jacobian, printed)
    fixed = tuple(j for j in range(equations.unknowns) if j not in pivots)
    continued = polish(equations, printed, digits=digits)
    residuals = [abs(k) for k in equations.residuals(printed)]
    with mp.workdps(30):
        largest = max(map(as_mpf, residuals))
    return PrintedPoint(
        name=name,
        equations=equations,
        rank=rank,
        free_parameters=equations.unknowns - rank,
        fixed=fixed,
        printed_residual=largest,
        proof=prove(equations.residuals, equations.jacobian, printed, radius=f"1e-{tableau.digits - 2}", fixed=fixed),
        continued=continued,
        decimals=agreeing_decimals(tableau, continued.outer, continued.inner) if continued.converged else 0,
    )


def rank_printed(names: Sequence[str], starts: RandomStarts) -> list[Ranking]:
    """Rank printed sets among members of their families, found from random starts in each family.

    The sample of members is not uniform. Sets of one family share a sample.
    """
    families: dict[Equations, Any] = {}
    rankings = []
    for name in names:
        equations = equations_of(integrators[name])
        if equations not in families:
            points = sample(equations, starts)
            families[equations] = points, np.array([_criteria(equations, x) for x in points.tolist()])
        rankings.append(_ranking(name, equations, starts.count, *families[equations]))
    return rankings


def derived_tableaus(
    isolated: Sequence[IsolatedSolutions],
    agreements: Sequence[Agreement],
    printed: Sequence[PrintedPoint],
    digits: int,
) -> dict[str, Tableau]:
    """Return the derived counterpart of each printed set, by name: a root, or the nearest member of its family.

    Sets without an equal root, and those that were not continued to ``digits`` decimals, are omitted.
    """
    cases = {case.equations.stages: case for case in isolated}
    tableaus = {}
    for found in agreements:
        if found.root is not None:
            known = integrators[found.name]
            case = cases[known.stages]
            root = case.roots[found.root].tableau(case.equations, found.name, digits)
            tableaus[found.name] = root.role(known.first)
    for point in printed:
        if point.continued.converged:
            known = integrators[point.name]
            tableaus[point.name] = point.equations.tableau(
                point.continued.outer, point.continued.inner, name=point.name, label=known.label, digits=digits - 3,
                source="derived: the printed set, continued along the directions that its conditions fix",
            )  # fmt: skip
    return tableaus


def _ranking(name: str, equations: Equations, starts: int, points: Any, criteria: Any) -> Ranking:
    printed = [float(c) for c in equations.tableau_unknowns(integrators[name])]
    own = np.array(_criteria(equations, printed))
    smaller = criteria < own
    fractions = smaller.mean(axis=0) if len(points) else np.full(own.shape, np.nan)
    slopes = _slopes(equations, printed)
    return Ranking(
        name=name,
        starts=starts,
        members=len(points),
        sum_of_absolute_values=float(own[0]),
        higher=tuple(own[1:].tolist()),
        smaller_sum=float(fractions[0]),
        smaller_higher=tuple(fractions[1:].tolist()),
        better_in_all=int(smaller.all(axis=1).sum()),
        smallest_sum=float(criteria[:, 0].min(initial=np.inf)),
        nearest=float(np.abs(points - np.array(printed)).max(axis=1).min(initial=np.inf)),
        sum_slope=slopes[0],
        higher_slope=slopes[1],
    )


def _criteria(equations: Equations, x: Sequence[float]) -> list[float]:
    """Return the sum of all |coefficients|, then |kappa| of the orders above the harmonic order."""
    outer, inner = equations.palindromes(x)
    highest = equations.harmonic_order
    higher = equations.errors(x, highest + HIGHER_ORDERS)[highest:]
    return [float(sum(map(abs, [*outer, *inner]))), *(abs(float(k)) for k in higher)]


def _slopes(equations: Equations, x: Sequence[float]) -> list[float]:
    """Return the lengths of the gradients of the criteria along the family, by central differences."""
    jacobian = np.array(equations.jacobian(x), dtype=float)
    tangents = np.linalg.svd(jacobian)[2][len(jacobian) :]
    at, step = np.array(x), 1e-6  # truncation and rounding errors of the difference are both about 1e-10
    gradients = [
        (np.array(_criteria(equations, at + step * t)) - np.array(_criteria(equations, at - step * t))) / (2 * step)
        for t in tangents
    ]
    return [float(length) for length in np.linalg.norm(gradients, axis=0)]
