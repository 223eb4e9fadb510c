"""From a candidate in doubles to the tableau that is registered: named, its free parameters rounded, polished.

Newton's method in multiprecision gives any number of digits; free parameters are fixed as short decimals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpmath import mp, mpf, nstr

from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.decimals import fixed_point
from nearharmonic.exact.newton import newton
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic.reproduction.experiments.sixth_order.cascade import Candidate
from nearharmonic.reproduction.experiments.sixth_order.conditions import NYSTROM_ORDER, NystromEquations

#: Decimals to which free parameters are rounded: the criterion changes by less than 1e-3.
DECIMALS = 4


class NotConvergedError(NearharmonicError):
    """Newton's method did not reach a solution; the text says which residual it reached."""


def registered(candidate: Candidate, *, source: str, digits: int = 76) -> Tableau:
    """Return the tableau of a candidate, named after the paper's convention with the order before the harmonic order.

    Parameters
    ----------
    candidate : Candidate
        The solution in doubles.
    source : str
        Where the tableau is from.
    digits : int
        Decimals that it guarantees.

    Raises
    ------
    NotConvergedError
        The equations have no solution next to the rounded candidate.
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


def polished(
    equations: NystromEquations, x: Sequence[Any], *, fixed: Mapping[int, str] | None = None, digits: int = 90
) -> list[Any]:
    """Return the solution next to a point, as mpf.

    Parameters
    ----------
    equations : NystromEquations
        What it solves.
    x : sequence
        The unknowns to start from.
    fixed : mapping of int to str, optional
        Values of some unknowns, as many as parameters are free.
    digits : int
        Decimals of the solution.

    Raises
    ------
    NotConvergedError
        The residual did not fall below 10^-digits, or a step had no unique solution.
    """
    values = dict(fixed or {})
    if len(values) != equations.free:
        message = f"{len(values)} unknowns are fixed, and {equations.free} are free"
        raise NotConvergedError(message)
    with mp.workdps(2 * digits + 20):
        start = [mpf(values.get(u, value)) for u, value in enumerate(x)]
    limit = newton(equations.residuals, equations.slopes, start, digits=digits, fixed=tuple(values))
    if not limit.converged:
        message = f"{equations}: Newton's method ends at a residual of {nstr(limit.residual, 3)}, wanted 1e-{digits}"
        raise NotConvergedError(message)
    return list(limit.point)


def short_decimals(equations: NystromEquations, x: Sequence[float], decimals: int) -> dict[int, str]:
    """Choose the unknowns that are fixed as free parameters of a family: those along which it moves most.

    The others then follow from them in a stable way.

    Parameters
    ----------
    equations : NystromEquations
        The family.
    x : sequence of float
        A solution.
    decimals : int
        Decimals to which the values are rounded.

    Returns
    -------
    dict
        The decimal number of each chosen unknown, by its index.
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


def tableau_of_solution(
    equations: NystromEquations, x: Sequence[Any], *, name: str, label: str, source: str, digits: int, note: str = ""
) -> Tableau:
    """Return the tableau of a polished solution.

    Parameters
    ----------
    equations : NystromEquations
        What it solves.
    x : sequence of mpf
        The unknowns.
    name, label, source, note : str
        As the fields of :class:`Tableau`.
    digits : int
        Decimals that it guarantees; coefficients have two more.
    """
    with mp.workdps(digits + 30):
        rows = []
        for row in equations.palindromes(x):
            texts = [fixed_point(c, digits + 2) for c in row[: (len(row) + 1) // 2]]
            rows.append(palindrome(*texts[: len(row) // 2], centre=texts[-1] if len(row) % 2 else None))
    outer, inner = rows
    kick, drift = (outer, inner) if equations.first == "kick" else (inner, outer)
    return Tableau(
        name=name,
        label=label,
        order=6,
        first=equations.first,
        kick=kick,
        drift=drift,
        source=source,
        digits=digits,
        requires=QUADRATIC_KINETIC_ENERGY,
        note=note,
        harmonic_order=equations.harmonic_order,
    )
