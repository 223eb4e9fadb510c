"""The harmonic order conditions of a symmetric tableau, in the arithmetic of their unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial
from typing import Any

from mpmath import mp

from nearharmonic.exact.decimals import BigFloat, decimals_in_common, fixed_point
from nearharmonic.exact.newton import GUARD, newton
from nearharmonic.exact.step import POSITION, slopes, states
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.theory.symmetric import SymmetricSteps

Numbers = list[BigFloat]

#: q(t) = cos t - sin t from q = -p = 1 (Nielsen 2015, Eq. 12 with a = -b = 1): its derivatives at 0 by order modulo 4.
DERIVATIVES = (1, -1, -1, 1)

#: kappa_0 and kappa_1 vanish with the row sums, kappa_2 for any symmetric step: the determinant of the step is 1.
LOWEST_CONDITION = 3


@dataclass(frozen=True)
class Equations(SymmetricSteps):
    """The equations kappa_3 = ... = kappa_lambda = 0 (Nielsen 2015, Eq. 17) for the position after one symmetric step.

    Unknowns may be mpf, Fraction, float or intervals of mpmath; results have the same type.

    ``stages``: number s, at least 3. ``harmonic_order``: lambda, at least 3. ``first``: operator of the outer row.
    """

    stages: int
    harmonic_order: int
    first: First = "kick"

    @property
    def free_parameters(self) -> int:
        """Dimension of the solution set if the conditions are independent; 0 for isolated solutions."""
        return self.unknowns - (self.harmonic_order - LOWEST_CONDITION + 1)

    def tableau_unknowns(self, tableau: Tableau) -> Numbers:
        """Return the exact unknowns of ``tableau`` in its declared role."""
        return self.halved(*tableau.rows_exact())

    def tableau(self, outer: Sequence[str], inner: Sequence[str], **about: Any) -> Tableau:
        """The integrator of order 4 with these rows; ``about`` are other members of :class:`Tableau`."""
        kick, drift = (outer, inner) if self.first == "kick" else (inner, outer)
        return Tableau(order=4, first=self.first, kick=tuple(kick), drift=tuple(drift), **about)

    def residuals(self, x: Sequence[BigFloat]) -> Numbers:
        """Return signed kappa_3, ..., kappa_lambda: q^(l)(0) - l! zeta_l."""
        return self.errors(x, self.harmonic_order)[LOWEST_CONDITION - 1 :]

    def errors(self, x: Sequence[BigFloat], highest: int) -> Numbers:
        """Return signed kappa_1, ..., kappa_highest; the conditions make them vanish up to the harmonic order."""
        zeta = states(self.step(x), highest)[-1][0]
        return [DERIVATIVES[n % 4] - factorial(n) * zeta[n] for n in range(1, highest + 1)]

    def jacobian(self, x: Sequence[BigFloat]) -> list[Numbers]:
        """Return the derivatives of the residuals: one row per condition, one column per unknown."""
        powers = range(LOWEST_CONDITION, self.harmonic_order + 1)
        by_factor = slopes(self.step(x), self.harmonic_order, POSITION)
        gradients = [[-factorial(n) * row[n] for n in powers] for row in by_factor]
        columns = [*_folded(gradients[0::2]), *_folded(gradients[1::2])]
        return [list(row) for row in zip(*columns, strict=True)]


@dataclass(frozen=True)
class PolishedSolution:
    """A solution, or the last state of Newton's method: the fields of :class:`~nearharmonic.exact.newton.Limit`.

    ``unknowns`` (mpf), and the decimal strings of the ``outer`` and ``inner`` rows, are empty unless ``converged``.
    """

    converged: bool
    residual: BigFloat
    correction: BigFloat
    iterations: int
    unknowns: tuple[BigFloat, ...]
    outer: tuple[str, ...]
    inner: tuple[str, ...]


def polish(
    equations: Equations, start: Sequence[BigFloat], *, digits: int = 128, fixed: Sequence[int] = ()
) -> PolishedSolution:
    """Return the solution near ``start``, its rows to ``digits`` decimals; unknowns with indices ``fixed`` are kept."""
    limit = newton(equations.residuals, equations.jacobian, start, digits=digits, fixed=fixed)
    with mp.workdps(digits + GUARD):
        outer, inner = equations.palindromes(limit.point) if limit.converged else ([], [])
    return PolishedSolution(
        converged=limit.converged,
        residual=limit.residual,
        correction=limit.correction,
        iterations=limit.iterations,
        unknowns=limit.point if limit.converged else (),
        outer=tuple(fixed_point(c, digits) for c in outer),
        inner=tuple(fixed_point(c, digits) for c in inner),
    )


def equations_of(tableau: Tableau) -> Equations:
    """Return the conditions that ``tableau`` solves according to its declaration."""
    assert tableau.harmonic_order is not None
    return Equations(tableau.stages, tableau.harmonic_order, tableau.first)


def agreeing_decimals(tableau: Tableau, outer: Sequence[str], inner: Sequence[str]) -> int:
    """Return the number of decimals to which a tableau and derived rows agree.

    Agreement to n decimals is a difference below 10^-n: less than one unit of the last digit, for any rounding. The
    number is the minimum over the independent coefficients, at most the guaranteed decimals of the tableau.
    """
    equations = equations_of(tableau)
    printed = equations.halved(tableau.outer, tableau.inner)
    derived = equations.halved(list(outer), list(inner))
    return min(decimals_in_common(a, b, tableau.digits) for a, b in zip(printed, derived, strict=True))


def _folded(gradients: list[Numbers]) -> list[Numbers]:
    """Return the derivatives by the unknowns of a row from those by its coefficients: mirror images change together."""
    length = len(gradients)
    count = (length - 1) // 2
    mirrored = [[a + b for a, b in zip(gradients[i], gradients[-1 - i], strict=True)] for i in range((length + 1) // 2)]
    # The centre of an odd row changes by -2 times the change of an unknown; the fold above has counted it twice.
    return [[a - b for a, b in zip(mirrored[i], mirrored[count], strict=True)] for i in range(count)]
