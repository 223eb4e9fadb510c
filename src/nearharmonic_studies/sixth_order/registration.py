"""Conversion of a candidate in doubles to a registered tableau: name, rounded free parameters, and all digits.

Newton's method in multiprecision gives any number of digits; free parameters are fixed as short decimals.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
from mpmath import mp, mpf

from nearharmonic.integrators.tableau import Tableau
from nearharmonic.training.objective import tableau_of
from nearharmonic_studies.sixth_order.cascade import Candidate
from nearharmonic_studies.sixth_order.conditions import NYSTROM_ORDER, NystromEquations

#: Decimals of rounded free parameters: the criterion changes by less than 1e-3.
DECIMALS = 4


def registered(candidate: Candidate, *, source: str, digits: int = 76) -> Tableau:
    """Return the tableau of a candidate, with a name like in the paper and the order before the harmonic order.

    Raises NotConvergedError: the equations have no solution near the rounded candidate.
    """
    equations = NystromEquations(candidate.stages, candidate.first, candidate.harmonic_order)
    fixed = short_decimals(equations, candidate.unknowns, DECIMALS)
    stem, order = f"{candidate.composition}s{candidate.stages}o{NYSTROM_ORDER}", candidate.harmonic_order
    values = " and ".join(fixed[u] for u in sorted(fixed))
    note = f"{len(fixed)} free, fixed at {values}" if fixed else "nothing is free"
    return tableau_of(
        equations, candidate.unknowns, digits=digits, fixed=fixed, nearest=inf, name=f"{stem.lower()}_{order}h",
        label=f"{stem},{order}H", source=source, note=note, harmonic_order=order,
    )  # fmt: skip


def short_decimals(equations: NystromEquations, x: Sequence[float], decimals: int) -> dict[int, str]:
    """Choose the free parameters of a family: the unknowns that vary most along it at the solution ``x``.

    The other unknowns are then well-conditioned functions of them. The result has the value of each chosen unknown,
    rounded to ``decimals``, by its index.
    """
    with mp.workdps(40):
        J = np.array(equations.slopes(list(map(mpf, x))), dtype=float)
    directions = np.linalg.svd(J)[2][equations.harmonic_order :].T
    chosen: dict[int, str] = {}
    for _ in range(equations.free):
        u = int(np.argmax(np.sum(directions**2, axis=1)))
        chosen[u] = f"{x[u]:.{decimals}f}"
        row = directions[u] / np.linalg.norm(directions[u])
        directions = directions - np.outer(directions @ row, row)
    return chosen
