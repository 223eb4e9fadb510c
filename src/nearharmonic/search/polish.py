"""Solutions to any number of digits: Newton's method in multiprecision, with free parameters fixed as decimals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from mpmath import lu_solve, matrix, mp, mpf, nstr

from nearharmonic.errors import NearharmonicError
from nearharmonic.search.nystrom_equations import NystromEquations
from nearharmonic.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome

#: Newton steps from a solution in doubles or better: 10, 20, 40, ... digits; more than these mean there is none.
MOST_STEPS = 12


class NotConvergedError(NearharmonicError):
    """Newton's method did not reach a solution; the text says which residual it reached."""


def residuals(equations: NystromEquations, x: Sequence[Any]) -> list[Any]:
    """The residuals of ``equations`` at the unknowns ``x``, in mpmath's current precision."""
    table = equations.table
    sums = [mpf(1)] + [mpf(0)] * (len(table.words) - 1)
    for operator, c in zip(equations.letters, equations.coefficients(x), strict=True):
        for w in reversed(range(1, len(sums))):
            factor, v, k = mpf(1), w, 0
            # Words end with the operator's letter k times: c^k/k! of what stands before.
            while table.letter[v] == operator:
                v, k = table.parent[v], k + 1
                factor *= c / k
                sums[w] += factor * sums[v]
    values = dict(zip(table.words, sums, strict=True))
    return [
        sum(mpf(a.numerator) / a.denominator * values[word] for word, a in left.items())
        - mpf(right.numerator) / right.denominator
        for left, right in equations.equations
    ]


def jacobian(equations: NystromEquations, x: Sequence[Any], unknowns: Sequence[int]) -> Any:
    """Derivatives (equation, unknown) of the residuals by some of the ``unknowns``, to half of mpmath's digits."""
    base, h = residuals(equations, x), mpf(10) ** -(mp.dps // 2)
    found = matrix(len(base), len(unknowns))
    for column, u in enumerate(unknowns):
        ahead = residuals(equations, [value + h * (i == u) for i, value in enumerate(x)])
        for row, (a, b) in enumerate(zip(ahead, base, strict=True)):
            found[row, column] = (a - b) / h
    return found


def polished(
    equations: NystromEquations, x: Sequence[Any], *, fixed: Mapping[int, str] | None = None, digits: int = 90
) -> list[Any]:
    """The solution next to ``x`` as mpf to ``digits`` decimals, the unknowns ``fixed`` having the values named there.

    As many unknowns have to be fixed as parameters are free.

    Raises:
        NotConvergedError: the residual did not fall below 10^-digits, or a step had no unique solution.
    """
    values = dict(fixed or {})
    moving = [u for u in range(equations.unknowns) if u not in values]
    if len(values) != equations.free:
        message = f"{len(values)} unknowns are fixed, and {equations.free} are free"
        raise NotConvergedError(message)
    with mp.workdps(2 * digits + 20):
        point = [mpf(values.get(u, value)) for u, value in enumerate(x)]
        size = mpf("inf")
        for _ in range(MOST_STEPS):
            F = residuals(equations, point)
            size = max(map(abs, F))
            if size < mpf(10) ** -(digits + 5):
                return point
            if not size < 10**6:
                break
            try:
                step = lu_solve(jacobian(equations, point, moving), matrix(F))
            except ZeroDivisionError:
                break
            for u, change in zip(moving, step, strict=True):
                point[u] -= change
    message = f"{equations}: Newton's method ends at a residual of {nstr(size, 3)}, wanted 1e-{digits}"
    raise NotConvergedError(message)


def short_decimals(equations: NystromEquations, x: Sequence[float], decimals: int) -> dict[int, str]:
    """The free parameters of the family at the solution ``x``, as unknown -> decimal number to fix it at.

    Those unknowns are chosen along which the family moves most, so that the others follow from them in a stable way.
    """
    with mp.workdps(40):
        J = np.array(jacobian(equations, list(map(mpf, x)), range(equations.unknowns)).tolist(), dtype=float)
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
    """The tableau of a polished solution, its coefficients with two decimals more than the ``digits`` it guarantees."""
    with mp.workdps(digits + 30):
        step = equations.coefficients(x)
        rows = []
        for row in (step[0::2], step[1::2]):
            texts = [_fixed_point(c, digits + 2) for c in row[: (len(row) + 1) // 2]]
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


def _fixed_point(c: Any, decimals: int) -> str:
    """``c`` rounded to ``decimals`` decimals."""
    scaled = int(mp.nint(c * mpf(10) ** decimals))
    digits = f"{abs(scaled):0{decimals + 1}d}"
    return f"{'-' if scaled < 0 else ''}{digits[:-decimals]}.{digits[-decimals:]}"
