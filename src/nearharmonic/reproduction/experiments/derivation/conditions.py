"""The harmonic order conditions of a symmetric tableau, in whatever arithmetic their unknowns come in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial

from mpmath import mp

from nearharmonic.errors import bad_setting
from nearharmonic.exact.decimals import BigFloat, decimals_in_common, fixed_point
from nearharmonic.exact.newton import GUARD, newton
from nearharmonic.integrators.tableau import First, Tableau

Numbers = list[BigFloat]

#: q(t) = cos t - sin t from q = -p = 1 (Nielsen 2015, Eq. 12 with a = -b = 1): its derivatives at 0 by order modulo 4.
DERIVATIVES = (1, -1, -1, 1)

#: kappa_0 and kappa_1 vanish with the row sums, kappa_2 for any symmetric step: the determinant of the step is 1.
LOWEST_CONDITION = 3


@dataclass(frozen=True)
class Equations:
    """The equations kappa_3 = ... = kappa_lambda = 0 (Nielsen 2015, Eq. 17) for the position after one symmetric step.

    The ``unknowns`` are the first half of the outer row and then that of the inner row, each without its innermost
    value, which the sum of the row gives. Unknowns may be mpf, Fraction, float or mpmath's intervals; results are of
    the same kind.

    Parameters
    ----------
    stages : int
        Number s of stages, at least 3.
    harmonic_order : int
        Harmonic order lambda, at least 3.
    first : {"kick", "drift"}
        Operator of the outer row.

    Raises
    ------
    SettingError
        Fewer than 3 stages, a harmonic order below 3, or an unknown operator.
    """

    stages: int
    harmonic_order: int
    first: First = "kick"

    def __post_init__(self) -> None:
        for key, lowest in (("stages", 3), ("harmonic_order", LOWEST_CONDITION)):
            number = getattr(self, key)
            if isinstance(number, bool) or not isinstance(number, int) or number < lowest:
                raise bad_setting(key, number, f"an integer >= {lowest}")
        if self.first not in ("drift", "kick"):
            key = "first"
            raise bad_setting(key, self.first, "it is 'drift' or 'kick'")

    @property
    def outer_unknowns(self) -> int:
        """Number of unknowns of the outer row."""
        return self.stages // 2

    @property
    def unknowns(self) -> int:
        """s - 1: half of the 2s + 1 coefficients, less one for the sum of each row."""
        return self.stages - 1

    @property
    def conditions(self) -> int:
        """lambda - 2."""
        return self.harmonic_order - LOWEST_CONDITION + 1

    @property
    def free_parameters(self) -> int:
        """Dimension of the solution set where the conditions are independent; 0 for isolated solutions."""
        return self.unknowns - self.conditions

    def rows(self, x: Sequence[BigFloat]) -> tuple[Numbers, Numbers]:
        """The outer row (s + 1 values) and the inner row (s values) for the unknowns ``x``."""
        cut = self.outer_unknowns
        return _closed(list(x[:cut]), self.stages + 1), _closed(list(x[cut:]), self.stages)

    def unknowns_of(self, outer: Sequence[BigFloat], inner: Sequence[BigFloat]) -> Numbers:
        """The unknowns of two rows: the inverse of :meth:`rows`."""
        cut = self.outer_unknowns
        return [*outer[:cut], *inner[: self.unknowns - cut]]

    def tableau_unknowns(self, tableau: Tableau) -> Numbers:
        """The unknowns of ``tableau`` in its own role, exact."""
        return self.unknowns_of(*tableau.rows_exact())

    def residuals(self, x: Sequence[BigFloat]) -> Numbers:
        """Signed kappa_3, ..., kappa_lambda: q^(l)(0) - l! zeta_l."""
        return self.errors(x, self.harmonic_order)[LOWEST_CONDITION - 1 :]

    def errors(self, x: Sequence[BigFloat], highest: int) -> Numbers:
        """Signed kappa_1, ..., kappa_highest, of which this case makes those up to its harmonic order vanish."""
        zeta = self._positions(self._operators(x), highest)[-1][0]
        return [DERIVATIVES[n % 4] - factorial(n) * zeta[n] for n in range(1, highest + 1)]

    def jacobian(self, x: Sequence[BigFloat]) -> list[Numbers]:
        """Derivatives of the residuals: one row per condition, one column per unknown."""
        operators, highest = self._operators(x), self.harmonic_order
        before = self._positions(operators, highest)
        gradients: list[Numbers] = [[] for _ in operators]
        # The new position is alpha q + beta p of any intermediate state: followed backwards from alpha = 1, beta = 0.
        zero = x[0] * 0
        alpha, beta = [zero + 1] + [zero] * highest, [zero] * (highest + 1)
        for k in reversed(range(len(operators))):
            drifts, c = operators[k]
            q, p = before[k]
            weight, moved, sign = (alpha, p, -1) if drifts else (beta, q, 1)
            gradients[k] = [
                sign * factorial(n) * sum((weight[i] * moved[n - 1 - i] for i in range(n)), zero)
                for n in range(LOWEST_CONDITION, highest + 1)
            ]
            if drifts:
                beta = [beta[0], *(b + c * a for b, a in zip(beta[1:], alpha, strict=False))]
            else:
                alpha = [alpha[0], *(a - c * b for a, b in zip(alpha[1:], beta, strict=False))]
        columns = [*_folded(gradients[0::2]), *_folded(gradients[1::2])]
        return [list(row) for row in zip(*columns, strict=True)]

    def _operators(self, x: Sequence[BigFloat]) -> list[tuple[bool, BigFloat]]:
        """(whether it drifts, coefficient) in the order of one step."""
        outer, inner = self.rows(x)
        drifts = self.first == "drift"
        operators = [(drifts, outer[0])]
        for i, c in enumerate(inner):
            operators += [(not drifts, c), (drifts, outer[i + 1])]
        return operators

    @staticmethod
    def _positions(operators: Sequence[tuple[bool, BigFloat]], highest: int) -> list[tuple[Numbers, Numbers]]:
        """(q, p) by powers of tau before each operator and after the last, from (1, -1)."""
        zero = operators[0][1] * 0
        q, p = [zero + 1] + [zero] * highest, [zero - 1] + [zero] * highest
        states = [(q, p)]
        for drifts, c in operators:
            if drifts:
                q = [q[0], *(a + c * b for a, b in zip(q[1:], p, strict=False))]
            else:
                p = [p[0], *(b - c * a for b, a in zip(p[1:], q, strict=False))]
            states.append((q, p))
        return states


@dataclass(frozen=True)
class PolishedSolution:
    """A solution, or how far Newton's method came: the fields of :class:`~nearharmonic.exact.newton.Limit`.

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
    """The solution near ``start``, its rows to ``digits`` decimals, with the unknowns of the indices ``fixed`` kept."""
    limit = newton(equations.residuals, equations.jacobian, start, digits=digits, fixed=fixed)
    with mp.workdps(digits + GUARD):
        outer, inner = equations.rows(limit.point) if limit.converged else ([], [])
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
    """Return the conditions that ``tableau`` declares to solve."""
    assert tableau.harmonic_order is not None
    return Equations(tableau.stages, tableau.harmonic_order, tableau.first)


