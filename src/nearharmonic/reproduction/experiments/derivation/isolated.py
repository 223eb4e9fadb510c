"""Every real solution of a case with nothing left free: searched for, counted exactly, polished and proved.

How far the harmonic order goes with the number of stages (the remark on Eq. 17 in Nielsen 2015) follows from these.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

from mpmath import mp, mpf

from nearharmonic.exact.decimals import fixed_point
from nearharmonic.exact.krawczyk import prove
from nearharmonic.exact.newton import rank_and_pivots
from nearharmonic.integrators.tableau import Tableau
from nearharmonic.numerics.search.random_starts import RandomStarts
from nearharmonic.reproduction.experiments.derivation.conditions import Equations, polish
from nearharmonic.reproduction.experiments.derivation.elimination import eliminate, reduced_system
from nearharmonic.reproduction.experiments.derivation.search.starts import sample, search

#: The cases of Nielsen (2015) that leave nothing free, as (stages, harmonic order).
CASES = ((5, 6), (6, 7), (7, 8))
#: Stages up to which elimination takes seconds; 9 stages have a ring of 126 dimensions and take minutes.
ELIMINABLE_STAGES = 8
#: Starts of a search for any solution of an order, and the bound of its unknowns.
FEW, NEAR = 500, 10.0
#: Unknowns near a solution, how many random starts led there, and whether elimination finds it.
Candidate = tuple[tuple[Any, ...], int, bool]
#: A higher kappa of a solution proved to 100 digits that is above this is no zero.
NOT_ZERO = 1e-9


@dataclass(frozen=True)
class Root:
    """One real solution: decimal strings of both rows, and how well it is known.

    ``residual`` is the largest |kappa| up to the harmonic order. ``proved``: by Krawczyk's test, exactly one solution
    lies within ``radius`` of each unknown, which is at most ``distance`` from it. ``hits`` counts the random starts
    that led here, and ``eliminated`` tells whether elimination finds it as well. ``higher`` holds |kappa| of the three
    orders that follow.
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

    def tableau(self, equations: Equations, name: str, digits: int) -> Tableau:
        """This solution as an integrator of order 4, rounded to ``digits`` decimals."""
        rows = ([fixed_point(c, digits) for c in row] for row in (self.outer, self.inner))
        source = f"derived: {equations.stages} stages, harmonic order {equations.harmonic_order}"
        order = equations.harmonic_order
        return equations.tableau(*rows, name=name, label=name, source=source, digits=digits - 1, harmonic_order=order)


