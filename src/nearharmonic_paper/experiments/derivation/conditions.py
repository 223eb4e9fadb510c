"""Harmonic order conditions of a symmetric tableau, and their solutions by exact elimination."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial, prod
from typing import Any

from mpmath import mp, mpf

from nearharmonic.exact.polynomials import (
    GUARD,
    BigFloat,
    Echelon,
    Multivariate,
    PowerSeries,
    Quotient,
    SparseVector,
    add,
    as_mpf,
    constants,
    decimals_in_common,
    fixed_point,
    inverse,
    newton,
    real_root_count,
    real_roots,
    sturm_chain,
    variable,
    weight,
    whole,
)
from nearharmonic.exact.polynomials import multivariate_product as product
from nearharmonic.exact.words import POSITION, slopes, states
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.theory.order_conditions import SymmetricSteps

# --- The harmonic order conditions of a symmetric tableau, in the arithmetic of their unknowns.

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
    """A solution, or the last state of Newton's method: the fields of :class:`~nearharmonic.exact.polynomials.Limit`.

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


# --- All solutions of a case without free parameters, by exact elimination: numbers of complex and real solutions.
#
# Half a symmetric step, up to the centre of the tableau, is a matrix H = [[A, B], [C, D]] of polynomials in tau with
# A D
# - B C = 1, A and D even, B and C odd; the step is K = [[A D + B C, 2 B D], [2 A C, A D + B C]]. The conditions on the
# position up to tau^lambda then read A D = cos(tau/2)^2 and B D = sin(tau/2) cos(tau/2) up to that power, so that one
# of
# the polynomials (B or D) determines the others as truncated series. The remaining conditions are that A D - B C has no
# higher powers. Let y_i, with weight i, be the coefficients of tau^(2i) of this polynomial. The remaining conditions in
# y_i have weights w_1, ..., w_k, and their leading parts have y = 0 as the only common zero. By Bezout's theorem there
# are then exactly w_1 ... w_k / k! complex solutions with their multiplicities, and the quotient ring has that
# dimension.
#
# The coefficients follow from A and B by Euclid's algorithm, so different solutions in y have different tableaus.
# Solutions without a tableau (a degree is too low) can only reduce the number of tableaus.

#: Bits of the isolating intervals of the roots of the eliminant: sufficient as starts of Newton's method.
BITS = 400


@dataclass(frozen=True)
class ReducedSystem:
    """The remaining conditions in y_1, ..., y_k, their weights, and the series A and B in terms of y."""

    variables: int
    conditions: tuple[Multivariate, ...]
    weights: tuple[int, ...]
    A: PowerSeries
    B: PowerSeries
    C: PowerSeries
    D: PowerSeries

    @property
    def complex_solutions(self) -> int:
        """Number of complex solutions with their multiplicities."""
        return prod(self.weights) // factorial(self.variables)


@dataclass(frozen=True)
class Elimination:
    """Results of a case, proved by elimination.

    ``complex_solutions`` is the degree of ``eliminant``, the minimal polynomial of y_1; if ``simple``, it has no
    multiple root, and its real roots correspond to the real solutions. ``starts`` holds the tableau unknowns of each
    real solution (as floats of 50 digits), for Newton's method; fewer than ``real_solutions`` if some have no tableau.
    """

    complex_solutions: int
    real_solutions: int
    simple: bool
    eliminant: tuple[int, ...]
    starts: tuple[tuple[Any, ...], ...]


