"""Interval proof that a box about a point contains exactly one zero (Krawczyk 1969)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from mpmath import iv, matrix, mp, mpf

from nearharmonic.exact.decimals import BigFloat
from nearharmonic.exact.newton import Function, Jacobian

#: Number of guard digits, beyond those of the radius.
GUARD = 40


@dataclass(frozen=True)
class Proof:
    """Result of the test for exactly one zero in the box of half width ``radius``.

    ``distance`` is an upper bound of the distance between the point and the zero: the size of the Krawczyk image about
    the point.
    """

    proved: bool
    radius: BigFloat
    distance: BigFloat


def prove(
    function: Function,
    jacobian: Jacobian,
    point: Sequence[BigFloat],
    *,
    radius: str = "1e-70",
    fixed: Sequence[int] = (),
) -> Proof:
    """Krawczyk's test on the box of half width ``radius`` about ``point``.

    If K = m - Y F(m) + (1 - Y J(X)) (X - m) is in the interior of X, then X contains exactly one zero. Y is the inverse
    of the Jacobian at m, and F and J are evaluated in outward rounded intervals. A singular Jacobian proves nothing.

    Parameters
    ----------
    function, jacobian : callable
        Values, and derivatives (one row per value, one column per unknown), as functions of mpmath's intervals.
    point : sequence of int, Fraction or mpf
        The centre of the box, one number per unknown.
    radius : str
        Half width of the box, a decimal number.
    fixed : sequence of int
        Indices of the unknowns that have exactly the value of the point.
    """
    moving = [j for j in range(len(point)) if j not in set(fixed)]
    digits = GUARD + max(0, -int(mp.floor(mp.log10(mpf(radius)))))
    with mp.workdps(digits), _interval_digits(digits):
        centre = [_interval(n) for n in point]
        # The fixed unknowns must be exact: a proof with intervals for them is a proof for neighbouring problems.
        spread = iv.mpf([-mpf(radius), mpf(radius)])
        box = [c + spread if j in moving else c for j, c in enumerate(centre)]
        middle = matrix([[mpf(c.mid) for c in row] for row in _columns(jacobian(centre), moving)])
        try:
            preconditioner = middle**-1
        except ZeroDivisionError:
            return Proof(False, mpf(radius), mp.inf)
        count = len(moving)
        Y = [[iv.mpf(mpf(preconditioner[i, j])) for j in range(count)] for i in range(count)]
        J, F = _columns(jacobian(box), moving), function(centre)
        distance, proved = mpf(0), True
        for i in range(count):
            defect = [int(i == j) - sum((Y[i][k] * J[k][j] for k in range(count)), iv.mpf(0)) for j in range(count)]
            image = sum((d * spread for d in defect), iv.mpf(0)) - sum(
                (Y[i][k] * F[k] for k in range(count)), iv.mpf(0)
            )
            reach = abs(image).b
            proved = proved and bool(reach < spread.b)
            distance = max(distance, mpf(reach))
        return Proof(proved, mpf(radius), distance)


def _columns(rows: Sequence[Sequence[BigFloat]], chosen: Sequence[int]) -> list[list[BigFloat]]:
    return [[row[j] for j in chosen] for row in rows]


def _interval(number: BigFloat) -> BigFloat:
    """``number`` (int, Fraction or mpf) enclosed; a decimal fraction has no finite binary form."""
    if hasattr(number, "numerator"):
        return iv.mpf(number.numerator) / number.denominator
    return iv.mpf(number)


@contextmanager
def _interval_digits(digits: int) -> Iterator[None]:
    before = iv.dps
    iv.dps = digits
    try:
        yield
    finally:
        iv.dps = before
