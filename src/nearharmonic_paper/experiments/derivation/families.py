"""Derived solutions of a case: isolated roots and families, compared with printed sets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpmath import mp, mpf

from nearharmonic.exact.polynomials import Proof, as_mpf, fixed_point, prove, rank_and_pivots
from nearharmonic.integrators import integrators
from nearharmonic.integrators.nielsen_2015 import TABLEAUS
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.compiled import RandomStarts
from nearharmonic.output.table import progress
from nearharmonic_paper.experiments.derivation import search as searching

# --- All real solutions of a case without free parameters: search, exact count, refinement and proof.
#
# They determine the largest harmonic order for a number of stages (the remark on Eq. 17 in Nielsen 2015).

#: The cases of Nielsen (2015) without free parameters, as (stages, harmonic order).
CASES = ((5, 6), (6, 7), (7, 8))
#: Unknowns near a solution, number of random starts that lead there, and True if elimination finds it.
Candidate = tuple[tuple[Any, ...], int, bool]


#: Decimals of the solutions.
DIGITS = 128
#: Largest number of stages for elimination, which takes seconds; 9 stages have a ring of 126 dimensions: minutes.
ELIMINABLE = 8
#: Relative difference of unknowns below which elimination and search have found the same solution.
SAME = 1e-6
#: A higher kappa above this is nonzero for a solution proved to 100 digits.
NOT_ZERO = 1e-9
#: Starts of a search for any solution of an order, the bound of its unknowns, and the ends that are tried.
FEW, NEAR, TRIED = 500, 10.0, 10


@dataclass(frozen=True)
class Root:
    """One real solution: decimal strings of both rows, and the accuracy of the proof.

    ``residual`` is the largest |kappa| up to the harmonic order. ``proved``: by Krawczyk's test, exactly one solution
    is within ``radius`` of the unknowns, and its distance is at most ``distance``. ``hits`` is the number of random
    starts that lead here. ``eliminated`` is True if elimination finds the solution too. ``higher`` has |kappa| of the
    next three orders.
    """

    outer: tuple[str, ...]
    inner: tuple[str, ...]
    residual: Any
    proved: bool
    radius: Any
    distance: Any
    hits: int
    eliminated: bool
    sum_of_absolute_values: float
    largest_coefficient: float
    higher: tuple[float, ...]

    def tableau(self, equations: searching.Equations, name: str, digits: int) -> Tableau:
        """This solution as an integrator of order 4, rounded to ``digits`` decimals."""
        rows = ([fixed_point(c, digits) for c in row] for row in (self.outer, self.inner))
        source = f"derived: {equations.stages} stages, harmonic order {equations.harmonic_order}"
        order = equations.harmonic_order
        return equations.tableau(*rows, name=name, label=name, source=source, digits=digits - 1, harmonic_order=order)


@dataclass(frozen=True)
class IsolatedSolutions:
    """The real solutions of one case, sorted by the sum of the absolute values of the coefficients.

    ``complex_solutions`` is the exact number of complex solutions, and ``real_solutions`` of real solutions, by
    Sturm's theorem; None without elimination. ``complete``: this number of distinct solutions was proved, so that no
    solution is missing, with coefficients of any size. Otherwise the roots are those that the search found from its
    ``box``, with no unknown above ``bound``. ``unfinished`` describes each candidate that was not refined to its digits
    or not proved.
    """

    equations: searching.Equations
    roots: tuple[Root, ...]
    complex_solutions: int | None
    real_solutions: int | None
    complete: bool
    starts: int
    converged: int
    box: float
    bound: float
    unfinished: tuple[str, ...]


@dataclass(frozen=True)
class Reach:
    """The largest harmonic order with a real solution for one number of stages, kick first.

    ``lambda_max`` = 2s is the highest power of tau in the new position. ``harmonic_order`` is the largest order with a
    proved solution (0 if none was found). ``solutions`` is the number of distinct real solutions found at s + 1, where
    Bezout's theorem gives ``complex_solutions`` complex solutions with their multiplicities. ``proved_largest``: all
    real solutions at this order are known, and none of them has the next order, so that no larger order exists.
    Otherwise it is the largest order found from ``starts``.
    """

    stages: int
    lambda_max: int
    harmonic_order: int
    solutions: int
    complex_solutions: int
    starts: int
    proved_largest: bool


def solve(
    equations: searching.Equations, starts: RandomStarts, *, digits: int = DIGITS, eliminable: int = ELIMINABLE
) -> IsolatedSolutions:
    """Find all real solutions of a case without free parameters, from random starts and by elimination."""
    found = searching.search(equations, starts)
    elimination = searching.eliminate(equations) if equations.stages <= eliminable else None
    candidates = [(tuple(point.tolist()), hits, False) for point, hits in zip(found.points, found.hits, strict=True)]
    for start in elimination.starts if elimination else ():
        candidates = _joined(candidates, start)
    roots, unfinished = _proved(equations, candidates, digits)
    complete = bool(elimination and elimination.simple and elimination.real_solutions == len(roots) and not unfinished)
    complex_number = elimination.complex_solutions if elimination else None
    real_number = elimination.real_solutions if elimination else None
    return IsolatedSolutions(
        equations, tuple(roots), complex_number, real_number, complete, found.starts, found.converged, starts.box,
        starts.bound, tuple(unfinished),
    )  # fmt: skip


def reach(
    stages: Sequence[int], starts: RandomStarts, known: Mapping[int, IsolatedSolutions], *, digits: int = DIGITS
) -> list[Reach]:
    """Find the largest harmonic order for each number of stages; ``known`` are solved cases of order s + 1, by stages.

    Order s + 1 determines all unknowns. If it has real solutions, only one of them could have a higher order; if it
    has none, order s is tried.
    """
    results = []
    for s in stages:
        case = known.get(s) or solve(searching.Equations(s, s + 1), starts, digits=digits)
        if case.roots:
            highest, settled = s + 1, case.complete and all(root.higher[0] > NOT_ZERO for root in case.roots)
        else:
            highest = s if _exists(searching.Equations(s, s), starts) else 0
            settled = case.complete and highest > 0
        complex_solutions = searching.reduced_system(case.equations).complex_solutions
        results.append(Reach(s, 2 * s, highest, len(case.roots), complex_solutions, case.starts, settled))
        progress(f"{s} stages: harmonic order {highest}")
    return results


def _joined(candidates: list[Candidate], start: Sequence[Any]) -> list[Candidate]:
    """Mark the solution from elimination among ``candidates``, or add it if no start led to it."""
    scale = max(1.0, *(abs(float(c)) for c in start))
    for i, (point, hits, _) in enumerate(candidates):
        if max(abs(float(a) - b) for a, b in zip(start, point, strict=True)) < SAME * scale:
            return [*candidates[:i], (point, hits, True), *candidates[i + 1 :]]
    return [*candidates, (tuple(start), 0, True)]


def _proved(
    equations: searching.Equations, candidates: Sequence[Candidate], digits: int
) -> tuple[list[Root], list[str]]:
    """Return the proved solutions near ``candidates``, sorted by sum of |coefficients|, and remarks on the others."""
    roots: list[Root] = []
    unfinished: list[str] = []
    for start, hits, eliminated in candidates:
        outcome = _root(equations, start, digits, hits, eliminated)
        if isinstance(outcome, str):
            unfinished.append(outcome)
        else:
            roots.append(outcome)
        progress(f"{equations.stages} stages, harmonic order {equations.harmonic_order}: {len(roots)} solutions proved")
    return sorted(roots, key=lambda root: root.sum_of_absolute_values), unfinished


def _root(equations: searching.Equations, start: Sequence[Any], digits: int, hits: int, eliminated: bool) -> Root | str:
    polished = searching.polish(equations, start, digits=digits)
    place = ", ".join(f"{float(c):.6f}" for c in start)
    if not polished.converged:
        return f"({place}): Newton's method reached a residual of {mp.nstr(polished.residual, 3)}, not 1e-{digits}"
    proof = prove(equations.residuals, equations.jacobian, polished.unknowns, radius=f"1e-{digits * 3 // 4}")
    if not proof.proved:
        reach = mp.nstr(proof.distance, 3)
        return f"({place}): no proof within {mp.nstr(proof.radius, 3)}: the image of Krawczyk's test reaches {reach}"
    coefficients = [abs(float(c)) for c in (*polished.outer, *polished.inner)]
    highest = equations.harmonic_order
    with mp.workdps(30):
        higher = equations.errors([mpf(c) for c in polished.unknowns], highest + 3)[highest:]
    return Root(
        polished.outer, polished.inner, polished.residual, proof.proved, proof.radius, proof.distance, hits, eliminated,
        sum(coefficients), max(coefficients), tuple(abs(float(k)) for k in higher),
    )  # fmt: skip


def _exists(equations: searching.Equations, starts: RandomStarts) -> bool:
    """Return True if a random start leads to a proved solution."""
    few = replace(starts, count=min(starts.count, FEW), bound=NEAR)
    for x in searching.sample(equations, few)[:TRIED].tolist():
        _, pivots = rank_and_pivots(equations.jacobian, x)
        fixed = [j for j in range(equations.unknowns) if j not in pivots]
        found = searching.polish(equations, x, digits=50, fixed=fixed)
        if found.converged and (
            prove(equations.residuals, equations.jacobian, found.unknowns, radius="1e-30", fixed=fixed).proved
        ):
            return True
    return False


# --- Comparison of printed sets with derived solutions: isolated roots and families.
#
# A set in a family with free parameters is proved, continued to more digits, and ranked among random members.

#: The sets of Nielsen (2015), Table 4, that the conditions determine uniquely.
UNIQUE = tuple(tableau.name for tableau in TABLEAUS if searching.equations_of(tableau).free_parameters == 0)
#: The sets of Nielsen (2015), Table 4, with free parameters.
PRINTED = tuple(tableau.name for tableau in TABLEAUS if searching.equations_of(tableau).free_parameters > 0)
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
    equations: searching.Equations
    rank: int
    free_parameters: int
    fixed: tuple[int, ...]
    printed_residual: Any
    proof: Proof
    continued: searching.PolishedSolution
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
    decimals = [searching.agreeing_decimals(tableau, root.outer, root.inner) for root in roots]
    most = max(decimals, default=0)
    return Agreement(name, decimals.index(most) if most else None, most)


def printed_point(name: str, *, digits: int = 128) -> PrintedPoint:
    """Prove a printed set, and continue it to ``digits`` decimals."""
    tableau = integrators[name]
    equations = searching.equations_of(tableau)
    printed = equations.tableau_unknowns(tableau)
    rank, pivots = rank_and_pivots(equations.jacobian, printed)
    fixed = tuple(j for j in range(equations.unknowns) if j not in pivots)
    continued = searching.polish(equations, printed, digits=digits)
    with mp.workdps(30):
        largest = max(as_mpf(abs(k)) for k in equations.residuals(printed))
    proof = prove(equations.residuals, equations.jacobian, printed, radius=f"1e-{tableau.digits - 2}", fixed=fixed)
    decimals = searching.agreeing_decimals(tableau, continued.outer, continued.inner) if continued.converged else 0
    free = equations.unknowns - rank
    return PrintedPoint(name, equations, rank, free, fixed, largest, proof, continued, decimals)


def rank_printed(names: Sequence[str], starts: RandomStarts) -> list[Ranking]:
    """Rank printed sets among members of their families, found from random starts in each family.

    The sample of members is not uniform. Sets of one family share a sample.
    """
    rankings, families = [], dict[searching.Equations, Any]()
    for name in names:
        equations = searching.equations_of(integrators[name])
        if equations not in families:
            points = searching.sample(equations, starts)
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


def _ranking(name: str, equations: searching.Equations, starts: int, points: Any, criteria: Any) -> Ranking:
    printed = [float(c) for c in equations.tableau_unknowns(integrators[name])]
    own = np.array(_criteria(equations, printed))
    smaller = criteria < own
    fractions = smaller.mean(axis=0) if len(points) else np.full(own.shape, np.nan)
    sum_slope, higher_slope, *_ = _slopes(equations, printed)
    return Ranking(
        name, starts, members=len(points),
        sum_of_absolute_values=float(own[0]), higher=tuple(own[1:].tolist()),
        smaller_sum=float(fractions[0]), smaller_higher=tuple(fractions[1:].tolist()),
        better_in_all=int(smaller.all(axis=1).sum()),
        smallest_sum=float(criteria[:, 0].min(initial=np.inf)),
        nearest=float(np.abs(points - np.array(printed)).max(axis=1).min(initial=np.inf)),
        sum_slope=sum_slope, higher_slope=higher_slope,
    )  # fmt: skip


def _criteria(equations: searching.Equations, x: Sequence[float]) -> list[float]:
    """Return the sum of all |coefficients|, then |kappa| of the orders above the harmonic order."""
    outer, inner = equations.palindromes(x)
    highest = equations.harmonic_order
    higher = equations.errors(x, highest + HIGHER_ORDERS)[highest:]
    return [float(sum(map(abs, [*outer, *inner]))), *(abs(float(k)) for k in higher)]


def _slopes(equations: searching.Equations, x: Sequence[float]) -> list[float]:
    """Return the lengths of the gradients of the criteria along the family, by central differences."""
    jacobian = np.array(equations.jacobian(x), dtype=float)
    tangents = np.linalg.svd(jacobian)[2][len(jacobian) :]
    at, step = np.array(x), 1e-6  # truncation and rounding errors of the difference are both about 1e-10
    gradients = [
        (np.array(_criteria(equations, at + step * t)) - np.array(_criteria(equations, at - step * t))) / (2 * step)
        for t in tangents
    ]
    return [float(length) for length in np.linalg.norm(gradients, axis=0)]