def eliminate(equations: Equations) -> Elimination:
    """Return all real solutions for position of a case without free parameters, exactly.

    This takes 0.01, 0.01, 0.3 and 2 s for 5, 6, 7 and 8 stages.
    """
    system = reduced_system(equations)
    ring = Quotient(system.conditions, system.weights)
    powers = [ring.one]
    for _ in range(system.complex_solutions):
        powers.append(ring.times_first(powers[-1]))
    relations = Echelon()
    relation: SparseVector | None = None
    for n, power in enumerate(powers):
        relation = relations.insert(power, n)
        if relation is not None:
            break
    assert relation is not None  # N + 1 vectors in a space of dimension N
    eliminant = whole([relation.get(n, Fraction(0)) for n in range(max(relation) + 1)])
    chain = sturm_chain(eliminant)
    simple = len(eliminant) - 1 == system.complex_solutions and len(chain[-1]) == 1
    others = [relations.express(ring.coordinate(i)) for i in range(system.variables)] if simple else []
    points = []
    with mp.workdps(BITS // 4):
        for root in real_roots(eliminant, BITS) if simple else ():
            y = [sum((c * root**n for n, c in other.items()), Fraction(0)) for other in others]
            start = _tableau_unknowns(equations, system, list(map(as_mpf, y)))
            if start is not None:
                points.append(start)
    return Elimination(system.complex_solutions, real_root_count(chain), simple, tuple(eliminant), tuple(points))


def reduced_system(equations: Equations) -> ReducedSystem:
    """Return the polynomial conditions in y that are equivalent to ``equations`` of harmonic order stages + 1."""
    s = equations.stages
    m, odd = s // 2, s % 2 == 1
    length = m + 2
    sine = [Fraction((-1) ** i, 2 * factorial(2 * i + 1)) for i in range(length)]  # sin(tau/2) cos(tau/2) / tau
    cosine = [Fraction(1), *(Fraction((-1) ** i, 2 * factorial(2 * i)) for i in range(1, length))]  # cos(tau/2)^2
    k = m if odd or equations.first == "drift" else m - 1
    one: Multivariate = {(0,) * k: Fraction(1)}
    y = [one, *(variable(i, k) for i in range(k))]
    sin_cos, cos_cos = constants(sine, k), constants(cosine, k)
    tangent = product(sin_cos, inverse(cos_cos, length), length)
    if odd:  # B, C and D have m + 1 coefficients, A one more
        D = y
        A, B = product(inverse(D, m + 2), cos_cos, m + 2), product(inverse(D, m + 1), sin_cos, m + 1)
        C = _negative(product(D, tangent, m + 1))
    elif equations.first == "drift":  # exchanged roles: 2 A C has to be the sine
        A = y
        D, C = product(inverse(A, m + 1), cos_cos, m + 1), _negative(product(inverse(A, m + 1), sin_cos, m + 1))
        B = product(A, tangent, m)
    else:  # B has m coefficients, A and D one more; only the determinant fixes one coefficient of C
        b = y
        B = [{n: c / 2 for n, c in p.items()} for p in b]
        D = product(inverse(b, m + 1), [{n: 2 * c for n, c in p.items()} for p in sin_cos], m + 1)
        A = product(inverse(D, m + 1), cos_cos, m + 1)
        rest = [{n: 2 * c for n, c in p.items()} for p in product(A, D, m + 2)[1:]]
        C = product(inverse(b, m + 1), rest, m + 1)
    determinant = product(A, D, s + 1)
    determinant = [add(p, q, -1) for p, q in zip(determinant, [{}, *product(B, C, s)], strict=True)]
    conditions = [p for p in determinant[1:] if p]
    weights = [max(map(weight, p)) for p in conditions]
    return ReducedSystem(k, tuple(conditions), tuple(weights), A, B, C, D)


def _negative(series: PowerSeries) -> PowerSeries:
    return [{n: -c for n, c in p.items()} for p in series]


def _tableau_unknowns(equations: Equations, system: ReducedSystem, y: Sequence[Any]) -> tuple[Any, ...] | None:
    """Return the coefficients of the tableau for A and B, by Euclid's algorithm; None if a degree is too low."""
    A, B = ([_value(p, y) for p in series] for series in (system.A, system.B))
    outer, inner = [], []
    smallest = mpf(2) ** (-BITS // 4)
    for degree in range(len(A) - 1, 0, -1):
        if abs(B[degree - 1]) < smallest:
            return None
        a = -A[degree] / B[degree - 1]
        A = [A[0], *(A[i] + a * B[i - 1] for i in range(1, degree))]
        outer.append(a)
        if abs(A[degree - 1]) < smallest:
            return None
        b = B[degree - 1] / A[degree - 1]
        B = [B[i] - b * A[i] for i in range(degree - 1)] or [mpf(0)]
        inner.append(b)
    return tuple(equations.halved(outer, inner))


def _value(p: Multivariate, y: Sequence[Any]) -> Any:
    terms = (as_mpf(c) * prod(v**e for v, e in zip(y, n, strict=True)) for n, c in p.items())
    return sum(terms, mpf(0))
