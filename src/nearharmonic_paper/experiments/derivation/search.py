"""Harmonic order conditions of a symmetric tableau, and three ways to their solutions."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial, prod
from operator import itemgetter
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from gmpy2 import mpz
from mpmath import mp, mpf

from nearharmonic.core.numba_code import jit
from nearharmonic.exact import polynomials, words
from nearharmonic.integrators.tableau import First, Tableau
from nearharmonic.numerics.compiled import Damping, RandomStarts, distinct, iteration, marquardt_step
from nearharmonic.numerics.portable import Bools, Floats
from nearharmonic.output.table import progress
from nearharmonic.theory.order_conditions import SymmetricSteps

# --- The harmonic order conditions of a symmetric tableau, in the arithmetic of their unknowns.

Numbers = list[polynomials.BigFloat]

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

    def residuals(self, x: Sequence[polynomials.BigFloat]) -> Numbers:
        """Return signed kappa_3, ..., kappa_lambda: q^(l)(0) - l! zeta_l."""
        return self.errors(x, self.harmonic_order)[LOWEST_CONDITION - 1 :]

    def errors(self, x: Sequence[polynomials.BigFloat], highest: int) -> Numbers:
        """Return signed kappa_1, ..., kappa_highest; the conditions make them vanish up to the harmonic order."""
        zeta = words.states(self.step(x), highest)[-1][0]
        return [DERIVATIVES[n % 4] - factorial(n) * zeta[n] for n in range(1, highest + 1)]

    def jacobian(self, x: Sequence[polynomials.BigFloat]) -> list[Numbers]:
        """Return the derivatives of the residuals: one row per condition, one column per unknown."""
        powers = range(LOWEST_CONDITION, self.harmonic_order + 1)
        by_factor = words.slopes(self.step(x), self.harmonic_order, words.POSITION)
        gradients = [[-factorial(n) * row[n] for n in powers] for row in by_factor]
        columns = [*_folded(gradients[0::2]), *_folded(gradients[1::2])]
        return [list(row) for row in zip(*columns, strict=True)]


@dataclass(frozen=True)
class PolishedSolution:
    """A solution, or the last state of Newton's method: the fields of :class:`~nearharmonic.exact.polynomials.Limit`.

    ``unknowns`` (mpf), and the decimal strings of the ``outer`` and ``inner`` rows, are empty unless ``converged``.
    """

    converged: bool
    residual: polynomials.BigFloat
    correction: polynomials.BigFloat
    iterations: int
    unknowns: tuple[polynomials.BigFloat, ...]
    outer: tuple[str, ...]
    inner: tuple[str, ...]


def polish(
    equations: Equations, start: Sequence[polynomials.BigFloat], *, digits: int = 128, fixed: Sequence[int] = ()
) -> PolishedSolution:
    """Return the solution near ``start``, its rows to ``digits`` decimals; unknowns with indices ``fixed`` are kept."""
    limit = polynomials.newton(equations.residuals, equations.jacobian, start, digits=digits, fixed=fixed)
    point = limit.point if limit.converged else ()
    with mp.workdps(digits + polynomials.GUARD):
        rows = equations.palindromes(point) if limit.converged else ((), ())
    outer, inner = (tuple(polynomials.fixed_point(c, digits) for c in row) for row in rows)
    return PolishedSolution(limit.converged, limit.residual, limit.correction, limit.iterations, point, outer, inner)


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
    return min(polynomials.decimals_in_common(a, b, tableau.digits) for a, b in zip(printed, derived, strict=True))


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
# A D - B C = 1, A and D even, B and C odd; the step is K = [[A D + B C, 2 B D], [2 A C, A D + B C]]. The conditions on
# the position up to tau^lambda then read A D = cos(tau/2)^2 and B D = sin(tau/2) cos(tau/2) up to that power, so that
# one of the polynomials (B or D) determines the others as truncated series. The remaining conditions are that
# A D - B C has no higher powers. Let y_i, with weight i, be the coefficients of tau^(2i) of this polynomial. The
# remaining conditions in y_i have weights w_1, ..., w_k, and their leading parts have y = 0 as the only common zero. By
# Bezout's theorem there are then exactly w_1 ... w_k / k! complex solutions with their multiplicities, and the quotient
# ring has that dimension.
#
# The coefficients follow from A and B by Euclid's algorithm, so different solutions in y have different tableaus.
# Solutions without a tableau (a degree is too low) can only reduce the number of tableaus.

#: Bits of the isolating intervals of the roots of the eliminant: sufficient as starts of Newton's method.
BITS = 400


@dataclass(frozen=True)
class ReducedSystem:
    """The remaining conditions in y_1, ..., y_k, their weights, and the series A and B in terms of y."""

    variables: int
    conditions: tuple[polynomials.Multivariate, ...]
    weights: tuple[int, ...]
    A: polynomials.PowerSeries
    B: polynomials.PowerSeries

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
    ring = polynomials.Quotient(system.conditions, system.weights)
    powers = [ring.one]
    for _ in range(system.complex_solutions):
        powers.append(ring.times_first(powers[-1]))
    relations = polynomials.Echelon()
    relation: polynomials.SparseVector | None = None
    for n, power in enumerate(powers):
        relation = relations.insert(power, n)
        if relation is not None:
            break
    assert relation is not None  # N + 1 vectors in a space of dimension N
    eliminant = polynomials.whole([relation.get(n, Fraction(0)) for n in range(max(relation) + 1)])
    chain = polynomials.sturm_chain(eliminant)
    simple = len(eliminant) - 1 == system.complex_solutions and len(chain[-1]) == 1
    others = [relations.express(ring.coordinate(i)) for i in range(system.variables)] if simple else []
    points = []
    with mp.workdps(BITS // 4):
        for root in polynomials.real_roots(eliminant, BITS) if simple else ():
            y = [sum((c * root**n for n, c in other.items()), Fraction(0)) for other in others]
            start = _tableau_unknowns(equations, system, list(map(polynomials.as_mpf, y)))
            if start is not None:
                points.append(start)
    return Elimination(
        system.complex_solutions, polynomials.real_root_count(chain), simple, tuple(eliminant), tuple(points)
    )


def reduced_system(equations: Equations) -> ReducedSystem:
    """Return the polynomial conditions in y that are equivalent to ``equations`` of harmonic order stages + 1."""
    s = equations.stages
    m, odd = s // 2, s % 2 == 1
    length = m + 2
    sine = [Fraction((-1) ** i, 2 * factorial(2 * i + 1)) for i in range(length)]  # sin(tau/2) cos(tau/2) / tau
    cosine = [Fraction(1), *(Fraction((-1) ** i, 2 * factorial(2 * i)) for i in range(1, length))]  # cos(tau/2)^2
    k = m if odd or equations.first == "drift" else m - 1
    one: polynomials.Multivariate = {(0,) * k: Fraction(1)}
    y = [one, *(polynomials.variable(i, k) for i in range(k))]
    sin_cos, cos_cos = polynomials.constants(sine, k), polynomials.constants(cosine, k)
    tangent = polynomials.multivariate_product(sin_cos, polynomials.inverse(cos_cos, length), length)
    if odd:  # B, C and D have m + 1 coefficients, A one more
        D = y
        A, B = (
            polynomials.multivariate_product(polynomials.inverse(D, m + 2), cos_cos, m + 2),
            polynomials.multivariate_product(polynomials.inverse(D, m + 1), sin_cos, m + 1),
        )
        C = _negative(polynomials.multivariate_product(D, tangent, m + 1))
    elif equations.first == "drift":  # exchanged roles: 2 A C has to be the sine
        A = y
        D, C = (
            polynomials.multivariate_product(polynomials.inverse(A, m + 1), cos_cos, m + 1),
            _negative(polynomials.multivariate_product(polynomials.inverse(A, m + 1), sin_cos, m + 1)),
        )
        B = polynomials.multivariate_product(A, tangent, m)
    else:  # B has m coefficients, A and D one more; only the determinant fixes one coefficient of C
        b = y
        B = [{n: c / 2 for n, c in p.items()} for p in b]
        D = polynomials.multivariate_product(
            polynomials.inverse(b, m + 1), [{n: 2 * c for n, c in p.items()} for p in sin_cos], m + 1
        )
        A = polynomials.multivariate_product(polynomials.inverse(D, m + 1), cos_cos, m + 1)
        rest = [{n: 2 * c for n, c in p.items()} for p in polynomials.multivariate_product(A, D, m + 2)[1:]]
        C = polynomials.multivariate_product(polynomials.inverse(b, m + 1), rest, m + 1)
    determinant = polynomials.multivariate_product(A, D, s + 1)
    determinant = [
        polynomials.add(p, q, -1)
        for p, q in zip(determinant, [{}, *polynomials.multivariate_product(B, C, s)], strict=True)
    ]
    conditions = [p for p in determinant[1:] if p]
    weights = [max(map(polynomials.weight, p)) for p in conditions]
    return ReducedSystem(k, tuple(conditions), tuple(weights), A, B)


def _negative(series: polynomials.PowerSeries) -> polynomials.PowerSeries:
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


def _value(p: polynomials.Multivariate, y: Sequence[Any]) -> Any:
    terms = (polynomials.as_mpf(c) * prod(v**e for v, e in zip(y, n, strict=True)) for n, c in p.items())
    return sum(terms, mpf(0))


# --- Compiled part of the search from random starts: conditions and derivatives in doubles, and the iteration.
#
# A case has its number s of stages, its highest harmonic order, and a flag for drift as the outer row. The states of a
# step are series in tau, with powers from 0 to the highest order.

#: Maximum number of steps: convergent starts need 10 to 60 steps until no unknown changes.
DAMPING = Damping(
    iterations=200, rest=1e-10, undamped=1e-10, first=1e-2, fall=(1.0, 10.0), rise=8.0, lowest=(1e-16, 1e-12), most=1e12
)


class Case(NamedTuple):
    """Parameters of a case for the kernels."""

    stages: int
    highest: int
    drift_first: bool


@jit
def solve(case: Case, starts: Floats, bound: float) -> tuple[Floats, Bools]:
    """Iterate from ``starts`` (start, unknown); return the ends, and the mask of solutions in [-bound, bound]."""
    ends, solved = starts.copy(), np.zeros(len(starts), np.bool_)
    for start in range(len(starts)):
        solved[start] = iterate(case, ends[start], bound, DAMPING)
    return ends, solved


@jit
def residuals(case: Case, x: Floats) -> tuple[Floats, float, tuple[Floats, Floats, Floats]]:
    """Return signed kappa_3 ... kappa_highest, their sum of squares, and the coefficients and states of the step."""
    rows = expand(case.stages, x)
    q, p = states(case, rows)
    F = np.empty(case.highest - 2)
    scale, size = 2.0, 0.0
    for n in range(3, case.highest + 1):
        scale *= n
        F[n - 3] = (1.0 if n % 4 in (0, 3) else -1.0) - scale * q[-1, n]
        size += F[n - 3] * F[n - 3]
    return F, size, (rows, q, p)


@jit
def expand(stages: int, x: Floats) -> Floats:
    """Return the 2s + 1 coefficients in the order of a step."""
    rows = np.empty(2 * stages + 1)
    cut = stages // 2
    for parity in range(2):
        length = stages + 1 - parity
        count, offset = (length - 1) // 2, parity * cut
        rest = 1.0
        for i in range(count):
            c = x[offset + i]
            rows[2 * i + parity] = c
            rows[2 * (length - 1 - i) + parity] = c
            rest -= 2.0 * c
        if length % 2 == 1:
            rows[2 * count + parity] = rest
        else:
            rows[2 * count + parity] = rest / 2
            rows[2 * count + 2 + parity] = rest / 2
    return rows


@jit
def states(case: Case, rows: Floats) -> tuple[Floats, Floats]:
    """Return positions and momenta (2s + 2, power of tau) between the operators of a step from q = -p = 1."""
    stages, highest, drift_first = case
    q, p = np.zeros((2 * stages + 2, highest + 1)), np.zeros((2 * stages + 2, highest + 1))
    q[0, 0], p[0, 0] = 1.0, -1.0
    for k in range(2 * stages + 1):
        for n in range(highest + 1):
            q[k + 1, n], p[k + 1, n] = q[k, n], p[k, n]
        if (k % 2 == 0) == drift_first:
            for n in range(highest):
                q[k + 1, n + 1] += rows[k] * p[k, n]
        else:
            for n in range(highest):
                p[k + 1, n + 1] -= rows[k] * q[k, n]
    return q, p


@jit
def slopes(case: Case, x: Floats, step: tuple[Floats, Floats, Floats]) -> Floats:
    """Return the derivatives of kappa_3 ... kappa_highest (equation, unknown) at ``step`` (coefficients and states)."""
    stages, highest, drift_first = case
    rows, q, p = step
    jacobian = np.zeros((highest - 2, stages - 1))
    # The new position is alpha q + beta p of the state before an operator; alpha and beta are computed backwards.
    alpha, beta = np.zeros(highest + 1), np.zeros(highest + 1)
    alpha[0] = 1.0
    cut = stages // 2
    for k in range(2 * stages, -1, -1):
        drifts = (k % 2 == 0) == drift_first
        parity, place = k % 2, k // 2
        length = stages + 1 - parity
        half = (length - 1) // 2
        place = min(place, length - 1 - place)
        offset, unknowns = (0, cut) if parity == 0 else (cut, stages - 1 - cut)
        scale = 2.0
        for n in range(3, highest + 1):
            scale *= n
            gradient = 0.0
            for i in range(n):
                gradient += -alpha[i] * p[k, n - 1 - i] if drifts else beta[i] * q[k, n - 1 - i]
            gradient *= scale
            if place < half:
                jacobian[n - 3, offset + place] += gradient
            else:
                share = 2.0 * gradient if length % 2 == 1 else gradient
                for j in range(unknowns):
                    jacobian[n - 3, offset + j] -= share
        for n in range(highest, 0, -1):
            if drifts:
                beta[n] += rows[k] * alpha[n - 1]
            else:
                alpha[n] -= rows[k] * beta[n - 1]
    return jacobian


iterate = iteration(residuals, slopes, marquardt_step)


# --- Random starts in double precision, and the distinct solutions that are found from them.

#: Number of starts per call of the kernel, between two reports.
BATCH = 4096


@dataclass(frozen=True)
class SearchResult:
    """Solutions in double, most frequent first: ``points`` (solution, unknown), ``hits`` (numbers of starts)."""

    points: Floats
    hits: tuple[int, ...]
    starts: int
    converged: int


def search(equations: Equations, starts: RandomStarts) -> SearchResult:
    """Return the distinct isolated solutions that are found from random points, without free parameters.

    Solutions are the same if they agree relative to their largest unknown.
    """
    points = sample(equations, starts)
    merged, hits = distinct(points, starts.same, relative=True)
    order = sorted(range(len(hits)), key=lambda i: (-hits[i], tuple(merged[i])))
    return SearchResult(merged[order], tuple(hits[i] for i in order), starts.count, len(points))


def sample(equations: Equations, starts: RandomStarts) -> Floats:
    """Return one solution (solution, unknown) per convergent start, in the order of the starts.

    With free parameters, a start converges to a point near it by steps of minimal length. The sample is not uniform.
    """
    case = Case(equations.stages, equations.harmonic_order, equations.first == "drift")
    generator, kept = starts.generator(), list[Floats]()
    for done in range(0, starts.count, BATCH):
        points = starts.points(generator, equations.unknowns, min(BATCH, starts.count - done))
        ends, solved = solve(case, points, starts.bound)
        kept.append(ends[solved])
        name = f"{equations.stages} stages, harmonic order {equations.harmonic_order}"
        progress(f"{name}: {done + len(points)} of {starts.count} starts, {sum(map(len, kept))} converged")
    return np.concatenate(kept)


Vertex = tuple[int, list[int]]
#: The outer and the inner row of a solution, decimal strings.
Rows = tuple[Sequence[str], Sequence[str]]


# --- The method of the paper: minimise max(kappa_1, ..., kappa_lambda) with an adaptive simplex in multiprecision.
#
# Nelder & Mead's method with the coefficients of Gao & Han (2012), doi:10.1007/s10589-010-9329-3, which depend on the
# dimension n: reflection 1, expansion 1 + 2/n, contraction 3/4 - 1/(2n), shrinkage 1 - 1/n. Numbers are integers in
# units of 2^-bits; a product of 2048 bits with gmpy2 takes a tenth of the time of Python's integers, with the same
# result. The objective is not smooth where two kappa are equal, and there the simplex collapses before the minimum. It
# then restarts from its best point, with new random signs of the edges.

#: A simplex has collapsed if its values agree to this number of bits.
COLLAPSED_BITS = 12
#: Inverse of the edges of a new simplex, and maximum ratio of edges to objective: with conditions as badly scaled as
#: for the sets in Table 4, a solution is within this multiple of the objective.
LONGEST_EDGE, EDGE_FACTOR = 20, 10_000
#: Random starts are uniform in [-BOX, BOX].
BOX = 1.0
#: Distance from a root, as a decimal, below which the simplex has reached it.
NEAR = "1e-6"


class Simplex(NamedTuple):
    """Bits of the arithmetic, decimals to which kappa vanishes at a solution, and most evaluations from one point."""

    bits: int = 2048
    digits: int = 128
    evaluations: int = 40_000


#: The short run that selects random starts for long runs.
SHORT = Simplex(bits=192, digits=4, evaluations=800)


@dataclass(frozen=True)
class Minimum:
    """End of the simplex: ``unknowns`` (mpf) only if ``converged``, else the smallest value of the largest kappa."""

    converged: bool
    kappa_max: Any
    unknowns: tuple[Any, ...]
    evaluations: int
    restarts: int
    seconds: float


@dataclass(frozen=True)
class SimplexRun:
    """One run of the method of the paper, from ``start``: one of the ``promising`` among ``starts`` random points.

    ``reached`` is the index of the root to which it converged, and ``distance`` the largest difference of an unknown
    from this root; None if it did not converge, or not to a known root.
    """

    stages: int
    starts: int
    promising: int
    start: tuple[float, ...]
    outcome: Minimum
    reached: int | None
    distance: Any


def minimise(equations: Equations, start: Sequence[float], *, seed: int, settings: Simplex) -> Minimum:
    """Run the simplex from ``start`` until kappa_max < 10^-digits, or until the evaluations are spent."""
    bits, evaluations = settings.bits, settings.evaluations
    clock, generator, one = perf_counter(), random.Random(seed), mpz(1) << bits
    objective = _Objective(equations, bits)
    x = [mpz(round(c * 2**52)) << (bits - 52) for c in start]
    best: Vertex = objective(x), x
    tolerance, restarts = one // 10**settings.digits, -1
    while best[0] >= tolerance and objective.calls < evaluations:
        edge = min(one // LONGEST_EDGE, best[0] * EDGE_FACTOR)
        simplex = [best]
        for i in range(equations.unknowns):
            vertex = list(best[1])
            vertex[i] += edge if generator.random() < 0.5 else -edge
            simplex.append((objective(vertex), vertex))
        best = objective.collapsed(simplex, tolerance, evaluations)
        restarts += 1
        with mp.workprec(bits):
            progress(f"simplex: {objective.calls} evaluations, kappa_max {mp.nstr(mpf(max(best[0], 1)) / one, 3)}")
    converged = best[0] < tolerance
    with mp.workprec(bits):
        unknowns = tuple(mpf(c) / one for c in best[1]) if converged else ()
        kappa_max = mpf(best[0]) / one
    return Minimum(converged, kappa_max, unknowns, objective.calls, max(restarts, 0), perf_counter() - clock)


def promising_starts(equations: Equations, *, starts: int, seed: int) -> list[list[float]]:
    """Return the points among ``starts`` random ones from which a short run in low precision comes near a root.

    A start in a ridge of the maximum norm stalls at once in any precision; a short run detects this.
    """
    generator, found = random.Random(seed), []
    for number in range(starts):
        start = [generator.uniform(-BOX, BOX) for _ in range(equations.unknowns)]
        if minimise(equations, start, seed=number, settings=SHORT).converged:
            found.append(start)
            progress(f"simplex: {len(found)} of {number + 1} random starts lead near a root")
    return found


def simplex_runs(
    equations: Equations, roots: Sequence[Rows], *, starts: int, seed: int, settings: Simplex
) -> list[SimplexRun]:
    """Solve a case by the method of the paper, from every random point that a short run finds promising.

    ``roots`` are both rows of each known solution, ``starts`` is the number of random points, and ``seed`` the seed of
    these and of the simplex.
    """
    promising = promising_starts(equations, starts=starts, seed=seed)
    runs = []
    for start in promising:
        outcome = minimise(equations, start, seed=seed, settings=settings)
        with mp.workdps(settings.digits + 30):
            centres = [[mpf(c) for c in equations.halved(*rows)] for rows in roots] if outcome.converged else []
            apart = [max(abs(a - b) for a, b in zip(outcome.unknowns, x, strict=True)) for x in centres]
            reached = next((i for i, distance in enumerate(apart) if distance < mpf(NEAR)), None)
        distance = None if reached is None else apart[reached]
        runs.append(SimplexRun(equations.stages, starts, len(promising), tuple(start), outcome, reached, distance))
    return runs


class _Objective:
    """max(kappa_1, ..., kappa_lambda) of a point, in units of 2^-bits, with the number of evaluations."""

    def __init__(self, equations: Equations, bits: int) -> None:
        self._equations, self._bits = equations, bits
        self._scale = [factorial(n) for n in range(equations.harmonic_order + 1)]
        self.calls = 0

    def __call__(self, x: list[int]) -> int:
        self.calls += 1
        bits, highest, s = self._bits, self._equations.harmonic_order, self._equations.stages
        one, cut = mpz(1) << bits, self._equations.halves[0]
        outer, inner = _closed(x[:cut], s + 1, one), _closed(x[cut:], s, one)
        q, p = [one] + [0] * highest, [-one] + [0] * highest  # by powers of tau
        kick, drift = (p, q, -1), (q, p, 1)
        of_outer, of_inner = (kick, drift) if self._equations.first == "kick" else (drift, kick)
        _shear(*of_outer, outer[0], bits)
        for c, d in zip(inner, outer[1:], strict=True):
            _shear(*of_inner, c, bits)
            _shear(*of_outer, d, bits)
        kappa = [abs(DERIVATIVES[n % 4] * one - self._scale[n] * q[n]) for n in range(1, highest + 1)]
        largest: int = max(kappa)
        return largest

    def collapsed(self, simplex: list[Vertex], tolerance: int, evaluations: int) -> Vertex:
        """Return the best vertex after collapse, convergence, or the last evaluation."""
        n, bits, by_value = len(simplex) - 1, self._bits, itemgetter(0)
        one = mpz(1) << bits
        expansion, contraction = one + 2 * one // n, 3 * one // 4 - one // (2 * n)
        shrinkage = one - one // n
        simplex = sorted(simplex, key=by_value)
        while simplex[0][0] >= tolerance and self.calls < evaluations:
            (lowest, best), (highest, worst) = simplex[0], simplex[-1]
            if (highest - lowest) << COLLAPSED_BITS < lowest:
                break
            centroid = [sum(column) // n for column in zip(*(x for _, x in simplex[:-1]), strict=True)]
            reflected = self._moved(centroid, worst, one)
            if reflected[0] < lowest:
                simplex[-1] = min(reflected, self._moved(centroid, worst, expansion), key=by_value)
            elif reflected[0] < simplex[-2][0]:
                simplex[-1] = reflected
            else:
                outside = reflected[0] < highest
                contracted = self._moved(centroid, worst, contraction if outside else -contraction)
                if contracted[0] < min(reflected[0], highest):
                    simplex[-1] = contracted
                else:
                    simplex[1:] = [self._moved(best, x, -shrinkage) for _, x in simplex[1:]]
            simplex.sort(key=by_value)
        return simplex[0]

    def _moved(self, centre: list[int], vertex: list[int], factor: int) -> Vertex:
        """Return the vertex at centre + factor (centre - vertex)."""
        x = [c + (factor * (c - v) >> self._bits) for c, v in zip(centre, vertex, strict=True)]
        return self(x), x


def _shear(moved: list[int], by: list[int], sign: int, c: int, bits: int) -> None:
    """Add sign c tau ``by`` to ``moved``; tau shifts each coefficient by one power."""
    for n in range(len(moved) - 1, 0, -1):
        moved[n] += sign * (c * by[n - 1] >> bits)


def _closed(half: list[int], length: int, one: int) -> list[int]:
    rest = one - 2 * sum(half)
    return [*half, rest, *reversed(half)] if length % 2 else [*half, rest // 2, rest // 2, *reversed(half)]
