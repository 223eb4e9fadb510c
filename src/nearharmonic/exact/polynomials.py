"""Exact polynomials and their roots, and zeros of smooth functions in multiprecision, with a proof of each zero."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from itertools import accumulate, pairwise
from itertools import product as cartesian
from math import isqrt, lcm
from typing import Any, NamedTuple, TypeVar

from gmpy2 import gcd
from mpmath import inf, iv, lu_solve, matrix, mp, mpf, nstr
from mpmath.libmp import to_rational

# --- Conversion of numbers to and from multiprecision, and their decimal formats.

#: A number of mpmath in its current precision, or an operand that mpmath accepts: int, float, Fraction or interval.
BigFloat = Any


def as_mpf(number: BigFloat) -> BigFloat:
    """``number`` rounded to the current precision of mpmath, also for a Fraction."""
    if isinstance(number, Fraction):
        return mpf(number.numerator) / number.denominator
    return mpf(number)


def as_fraction(number: BigFloat) -> Fraction:
    """The exact rational value of an mpf, a float or a decimal string."""
    if isinstance(number, mpf):
        return Fraction(*to_rational(number._mpf_))
    return Fraction(number)


def fixed_point(number: BigFloat, places: int) -> str:
    """``number`` rounded to ``places`` >= 1 decimals, ties to even, with trailing zeros; "inf" for infinity.

    All bits of an mpf are used, for any current precision of mpmath.
    """
    if number == inf:
        return "inf"
    scaled = round(as_fraction(number) * 10**places)
    digits = f"{abs(scaled):0{places + 1}d}"
    return f"{'-' if scaled < 0 else ''}{digits[:-places]}.{digits[-places:]}"


def significant(number: BigFloat, digits: int) -> str:
    """``number`` with ``digits`` significant digits, with trailing zeros; "0" for 0 and "inf" for infinity."""
    if number == inf:
        return "inf"
    return str(nstr(number, digits, strip_zeros=False)) if number else "0"


def decimals_in_common(printed: str, other: str, most: int | None = None) -> int:
    """Number of decimals, at most ``most`` or those ``printed``, to which two numbers differ by less than one unit."""
    places = -int(Decimal(printed).as_tuple().exponent) if most is None else most
    difference = abs(Fraction(printed) - Fraction(other))
    return next((n for n in range(places, 0, -1) if difference < Fraction(1, 10**n)), 0)


# --- Exact polynomials in one variable with integer coefficients: common divisors, Sturm's chain, and real roots.
#
# A polynomial is the list of its coefficients of x^0, x^1, ..., the last one not 0. Real roots are isolated by
# Descartes' rule of signs and bisection, and refined by the signs of exact values. Sturm's chain counts them
# independently. Polynomials are evaluated only at integers divided by a power of 2.
#
# Sources: Sturm (1829); Collins & Akritas (1976), doi:10.1145/800205.806346, for the isolation; Yun (1976),
# doi:10.1145/800205.806320, for multiple roots; Abbott (2014), doi:10.1145/2644288.2644291, for the narrowing.

Polynomial = list[int]

#: Positive roots are refined to a relative width of 2^-NARROW_BITS.
NARROW_BITS = 110

#: Two polynomials without a common factor modulo a prime have no common factor, unless the prime divides both leading
#: coefficients.
_PRIME = 2**61 - 1


class _Cell(NamedTuple):
    """The interval from ``start`` to ``start + width``, in units of 2^-``bits``; a cell of ``width`` 0 is a root."""

    start: int
    width: int
    bits: int


def whole(row: Sequence[Fraction]) -> Polynomial:
    """``row`` times a positive number, as integers without a common factor; [] for a row of zeros."""
    unit = lcm(*(c.denominator for c in row))
    return _primitive(_without_high_zeros([c.numerator * (unit // c.denominator) for c in row]))


def product(a: Polynomial, b: Polynomial) -> Polynomial:
    """a b."""
    terms = [0] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            terms[i + j] += x * y
    return terms


def derivative(polynomial: Polynomial) -> Polynomial:
    """The derivative times a positive number; [] for a constant."""
    return _primitive([n * c for n, c in enumerate(polynomial)][1:])


def sturm_chain(polynomial: Polynomial) -> list[Polynomial]:
    """The polynomial, its derivative, and the negated remainders, each times a positive number.

    The chain ends with a constant if and only if no root is multiple.
    """
    return _remainders(_primitive(polynomial), derivative(polynomial))


def real_root_count(chain: Sequence[Polynomial]) -> int:
    """Number of distinct real roots of the first link of a Sturm chain."""
    at_infinity = [_sign(link[-1]) for link in chain]
    before = [sign * (-1) ** (len(link) - 1) for sign, link in zip(at_infinity, chain, strict=True)]
    return _changes(before) - _changes(at_infinity)


def common_divisor(a: Polynomial, b: Polynomial) -> Polynomial:
    """The greatest common divisor of two polynomials, with a positive leading term; the second may be []."""
    if b and _coprime_modulo_prime(a, b):
        return [1]
    divisor = _remainders(a, b)[-1] if b else a
    return divisor if divisor[-1] > 0 else [-c for c in divisor]


def by_parity(polynomial: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Two polynomials with simple roots: the roots of odd multiplicity, and the roots of even multiplicity."""
    odd: Polynomial = [1]
    even: Polynomial = [1]
    common = common_divisor(polynomial, derivative(polynomial))
    rest, multiplicity = _quotient(polynomial, common), 1
    while len(rest) > 1:
        shared = common_divisor(rest, common)
        exactly = _quotient(rest, shared)  # the roots of exactly this multiplicity
        if multiplicity % 2:
            odd = product(odd, exactly)
        else:
            even = product(even, exactly)
        rest, common, multiplicity = shared, _quotient(common, shared), multiplicity + 1
    return odd, even


