"""Printed sets that lie in families with free parameters: proved, continued, and ranked among random members."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf

from nearharmonic.derivation.equations import Equations
from nearharmonic.derivation.polish import Polished, polish, rank_and_pivots
from nearharmonic.derivation.proof import Proof, prove
from nearharmonic.derivation.search import sample
from nearharmonic.integrators import integrators
from nearharmonic.tableau import Tableau

#: The sets of Nielsen (2015), Table 4, that its conditions do not fix.
PRINTED = ("babs6o5h", "babps6o5h", "babs7o7h", "babps7o6h", "babps8o7h", "babps9o7h")
#: How many orders beyond the harmonic one count as the "higher order SHO errors" of the paper's criterion.
HIGHER_ORDERS = 4


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
    continued: Polished
    decimals: int


@dataclass(frozen=True)
class Ranking:
    """Where a printed set stands among the members of its family that random starts lead to.

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


def printed_point(name: str, *, digits: int = 128) -> PrintedPoint:
    """Prove and continue the printed set ``name``, which has to declare its harmonic order.

    Raises:
        UnknownNameError: no integrator has this name.
    """
    tableau = integrators[name]
    equations = equations_of(tableau)
    printed = equations.tableau_unknowns(tableau)
    rank, pivots = rank_and_pivots(equations, printed)
    fixed = tuple(j for j in range(equations.unknowns) if j not in pivots)
    continued = polish(equations, printed, digits=digits)
    residuals = [abs(k) for k in equations.residuals(printed)]
    with mp.workdps(30):
        largest = max(mpf(k.numerator) / k.denominator for k in residuals)
    return PrintedPoint(
        name=name,
        equations=equations,
        rank=rank,
        free_parameters=equations.unknowns - rank,
        fixed=fixed,
        printed_residual=largest,
        proof=prove(equations, printed, radius=f"1e-{tableau.digits - 2}", fixed=fixed),
        continued=continued,
        decimals=agreeing_decimals(tableau, continued.outer, continued.inner) if continued.converged else 0,
    )


def rank_printed(
    names: Sequence[str],
    *,
    starts: int,
    seed: int,
    box: float = 1.0,
    bound: float = 5.0,
    report: Callable[[str], None] = lambda _: None,
) -> list[Ranking]:
    """Each of the printed sets ``names`` among the members of its family; sets of one family share the sample.

    Members are those that random starts in [-box, box] lead to with no unknown beyond ``bound``: a sample of the
    family, but no uniform one.

    Raises:
        UnknownNameError: no integrator has one of these names.
        SettingError: ``starts`` is no integer >= 1.
    """
    families: dict[Equations, Any] = {}
    rankings = []
    for name in names:
        equations = equations_of(integrators[name])
        if equations not in families:
            points = sample(equations, starts=starts, seed=seed, box=box, bound=bound, report=report)
            families[equations] = points, np.array([_criteria(equations, x) for x in points.tolist()])
        rankings.append(_ranking(name, equations, starts, *families[equations]))
    return rankings


def equations_of(tableau: Tableau) -> Equations:
    """The conditions that ``tableau`` declares to solve."""
    assert tableau.harmonic_order is not None
    return Equations(tableau.stages, tableau.harmonic_order, tableau.first)


def agreeing_decimals(tableau: Tableau, outer: Sequence[str], inner: Sequence[str]) -> int:
    """The number of decimals, at most those guaranteed, to which every independent printed coefficient agrees.

    Agreement to n decimals is a difference below 10^-n: less than one unit of the last digit, however it was rounded.
    """
    equations = equations_of(tableau)
    printed = equations.unknowns_of(tableau.outer, tableau.inner)
    derived = equations.unknowns_of(list(outer), list(inner))
    with mp.workdps(tableau.digits + 60):
        difference = max(abs(mpf(a) - mpf(b)) for a, b in zip(printed, derived, strict=True))
        if difference == 0:
            return tableau.digits
        # Strictly below 10^-n: a difference of exactly 10^-n is one unit and does not agree.
        return max(0, min(tableau.digits, int(mp.ceil(-mp.log10(difference))) - 1))


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
    outer, inner = equations.rows(x)
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
