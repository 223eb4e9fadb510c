"""From a candidate in doubles to the tableau that is registered: named, its free parameters rounded, polished."""

from __future__ import annotations

from nearharmonic.search.nystrom_equations import NYSTROM_ORDER, NystromEquations
from nearharmonic.search.nystrom_search import Candidate
from nearharmonic.search.polish import polished, short_decimals, tableau_of_solution
from nearharmonic.tableau import Tableau

#: Decimals to which free parameters are rounded: the criterion changes by less than 1e-3.
DECIMALS = 4


def registered(candidate: Candidate, *, source: str, digits: int = 76) -> Tableau:
    """The tableau of ``candidate``, named after the paper's convention with the order before the harmonic order.

    Raises:
        NotConvergedError: the equations have no solution next to the rounded candidate.
    """
    equations = NystromEquations(candidate.stages, candidate.first, candidate.harmonic_order)
    fixed = short_decimals(equations, candidate.unknowns, DECIMALS)
    x = polished(equations, candidate.unknowns, fixed=fixed, digits=digits + 14)
    stem, order = f"{candidate.composition}s{candidate.stages}o{NYSTROM_ORDER}", candidate.harmonic_order
    values = " and ".join(fixed[u] for u in sorted(fixed))
    note = f"{len(fixed)} free, fixed at {values}" if fixed else "nothing is free"
    return tableau_of_solution(
        equations, x, name=f"{stem.lower()}_{order}h", label=f"{stem},{order}H", source=source, digits=digits, note=note
    )
