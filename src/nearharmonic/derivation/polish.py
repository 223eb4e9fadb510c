"""Newton's method in multiprecision: from a solution in double to as many decimals as are asked for, or to none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import lu_solve, matrix, mp, mpf

from nearharmonic.derivation.equations import Equations

#: Digits carried beyond those asked for: conditions multiply rounding by up to lambda! times the coefficients' powers.
GUARD = 30
#: Newton doubles the digits: seven iterations lead from double to 2000 digits.
ITERATIONS = 15


@dataclass(frozen=True)
class Polished:
    """A solution, or how far it came.

    ``residual`` is the largest |kappa| at the point reached and ``correction`` the largest step of the last iteration.
    ``unknowns`` (mpf), and the decimal strings of the ``outer`` and ``inner`` rows, are empty unless ``converged``.
    """

    converged: bool
    residual: Any
    correction: Any
    iterations: int
    unknowns: tuple[Any, ...]
    outer: tuple[str, ...]
    inner: tuple[str, ...]


def polish(equations: Equations, start: Sequence[Any], *, digits: int = 128, fixed: Sequence[int] = ()) -> Polished:
    """The solution near ``start``, with the unknowns of the indices ``fixed`` kept exactly.

    With more unknowns left than conditions, each step is the shortest that the linearised conditions allow. It has
    converged when a step and the residual fall below 10^-digits. Rows are rounded to ``digits`` decimals.
    """
    with mp.workdps(digits + GUARD):
        x = [mpf(n.numerator) / n.denominator if hasattr(n, "numerator") else mpf(n) for n in start]
        moving = [j for j in range(equations.unknowns) if j not in set(fixed)]
        tolerance, correction, used = mpf(10) ** -digits, mp.inf, 0
        for _ in range(ITERATIONS):
            step = _newton_step(equations, x, moving)
            if step is None:
                break
            used += 1
            for j, move in zip(moving, step, strict=True):
                x[j] += move
            correction = max(map(abs, step))
            if correction < tolerance or not correction < 1e6:
                break
        residual = max(map(abs, equations.residuals(x)))
        converged = bool(correction < tolerance and residual < tolerance)
        outer, inner = equations.rows(x) if converged else ([], [])
        return Polished(
            converged=converged,
            residual=residual,
            correction=correction,
            iterations=used,
            unknowns=tuple(x) if converged else (),
            outer=tuple(decimal(c, digits) for c in outer),
            inner=tuple(decimal(c, digits) for c in inner),
        )


def decimal(number: Any, digits: int) -> str:
    """``number`` (mpf) rounded to ``digits`` decimals, with a digit before the point."""
    scaled = int(mp.nint(number * mpf(10) ** digits))
    text = str(abs(scaled)).rjust(digits + 1, "0")
    return f"{'-' if scaled < 0 else ''}{text[:-digits]}.{text[-digits:]}"


def rank_and_pivots(equations: Equations, x: Sequence[Any], *, digits: int = 60) -> tuple[int, tuple[int, ...]]:
    """Rank of the Jacobian at ``x``, and the unknowns its conditions fix best: elimination with full pivoting.

    A pivot counts as zero when it is below 10^-(digits/2) of the largest.
    """
    with mp.workdps(digits):
        rows = equations.jacobian([mpf(n.numerator) / n.denominator if hasattr(n, "numerator") else mpf(n) for n in x])
        pivots: list[int] = []
        largest = mpf(0)
        while rows:
            size, i, j = max((abs(c), i, j) for i, row in enumerate(rows) for j, c in enumerate(row) if j not in pivots)
            largest = max(largest, size)
            if size <= largest * mpf(10) ** (-digits // 2):
                break
            chosen = rows.pop(i)
            pivots.append(j)
            rows = [[c - row[j] / chosen[j] * d for c, d in zip(row, chosen, strict=True)] for row in rows]
            if len(pivots) == equations.unknowns:
                break
        return len(pivots), tuple(sorted(pivots))


def _newton_step(equations: Equations, x: Sequence[Any], moving: Sequence[int]) -> list[Any] | None:
    """The shortest solution of J step = -residuals among the ``moving`` unknowns; None where J has no full rank."""
    full = equations.jacobian(x)
    jacobian = matrix([[row[j] for j in moving] for row in full])
    right = -matrix(equations.residuals(x))
    try:
        if jacobian.rows == jacobian.cols:
            return list(lu_solve(jacobian, right))
        return list(jacobian.T * lu_solve(jacobian * jacobian.T, right))
    except ZeroDivisionError:
        return None
