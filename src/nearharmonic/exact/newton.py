"""Newton's method in multiprecision for smooth functions, and a proof that a box contains exactly one zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from mpmath import iv, lu_solve, matrix, mp, mpf

from nearharmonic.exact.decimals import BigFloat, as_mpf

# --- Newton's method in multiprecision for smooth functions.

#: The values of a function at a point.
Function = Callable[[Sequence[BigFloat]], Sequence[BigFloat]]
#: The derivatives of a function at a point: one row per value, one column per unknown.
Jacobian = Callable[[Sequence[BigFloat]], Sequence[Sequence[BigFloat]]]

#: Number of guard digits: conditions multiply rounding errors by up to lambda! times powers of the coefficients.
GUARD = 30
#: Newton's method doubles the digits: seven iterations lead from double precision to 2000 digits.
ITERATIONS = 15


@dataclass(frozen=True)
class Limit:
    """The last ``point`` (mpf) of Newton's method, with a flag that it is a solution.

    ``residual`` is the largest modulus of the function values at the point, and ``correction`` the largest step of the
    last iteration.
    """

    converged: bool
    residual: BigFloat
    correction: BigFloat
    iterations: int
    point: tuple[BigFloat, ...]


def newton(
    function: Function,
    jacobian: Jacobian,
    start: Sequence[BigFloat],
    *,
    digits: int,
    fixed: Sequence[int] = (),
) -> Limit:
    """The zero of ``function`` near ``start``.

    If there are more free unknowns than values, each step is the shortest solution of the linearised equations. The
    iteration has converged when a step and the residual are below 10^-``digits``. The unknowns of the indices ``fixed``
    keep their values.
    """
    with mp.workdps(digits + GUARD):
        x = list(map(as_mpf, start))
        moving = [j for j in range(len(x)) if j not in set(fixed)]
        tolerance, correction, used = mpf(10) ** -digits, mp.inf, 0
        for _ in range(ITERATIONS):
            step = _shortest_step(function(x), jacobian(x), moving)
            if step is None:
                break
            used += 1
            for j, move in zip(moving, step, strict=True):
                x[j] += move
            correction = max(map(abs, step))
            if correction < tolerance or not correction < 1e6:
                break
        residual = max(map(abs, function(x)))
        return Limit(bool(correction < tolerance and residual < tolerance), residual, correction, used, tuple(x))


def rank_and_pivots(jacobian: Jacobian, x: Sequence[BigFloat], *, digits: int = 60) -> tuple[int, tuple[int, ...]]:
    """Rank of the Jacobian at ``x``, and the unknowns of the pivots, by elimination with full pivoting.

    A pivot counts as zero if it is below 10^-(``digits``/2) times the largest.
    """
    with mp.workdps(digits):
        rows = [list(row) for row in jacobian(list(map(as_mpf, x)))]
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
            if len(pivots) == len(x):
                break
        return len(pivots), tuple(sorted(pivots))


def _shortest_step(
    values: Sequence[BigFloat], rows: Sequence[Sequence[BigFloat]], moving: Sequence[int]
) -> list[BigFloat] | None:
    """The shortest solution of J step = -values among the ``moving`` unknowns; None if J does not have full rank."""
    J = matrix([[row[j] for j in moving] for row in rows])
    try:
        if J.rows == J.cols:
            return list(lu_solve(J, -matrix(values)))
        return list(J.T * lu_solve(J * J.T, -matrix(values)))
    except ZeroDivisionError:
        return None


#: Number of guard digits, beyond those of the radius.
KRAWCZYK_GUARD = 40


# --- Interval proof that a box about a point contains exactly one zero (Krawczyk 1969).
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

    ``function`` and ``jacobian`` (one row per value, one column per unknown) are of mpmath's intervals; the unknowns of
    the indices ``fixed`` have exactly the value of the point.
    """
    moving = [j for j in range(len(point)) if j not in set(fixed)]
    digits = KRAWCZYK_GUARD + max(0, -int(mp.floor(mp.log10(mpf(radius)))))
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
