"""Printed sets compared with what is derived: the isolated roots that they are, the families that they lie in.

A set that lies in a family with free parameters is proved, continued to more digits, and ranked among random members.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp

from nearharmonic.exact.decimals import as_mpf
from nearharmonic.exact.krawczyk import Proof, prove
from nearharmonic.exact.newton import rank_and_pivots
from nearharmonic.integrators import integrators
from nearharmonic.integrators.nielsen_2015 import TABLEAUS
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.search.random_starts import RandomStarts
from nearharmonic.reproduction.experiments.derivation.conditions import (
    Equations,
    PolishedSolution,
    agreeing_decimals,
    equations_of,
    polish,
)
from nearharmonic.reproduction.experiments.derivation.isolated import IsolatedSolutions, Root
from nearharmonic.reproduction.experiments.derivation.search.starts import sample

#: The sets of Nielsen (2015), Table 4, that its conditions fix.
UNIQUE = tuple(tableau.name for tableau in TABLEAUS if equations_of(tableau).free_parameters == 0)
#: The sets of Nielsen (2015), Table 4, that its conditions do not fix.
PRINTED = tuple(tableau.name for tableau in TABLEAUS if equations_of(tableau).free_parameters > 0)
#: How many orders beyond the harmonic one count as the "higher order SHO errors" of the paper's criterion.
HIGHER_ORDERS = 4


@dataclass(frozen=True)
class Agreement:
    """A printed set that is a derived root: number ``root`` of its case, equal to ``decimals`` decimals."""

    name: str
    root: int | None
    decimals: int


@dataclass(frozen=True)
class PrintedPoint:
    """One printed set as a solution of its own conditions.

    ``rank`` of the Jacobian there, in multiprecision, leaves ``free_parameters``. ``printed_residual`` is the largest
    |kappa| up to the harmonic order of the set as printed. ``proof`` is about the solution with the unknowns of the
    indices ``fixed`` exactly as printed, the others being those that the conditions fix best. ``continued`` is the
    solution nearest to the print: corrected in the directions that the conditions fix, left alone along the family;
    ``decimals`` is to how many decimals every unknown then agrees with the print.
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
    """Rank of a printed set among the members of its family that random starts lead to.

    ``sum_of_absolute_values`` and ``higher`` (|kappa| of the next four orders) are the paper's criteria;
    ``smaller_sum`` and ``smaller_higher`` the fractions of members with less. ``better_in_all`` counts the members that
    are better by every one of them, ``smallest_sum`` is the least sum met, ``nearest`` the distance (largest difference
    of an unknown) of the member nearest to the printed set. ``sum_slope`` and ``higher_slope`` are the lengths of the
    gradients of the sum and of the first higher |kappa| along the family: where neither is 0, the printed set is not
    where a criterion is least, and no criterion can give its digits.
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
    """Find which root a printed set is, and to how many decimals.

    Parameters
    ----------
    name : str
        Name of the printed set.
    isolated : sequence of IsolatedSolutions
        The solutions of the cases, that of the set among them; otherwise it is no root.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    """
    tableau = integrators[name]
    equations = equations_of(tableau)
    roots: Sequence[Root] = ()
    for case in isolated:
        if (case.equations.stages, case.equations.harmonic_order) == (equations.stages, equations.harmonic_order):
            roots = case.roots
    decimals = [agreeing_decimals(tableau, root.outer, root.inner) for root in roots]
    best = max(range(len(roots)), key=decimals.__getitem__, default=None)
    if best is None or decimals[best] == 0:
        return Agreement(name, None, 0)
    return Agreement(name, best, decimals[best])


def printed_point(name: str, *, digits: int = 128) -> PrintedPoint:
    """Prove and continue a printed set.

    Parameters
    ----------
    name : str
        Name of the set, which has to declare its harmonic order.
    digits : int
        Decimals of the continued solution.

    Raises
    ------
    UnknownNameError
        No integrator has this name.
    """
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


def rank_printed(
    names: Sequence[str], starts: RandomStarts, report: Callable[[str], None] = lambda _: None
) -> list[Ranking]:
    """Rank printed sets among the members of their families, of which random starts give a sample.

    The sample is not a uniform one. Sets of one family share it.

    Parameters
    ----------
    names : sequence of str
        Names of the sets.
    starts : RandomStarts
        Where the search of each family begins.
    report : callable
        Is told of the progress.

    Raises
    ------
    UnknownNameError
        No integrator has one of these names.
    """
    families: dict[Equations, Any] = {}
    rankings = []
    for name in names:
        equations = equations_of(integrators[name])
        if equations not in families:
            points = sample(equations, starts, report)
            families[equations] = points, np.array([_criteria(equations, x) for x in points.tolist()])
        rankings.append(_ranking(name, equations, starts.count, *families[equations]))
    return rankings


def derived_tableaus(
    isolated: Sequence[IsolatedSolutions],
    agreements: Sequence[Agreement],
    printed: Sequence[PrintedPoint],
    digits: int,
) -> dict[str, Tableau]:
    """Return the derived counterpart of each printed set, by name: the root it is, or the nearest of its family.

    Parameters
    ----------
    isolated : sequence of IsolatedSolutions
        The solutions of the cases.
    agreements : sequence of Agreement
        Which of them each set is that its conditions fix; a set that is none is left out.
    printed : sequence of PrintedPoint
        The other sets; one that was not continued is left out.
    digits : int
        Decimals to which both are known.
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
    """The sum of the absolute values of all coefficients, then |kappa| of the orders beyond the harmonic one."""
    outer, inner = equations.palindromes(x)
    highest = equations.harmonic_order
    higher = equations.errors(x, highest + HIGHER_ORDERS)[highest:]
    return [float(sum(map(abs, [*outer, *inner]))), *(abs(float(k)) for k in higher)]


def _slopes(equations: Equations, x: Sequence[float]) -> list[float]:
    """Lengths of the gradients of the criteria along the family, by central differences."""
    jacobian = np.array(equations.jacobian(x), dtype=float)
    tangents = np.linalg.svd(jacobian)[2][len(jacobian) :]
    at, step = np.array(x), 1e-6  # both truncation and rounding of the difference leave about 1e-10
    gradients = [
        (np.array(_criteria(equations, at + step * t)) - np.array(_criteria(equations, at - step * t))) / (2 * step)
        for t in tangents
    ]
    return [float(length) for length in np.linalg.norm(gradients, axis=0)]
