"""Refinement of a member of a family from doubles to a tableau of many digits, with minimal change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mpmath import mp, mpf, nstr

from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.decimals import BigFloat, fixed_point
from nearharmonic.exact.newton import newton
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic.integrators.theory.symmetric import ConditionedSteps

#: Guaranteed decimals of a polished tableau.
DIGITS = 60
#: Default of the largest change of an unknown: doubles that fulfil the equations to 1e-10 need smaller changes.
NEAREST = 1e-8


class NotConvergedError(NearharmonicError):
    """Newton's method did not reach a member of the family near the point; the text has its last residual."""


def polished(
    family: ConditionedSteps,
    unknowns: Sequence[float],
    digits: int = DIGITS,
    *,
    fixed: Mapping[int, str] | None = None,
    nearest: float = NEAREST,
) -> list[BigFloat]:
    """Return the member of a family next to a point, as mpf.

    Parameters
    ----------
    family : ConditionedSteps
        Family whose equations are solved.
    unknowns : sequence of n float
        The point.
    digits : int
        Decimals of the solution.
    fixed : mapping of int to str, optional
        Decimal values of fixed unknowns, by their index.
    nearest : float
        Largest change of an unknown.

    Raises
    ------
    NotConvergedError
        The equations have no solution within ``nearest``.
    """
    values = dict(fixed or {})
    with mp.workdps(2 * digits + 20):
        start = [mpf(values.get(i, float(x))) for i, x in enumerate(unknowns)]
    limit = newton(family.residuals, family.slopes, start, digits=digits, fixed=tuple(values))
    moved = max((abs(a - b) for a, b in zip(limit.point, start, strict=True)), default=mpf(0))
    if not limit.converged or moved > nearest:
        raise NotConvergedError(
            f"{family}: Newton's method ends at a residual of {nstr(limit.residual, 3)}, {nstr(moved, 3)} away; wanted "
            f"1e-{digits} within {nearest:g}"
        )
    return list(limit.point)


def tableau_of(
    family: ConditionedSteps,
    unknowns: Sequence[float],
    *,
    digits: int = DIGITS,
    fixed: Mapping[int, str] | None = None,
    nearest: float = NEAREST,
    **about: Any,
) -> Tableau:
    """Return the tableau of the member next to ``unknowns``.

    Parameters
    ----------
    family, unknowns, fixed, nearest
        As for :func:`polished`, as are the errors.
    digits : int
        Decimals that the tableau guarantees; coefficients have two more.
    **about
        Fields of :class:`Tableau`: name, label, source, note.
    """
    with mp.workdps(2 * digits + 20):
        kicks, drifts, squares = family.rows(polished(family, unknowns, digits + 10, fixed=fixed, nearest=nearest))
        rows = {"kick": _texts(kicks, digits), "drift": _texts(drifts, digits)}
        given: dict[str, Any] = {"first": family.first, "digits": digits, **rows, **about}
        if family.squares:
            given["square"] = _texts(squares, digits)
    # What has a higher order for some V alone has order 4 for others.
    order = family.order if family.potential_degree is None else 4
    return Tableau(**given, order=order, requires=QUADRATIC_KINETIC_ENERGY if order > 4 else None)


def _texts(row: Sequence[BigFloat], digits: int) -> tuple[str, ...]:
    """Return a symmetric row as decimals, with "0" for exact zeros."""
    texts = [fixed_point(c, digits + 2) if c else "0" for c in row[: (len(row) + 1) // 2]]
    return palindrome(*texts[: len(row) // 2], centre=texts[-1] if len(row) % 2 else None)
