"""How far the harmonic order goes with the number of stages (the remark on Eq. 17 in Nielsen 2015)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from nearharmonic.derivation.elimination import reduced_system
from nearharmonic.derivation.equations import Equations
from nearharmonic.derivation.isolated import ELIMINABLE_STAGES, Isolated, solve
from nearharmonic.derivation.polish import polish, rank_and_pivots
from nearharmonic.derivation.proof import prove
from nearharmonic.derivation.search import sample

#: A higher kappa of a solution proved to 100 digits that is above this is no zero.
NOT_ZERO = 1e-9


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


def reach(
    stages: Sequence[int],
    *,
    starts: int,
    seed: int,
    known: Mapping[int, Isolated] | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> list[Reach]:
    """The largest harmonic order for each number of ``stages``.

    s + 1 uses up all the unknowns. If that has real solutions, a higher order would have to be met by one of them; if
    it has none, s is tried. ``known`` holds cases of order s + 1 solved before.

    Raises:
        SettingError: fewer than 3 stages, or no start.
    """
    results = []
    for s in stages:
        equations = Equations(s, s + 1)
        case = (known or {}).get(s) or solve(
            equations, starts=starts, seed=seed, box=1.0, exact=s <= ELIMINABLE_STAGES, report=report
        )
        if case.roots:
            highest, settled = s + 1, case.complete and all(root.higher[0] > NOT_ZERO for root in case.roots)
        else:
            highest = s if _exists(Equations(s, s), starts, seed) else 0
            settled = case.complete and highest > 0
        results.append(
            Reach(
                stages=s,
                lambda_max=2 * s,
                harmonic_order=highest,
                solutions=len(case.roots),
                complex_solutions=reduced_system(equations).complex_solutions,
                starts=case.starts,
                proved_largest=settled,
            )
        )
        report(f"{s} stages: harmonic order {highest}")
    return results


def _exists(equations: Equations, starts: int, seed: int) -> bool:
    """Whether a random start leads to a solution that is then proved."""
    for x in sample(equations, starts=min(starts, 500), seed=seed)[:10].tolist():
        _, pivots = rank_and_pivots(equations, x)
        fixed = [j for j in range(equations.unknowns) if j not in pivots]
        polished = polish(equations, x, digits=50, fixed=fixed)
        if polished.converged and prove(equations, polished.unknowns, radius="1e-30", fixed=fixed).proved:
            return True
    return False