def positive_roots(polynomial: Polynomial) -> list[Fraction]:
    """The distinct positive roots, ascending, each at its true value or below it by a relative 2^-110 at most."""
    p, roots = _simple(polynomial), []
    for cell in _isolated(p, 0, 1 << _bound(p).bit_length()):
        start, width, bits = cell if cell.start else _away_from_zero(p, cell)
        if width:
            # start/width is an integer of at least 111 bits, so start is at least 2^110 times the width.
            missing = max(0, NARROW_BITS + 1 - (start // width).bit_length())
            start, width, bits = _narrowed(p, _Cell(start, width, bits), missing)
        roots.append(Fraction(int(start), 1 << bits))
    return sorted(roots)


def real_roots(polynomial: Polynomial, precision: int) -> list[Fraction]:
    """The distinct real roots, ascending, each with an error of at most 2^-``precision``."""
    p, roots = _simple(polynomial), []
    bound = _bound(p)
    for cell in _isolated(p, -bound, bound):
        level = precision + (2 * bound - 1).bit_length()
        start, width, bits = _narrowed(p, cell, max(0, level - cell.bits)) if cell.width else cell
        roots.append(Fraction(int(2 * start + width), 2 << bits))
    return sorted(roots)


def _bound(p: Polynomial) -> int:
    """A power of 2 above all moduli of roots: 2 max |a_(n-k) / a_n|^(1/k) (Fujiwara 1916), rounded up."""
    degree, last = len(p) - 1, abs(p[-1]).bit_length()
    # |a| < 2^bits and |a_n| >= 2^(last - 1), so that a quotient is below 2^(bits - last + 1).
    bits = (-((last - 1 - abs(c).bit_length()) // (degree - n)) for n, c in enumerate(p[:-1]) if c)
    return 1 << max(1, 1 + max(bits, default=0))


def _simple(polynomial: Polynomial) -> Polynomial:
    """The polynomial with the same roots, each of them simple."""
    return _quotient(polynomial, common_divisor(polynomial, derivative(polynomial)))


def _isolated(p: Polynomial, low: int, high: int) -> list[_Cell]:
    """Cells that isolate the roots between ``low`` and ``high``, which are not roots; all roots of ``p`` are simple.

    Descartes' rule: the number of roots of a polynomial q between 0 and 1 is the number of sign changes in the
    coefficients of (1 + x)^n q(1 / (1 + x)), or less by an even number. After enough bisections the number of sign
    changes is 0 or 1.
    """
    degree, found = len(p) - 1, []
    moved = [c * (high - low) ** n for n, c in enumerate(_shifted(p, low))]
    waiting = [(moved, _Cell(low, high - low, 0))]
    while waiting:
        q, cell = waiting.pop()
        changes = _changes([_sign(c) for c in _shifted(q[::-1], 1)])
        if changes == 1:
            found.append(cell)
        elif changes:
            left = [c << (degree - n) for n, c in enumerate(q)]
            right = _shifted(left, 1)
            start, width, bits = 2 * cell.start, cell.width, cell.bits + 1
            if right[0] == 0:
                found.append(_Cell(start + width, 0, bits))
            waiting += [(left, _Cell(start, width, bits)), (right, _Cell(start + width, width, bits))]
    return found


def _away_from_zero(p: Polynomial, cell: _Cell) -> _Cell:
    """The cell halved until it no longer begins at 0."""
    while cell.start == 0 and cell.width:
        cell = _narrowed(p, cell, 1)
    return cell


def _narrowed(p: Polynomial, cell: _Cell, halvings: int) -> _Cell:
    """The one of 2^``halvings`` equal parts of ``cell`` that contains its root, or the root if it is an end of a part.

    Quadratic interval refinement: the secant predicts the one of N equal parts with the root. After a correct
    prediction N is squared.
    """
    start, width, bits = cell.start << halvings, cell.width, cell.bits + halvings
    ends = [0, 1 << halvings]
    # If the cell begins at another root, the sign just above that root is the sign of the derivative.
    values = [
        _scaled_value(p, start, bits) or _sign(_scaled_value(derivative(p), start, bits)),
        _scaled_value(p, start + ends[1] * width, bits),
    ]
    steps = 4
    while ends[1] - ends[0] > 1:
        step, middle = max(1, (ends[1] - ends[0]) // steps), sum(ends) // 2
        low, high = map(abs, values)
        guess = ends[0] + (ends[1] - ends[0]) * low // (low + high) // step * step
        for point in (guess, guess + step, middle):
            if ends[0] < point < ends[1]:
                value = _scaled_value(p, start + point * width, bits)
                if value == 0:
                    return _Cell(start + point * width, 0, bits)
                moved = int(_sign(value) != _sign(values[0]))
                ends[moved], values[moved] = point, value
            if point == guess + step and ends[1] - ends[0] <= step:
                steps = steps**2
                break
        else:
            steps = max(4, isqrt(steps))
    return _Cell(start + ends[0] * width, width, bits)


def _scaled_value(p: Polynomial, numerator: int, bits: int) -> int:
    """The value at ``numerator`` / 2^``bits``, times 2^(``bits`` degree), by Horner's rule."""
    total, shift = 0, 0
    for coefficient in reversed(p):
        total = total * numerator + (coefficient << shift)
        shift += bits
    return total


def _shifted(p: Polynomial, by: int) -> Polynomial:
    """p(x + by)."""
    if by == 1:  # the most frequent shift: sums from the highest term downwards, one term fewer each time
        sums = p[::-1]
        for length in range(len(p), 1, -1):
            sums[:length] = accumulate(sums[:length])
        return sums[::-1]
    moved = list(p)
    for first in range(len(p) - 1) if by else ():
        for n in range(len(p) - 2, first - 1, -1):
            moved[n] += by * moved[n + 1]
    return moved


def _remainders(a: Polynomial, b: Polynomial) -> list[Polynomial]:
    """a, b, -(a mod b), ..., each times a positive number; the last remainder divides both."""
    chain = [a, b]
    while len(chain[-1]) > 1:
        _, rest = _divided(chain[-2], chain[-1])
        if not rest:
            break
        chain.append(_primitive([-c for c in rest]))
    return chain


def _coprime_modulo_prime(a: Polynomial, b: Polynomial) -> bool:
    """Return True if the polynomials modulo a prime prove that there is no common root; False proves nothing."""
    if a[-1] % _PRIME == 0:
        return False
    rows = [_without_high_zeros([c % _PRIME for c in row]) for row in (a, b)]
    while rows[1]:
        dividend, divisor = rows
        inverse = pow(divisor[-1], -1, _PRIME)
        while len(dividend) >= len(divisor):
            factor, shift = dividend[-1] * inverse % _PRIME, len(dividend) - len(divisor)
            top = [(c - factor * d) % _PRIME for c, d in zip(dividend[shift:], divisor, strict=True)]
            dividend = _without_high_zeros([*dividend[:shift], *top])
        rows = [divisor, dividend]
    return len(rows[0]) == 1


def _quotient(a: Polynomial, b: Polynomial) -> Polynomial:
    """a / b times a positive number; b must divide a."""
    return _primitive(_divided(a, b)[0])


def _divided(a: Polynomial, b: Polynomial) -> tuple[Polynomial, Polynomial]:
    """Quotient and remainder of a positive multiple of ``a``, both with integer coefficients."""
    rest, quotient = list(a), [0] * max(1, len(a) - len(b) + 1)
    factor, sign = abs(b[-1]), _sign(b[-1])
    while len(rest) >= len(b):
        top, shift = sign * rest[-1], len(rest) - len(b)
        quotient = [factor * c for c in quotient]
        quotient[shift] += top
        rest = [factor * c - top * (b[n - shift] if n >= shift else 0) for n, c in enumerate(rest)][:-1]
    return quotient, _without_high_zeros(rest)


def _sign(number: int) -> int:
    return (number > 0) - (number < 0)


def _changes(signs: Sequence[int]) -> int:
    """Number of sign changes along a row without its zeros."""
    return sum(a != b for a, b in pairwise(sign for sign in signs if sign))


def _primitive(row: Sequence[int]) -> Polynomial:
    common = gcd(*row) or 1
    return [c // common for c in row]


def _without_high_zeros(row: Sequence[int]) -> Polynomial:
    kept = list(row)
    while kept and kept[-1] == 0:
        kept.pop()
    return kept


# --- Sparse polynomials in several variables with rational coefficients, and power series with such coefficients.

Key = TypeVar("Key")
#: Exponents of a monomial in y_1, ..., y_k.
Monomial = tuple[int, ...]
Multivariate = dict[Monomial, Fraction]
#: Coefficients of x^0, x^1, ...
PowerSeries = list[Multivariate]


def add(p: dict[Key, Fraction], q: dict[Key, Fraction], factor: Fraction | int = 1) -> dict[Key, Fraction]:
    """p + factor q, without zeros; also for sparse vectors by index."""
    total = dict(p)
    for monomial, c in q.items():
        value = total.get(monomial, Fraction(0)) + factor * c
        if value:
            total[monomial] = value
        else:
            total.pop(monomial, None)
    return total


def times(p: Multivariate, q: Multivariate) -> Multivariate:
    """p q."""
    total: Multivariate = {}
    for m, c in p.items():
        for n, d in q.items():
            key = tuple(a + b for a, b in zip(m, n, strict=True))
            total[key] = total.get(key, Fraction(0)) + c * d
    return {m: c for m, c in total.items() if c}


def multivariate_product(p: PowerSeries, q: PowerSeries, length: int) -> PowerSeries:
    """The first ``length`` coefficients of p q."""
    total: PowerSeries = [{} for _ in range(length)]
    for i, a in enumerate(p[:length]):
        for j, b in enumerate(q[: length - i]):
            total[i + j] = add(total[i + j], times(a, b))
    return total


def inverse(p: PowerSeries, length: int) -> PowerSeries:
    """The first ``length`` coefficients of 1/p, if the first coefficient of ``p`` is 1."""
    total: PowerSeries = [p[0]]
    for i in range(1, length):
        value: Multivariate = {}
        for j in range(1, min(i + 1, len(p))):
            value = add(value, times(p[j], total[i - j]), -1)
        total.append(value)
    return total


def constants(numbers: Sequence[Fraction], variables: int) -> PowerSeries:
    """The series with these numbers as coefficients, which are polynomials in ``variables`` variables."""
    return [{(0,) * variables: c} if c else {} for c in numbers]


def variable(i: int, variables: int) -> Multivariate:
    """y_(i+1)."""
    return {tuple(int(j == i) for j in range(variables)): Fraction(1)}


# --- Exact linear algebra in the ring of polynomials modulo weighted conditions, one per variable.

#: Nonzero entries by index.
SparseVector = dict[int, Fraction]
#: First index of labels, above the indices of entries.
LABELS = 1 << 32


def weight(monomial: Monomial) -> int:
    """Weight of a monomial, if y_i has weight i."""
    return sum((i + 1) * exponent for i, exponent in enumerate(monomial))


def monomials(variables: int, highest: int) -> list[Monomial]:
    """All monomials up to a weight, the highest weight first."""
    ranges = [range(highest // (i + 1) + 1) for i in range(variables)]
    kept = [m for m in cartesian(*ranges) if weight(m) <= highest]
    return sorted(kept, key=lambda m: (-weight(m), m))


class Echelon:
    """Rows in echelon form; it finds linear relations between vectors with labels.

    The entries of a row from :data:`LABELS` on are the combination of inserted vectors, by label, that makes the row.
    """

    def __init__(self) -> None:
        self._rows: dict[int, SparseVector] = {}

    def insert(self, vector: SparseVector, label: int) -> SparseVector | None:
        """Add a vector; if it depends on previous vectors, return the vanishing combination by labels."""
        rest = _reduced(vector | {LABELS + label: Fraction(1)}, self._rows)
        if min(rest) >= LABELS:
            return {j - LABELS: c for j, c in rest.items()}
        _keep(rest, self._rows)
        return None

    def express(self, vector: SparseVector) -> SparseVector:
        """``vector`` as a combination of labels."""
        rest = _reduced(vector, self._rows)
        assert all(j >= LABELS for j in rest)
        return {j - LABELS: -c for j, c in rest.items()}


class Quotient:
    """The ring of polynomials in y modulo the conditions, as vectors over the irreducible monomials."""

    def __init__(self, conditions: Sequence[Multivariate], weights: Sequence[int]) -> None:
        k = len(weights)
        # Above the weight sum(w) - sum(i) of the socle every monomial is reducible; a product with y_1 adds one to a
        # weight.
        socle = sum(weights) - k * (k + 1) // 2
        self._monomials = monomials(k, max(socle + 1, k))
        self._index = {m: i for i, m in enumerate(self._monomials)}
        self._pivots: dict[int, SparseVector] = {}
        top = weight(self._monomials[0])
        rows = [
            {self._index[tuple(a + b for a, b in zip(m, n, strict=True))]: c for n, c in p.items()}
            for p, w in zip(conditions, weights, strict=True)
            for m in monomials(k, top - w)
        ]
        for row in sorted(rows, key=len):
            if rest := _reduced(row, self._pivots):
                _keep(rest, self._pivots)
        self.dimension = len(self._monomials) - len(self._pivots)
        self.one: SparseVector = {self._index[(0,) * k]: Fraction(1)}

    def coordinate(self, i: int) -> SparseVector:
        """y_(i+1)."""
        (monomial,) = variable(i, len(self._monomials[0]))
        return _reduced({self._index[monomial]: Fraction(1)}, self._pivots)

    def times_first(self, vector: SparseVector) -> SparseVector:
        """y_1 times ``vector``."""
        moved = {}
        for i, c in vector.items():
            first, *others = self._monomials[i]
            moved[self._index[first + 1, *others]] = c
        return _reduced(moved, self._pivots)


def _keep(row: SparseVector, rows: dict[int, SparseVector]) -> None:
    """Add a reduced row to rows in echelon form, by the index of its first entry, which becomes 1."""
    lead = min(row)
    rows[lead] = {j: c / row[lead] for j, c in row.items()}


def _reduced(vector: SparseVector, rows: dict[int, SparseVector]) -> SparseVector:
    """``vector`` minus multiples of rows, so that no first entry of a row is left."""
    rest, kept = dict(vector), {}
    while rest:
        lead = min(rest)
        if lead in rows:
            rest = add(rest, rows[lead], -rest[lead])
        else:
            kept[lead] = rest.pop(lead)
    return kept


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


#: Number of guard digits, beyond the digits of the radius.
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