def agreeing_decimals(tableau: Tableau, outer: Sequence[str], inner: Sequence[str]) -> int:
    """Return to how many decimals a tableau and derived rows agree.

    Agreement to n decimals is a difference below 10^-n: less than one unit of the last digit, however it was rounded.

    Parameters
    ----------
    tableau : Tableau
        A printed set.
    outer, inner : sequence of str
        The derived rows.

    Returns
    -------
    int
        The least number among the independent coefficients, at most the decimals that the tableau guarantees.
    """
    equations = equations_of(tableau)
    printed = equations.unknowns_of(tableau.outer, tableau.inner)
    derived = equations.unknowns_of(list(outer), list(inner))
    return min(decimals_in_common(a, b, tableau.digits) for a, b in zip(printed, derived, strict=True))


def _closed(half: Numbers, length: int) -> Numbers:
    """The palindrome of sum 1 that starts with ``half``."""
    total = sum(half[1:], half[0])
    centre = [1 - 2 * total] if length % 2 else [(1 - 2 * total) / 2] * 2
    return [*half, *centre, *reversed(half)]


def _folded(gradients: list[Numbers]) -> list[Numbers]:
    """Derivatives by the unknowns of a row from those by its coefficients: mirror images move with their originals."""
    length = len(gradients)
    count = (length - 1) // 2
    mirrored = [[a + b for a, b in zip(gradients[i], gradients[-1 - i], strict=True)] for i in range((length + 1) // 2)]
    # The centre of an odd row loses twice what an unknown gains; the fold above has counted it twice.
    return [[a - b for a, b in zip(mirrored[i], mirrored[count], strict=True)] for i in range(count)]
