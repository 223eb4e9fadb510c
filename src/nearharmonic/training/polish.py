"""From a member of a family in doubles to a tableau of many digits, moved onto the equations as little as may be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import mp, mpf, nstr

from nearharmonic.errors import NearharmonicError
from nearharmonic.exact.decimals import BigFloat, fixed_point
from nearharmonic.exact.newton import newton
from nearharmonic.integrators.tableau import QUADRATIC_KINETIC_ENERGY, Tableau, palindrome
from nearharmonic.training.family import Family

#: Decimals that a polished tableau guarantees.
DIGITS = 60
#: Largest change of an unknown: doubles that meet the equations to 1e-10 are nearer.
NEAREST = 1e-8


class NotConvergedError(NearharmonicError):
    """Newton's method did not reach a member of the family next to the point; the text says where it ended."""


def polished(family: Family, unknowns: Sequence[float], digits: int = DIGITS) -> list[BigFloat]:
    """Return the member of a family next to a point, as mpf.

    Parameters
    ----------
    family : Family
        Whose equations are solved.
    unknowns : sequence of n float
        The point.
    digits : int
        Decimals of the solution.

    Raises
    ------
    NotConvergedError
        The equations have no solution within :data:`NEAREST`.
    """
    start = [mpf(float(x)) for x in unknowns]
    limit = newton(family.residuals, family.slopes, start, digits=digits)
    moved = max((abs(a - b) for a, b in zip(limit.point, start, strict=True)), default=mpf(0))
    if not limit.converged or moved > NEAREST:
        message = (
            f"{family}: Newton's method ends at a residual of {nstr(limit.residual, 3)}, {nstr(moved, 3)} away; wanted "
            f"1e-{digits} within {NEAREST:g}"
        )
        raise NotConvergedError(message)
    return list(limit.point)


def tableau_of(family: Family, unknowns: Sequence[float], *, digits: int = DIGITS, **about: Any) -> Tableau:
    """Return the tableau of the member next to ``unknowns``.

    Parameters
    ----------
    family : Family
        The family.
    unknowns : sequence of n float
        A point next to one of its members.
    digits : int
        Decimals that the tableau guarantees; coefficients have two more.
    **about
        Fields of :class:`Tableau`: name, label, source, note.

    Raises
    ------
    NotConvergedError
        As for :func:`polished`.
    """
    with mp.workdps(2 * digits + 20):
        kicks, drifts, squares = family.rows(polished(family, unknowns, digits + 10))
        rows = {"kick": _texts(kicks, digits), "drift": _texts(drifts, digits)}
        given: dict[str, Any] = {"first": family.first, "digits": digits, **rows, **about}
        if family.squares:
            given["square"] = _texts(squares, digits)
    needs = QUADRATIC_KINETIC_ENERGY if family.order > 4 else None
    return Tableau(**given, order=family.order, requires=needs)


def _texts(row: Sequence[BigFloat], digits: int) -> tuple[str, ...]:
    """A symmetric row as decimals, with "0" for what is exactly 0."""
    texts = [fixed_point(c, digits + 2) if c else "0" for c in row[: (len(row) + 1) // 2]]
    return palindrome(*texts[: len(row) // 2], centre=texts[-1] if len(row) % 2 else None)