@dataclass(frozen=True)
class IsolatedSolutions:
    """The real solutions of one case, by the sum of their absolute values.

    ``complex_solutions`` is the exact number of complex solutions, and ``real_solutions`` that of the real ones, by
    Sturm's theorem; None where elimination was left out. ``complete``: as many distinct solutions were proved, so none
    is missing, with coefficients of whatever size. Otherwise the roots are those that the search found in its ``box``
    with no unknown beyond ``bound``. ``unfinished`` says of each candidate that was not polished to its digits, or not
    proved, how far it came.
    """

    equations: Equations
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
    solution proved to exist (0 if none was found); ``solutions`` counts the distinct real ones found at s + 1, where
    Bezout's theorem gives ``complex_solutions`` complex ones with their multiplicities. ``proved_largest``: all real
    solutions at that order are known and none of them meets the next one, so that there is no larger order; otherwise
    it is the largest found from ``starts``.
    """

    stages: int
    lambda_max: int
    harmonic_order: int
    solutions: int
    complex_solutions: int
    starts: int
    proved_largest: bool


def solve(
    equations: Equations,
    starts: RandomStarts,
    *,
    digits: int = 128,
    exact: bool | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> IsolatedSolutions:
    """Find all real solutions of a case, from random starts and by elimination.

    Parameters
    ----------
    equations : Equations
        The case.
    starts : RandomStarts
        Where the search begins.
    digits : int
        Decimals of the solutions.
    exact : bool, optional
        Whether to eliminate; by default up to 8 stages.
    report : callable
        Is told of the progress.

    Raises
    ------
    SettingError
        A case with free parameters.
    """
    found = search(equations, starts, report)
    eliminable = equations.stages <= ELIMINABLE_STAGES if exact is None else exact
    elimination = eliminate(equations) if eliminable else None
    candidates = [(tuple(point.tolist()), hits, False) for point, hits in zip(found.points, found.hits, strict=True)]
    candidates = reduce(_joined, elimination.starts if elimination else (), candidates)
    roots, unfinished = _proved(equations, candidates, digits, report)
    complete = bool(elimination and elimination.simple and elimination.real_solutions == len(roots) and not unfinished)
    return IsolatedSolutions(
        equations=equations,
        roots=tuple(roots),
        complex_solutions=elimination.complex_solutions if elimination else None,
        real_solutions=elimination.real_solutions if elimination else None,
        complete=complete,
        starts=found.starts,
        converged=found.converged,
        box=starts.box,
        bound=starts.bound,
        unfinished=tuple(unfinished),
    )


def reach(
    stages: Sequence[int],
    starts: RandomStarts,
    *,
    known: Mapping[int, IsolatedSolutions] | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> list[Reach]:
    """Find the largest harmonic order for each number of stages.

    s + 1 uses up all the unknowns. If that has real solutions, a higher order would have to be met by one of them; if
    it has none, s is tried.

    Parameters
    ----------
    stages : sequence of int
        The numbers of stages.
    starts : RandomStarts
        Where the search begins for each of them.
    known : mapping of int to IsolatedSolutions, optional
        Cases of order s + 1 solved before, by their stages.
    report : callable
        Is told of the progress.

    Raises
    ------
    SettingError
        Fewer than 3 stages.
    """
    results = []
    for s in stages:
        equations = Equations(s, s + 1)
        case = (known or {}).get(s) or solve(equations, starts, exact=s <= ELIMINABLE_STAGES, report=report)
        results.append(_reach_of(case, starts))
        report(f"{s} stages: harmonic order {results[-1].harmonic_order}")
    return results


def _reach_of(case: IsolatedSolutions, starts: RandomStarts) -> Reach:
    """The largest harmonic order, from the solutions of order s + 1."""
    s = case.equations.stages
    if case.roots:
        highest, settled = s + 1, case.complete and all(root.higher[0] > NOT_ZERO for root in case.roots)
    else:
        highest = s if _exists(Equations(s, s), starts) else 0
        settled = case.complete and highest > 0
    return Reach(
        stages=s,
        lambda_max=2 * s,
        harmonic_order=highest,
        solutions=len(case.roots),
        complex_solutions=reduced_system(case.equations).complex_solutions,
        starts=case.starts,
        proved_largest=settled,
    )


def _joined(candidates: list[Candidate], start: Sequence[Any]) -> list[Candidate]:
    """``candidates`` with the solution that elimination found marked, or added if no start led to it."""
    scale = max(1.0, *(abs(float(c)) for c in start))
    for i, (point, hits, _) in enumerate(candidates):
        if max(abs(float(a) - b) for a, b in zip(start, point, strict=True)) < 1e-6 * scale:
            return [*candidates[:i], (point, hits, True), *candidates[i + 1 :]]
    return [*candidates, (tuple(start), 0, True)]


def _proved(
    equations: Equations, candidates: Sequence[Candidate], digits: int, report: Callable[[str], None]
) -> tuple[list[Root], list[str]]:
    """The solutions next to ``candidates``, by the sum of their absolute values, and what is said of the others."""
    roots: list[Root] = []
    unfinished: list[str] = []
    for start, hits, eliminated in candidates:
        outcome = _root(equations, start, digits, hits, eliminated)
        if isinstance(outcome, str):
            unfinished.append(outcome)
        else:
            roots.append(outcome)
        report(f"{equations.stages} stages, harmonic order {equations.harmonic_order}: {len(roots)} solutions proved")
    return sorted(roots, key=lambda root: root.sum_of_absolute_values), unfinished


def _root(equations: Equations, start: Sequence[Any], digits: int, hits: int, eliminated: bool) -> Root | str:
    polished = polish(equations, start, digits=digits)
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
        outer=polished.outer,
        inner=polished.inner,
        residual=polished.residual,
        proved=True,
        radius=proof.radius,
        distance=proof.distance,
        hits=hits,
        eliminated=eliminated,
        sum_of_absolute_values=sum(coefficients),
        largest_coefficient=max(coefficients),
        higher=tuple(abs(float(k)) for k in higher),
    )


def _exists(equations: Equations, starts: RandomStarts) -> bool:
    """Return True if a random start leads to a solution that is then proved."""
    for x in sample(equations, replace(starts, count=min(starts.count, FEW), bound=NEAR))[:10].tolist():
        _, pivots = rank_and_pivots(equations.jacobian, x)
        fixed = [j for j in range(equations.unknowns) if j not in pivots]
        polished = polish(equations, x, digits=50, fixed=fixed)
        if not polished.converged:
            continue
        if prove(equations.residuals, equations.jacobian, polished.unknowns, radius="1e-30", fixed=fixed).proved:
            return True
    return False
