"""Products of exact coefficients and powers of a run-time step size, each rounded once.

A coefficient is a rational number, stored as a sum of doubles of decreasing size. Its product with a power of tau is
computed in double-double. If the error of this product leaves two candidates for the nearest double, an exact sum of
all doubles decides. This is not rare: 7 tau / 24 is half-way between two doubles for many tau, and for a coefficient
with 76 decimals in place of 7/24 the product is very near to half-way.

The module is separate from :mod:`nearharmonic.core.stepper.call` because these functions do not depend on a system and
are compiled once.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import frexp, ldexp

import numpy as np

from nearharmonic.core.arithmetic import fma, two_product, two_sum
from nearharmonic.core.layout import COLUMNS, DRIFT, KICK, PRODUCT, REST, SQUARE, Floats
from nearharmonic.core.machine import reals  # noqa: F401 (it lets numba compile two_product)
from nearharmonic.core.machine.jit import jit

#: Smallest number of bits that a double of a sum adds.
BITS = 53
#: Largest number of doubles of a coefficient, for decimals of 100 digits and their products: the next double would
#: underflow.
MOST_DOUBLES = 18
#: Bound of the relative error of a product in double-double: four roundings of at most 2^-104, and omitted terms below
#: 2^-104.
UNCERTAIN = 2.0**-101
#: Number of columns of a table: kick, drift, and their product or the coefficient of the square.
KINDS = 3


def table_of(rows: Sequence[Sequence[Fraction]], powers: Sequence[int]) -> Floats:
    """Return coefficients (doubles, KINDS, rows) as sums of doubles, enough to decide every rounding.

    k tau^n and a number half-way between two doubles are equal, or their relative difference exceeds 2^-b, where b is
    the larger of 54 + log2(denominator of k) and 53 n + log2(numerator of k).

    Parameters
    ----------
    rows : sequence of KINDS Fraction each
        Coefficients of the moves.
    powers : (KINDS,) sequence of int
        Power n of tau for each column.
    """
    bits = max(
        max(BITS + 1 + k.denominator.bit_length(), BITS * n + abs(k.numerator).bit_length())
        for row in rows
        for k, n in zip(row, powers, strict=True)
    )
    count = min(MOST_DOUBLES, bits // BITS + 3)
    table = np.zeros((count, KINDS, len(rows)))
    for i, row in enumerate(rows):
        for kind, k in enumerate(row):
            rest = k
            for part in range(count):
                table[part, kind, i] = float(rest)
                rest -= Fraction(float(rest))
    return table


@jit
def _power(tau: float, n: int) -> tuple[float, float]:
    """Return tau^n as a pair, for n = 1, 2 or 3."""
    if n == 1:
        return tau, 0.0
    high, low = two_product(tau, tau)
    if n == 2:
        return high, low
    product, error = two_product(high, tau)
    return product, fma(low, tau, error)


@jit
def _neighbours(c: float, c_low: float, high: float, low: float) -> tuple[float, float]:
    """Return the double nearest to a product of pairs twice, or the two candidates if the error leaves two."""
    product, error = two_product(c, high)
    rest = fma(c, low, fma(c_low, high, error))
    bound = abs(product) * UNCERTAIN
    return product + (rest - bound), product + (rest + bound)


@jit
def _added(terms: Floats, count: int, x: float) -> int:
    """Add a number to a sum of doubles that do not overlap, exactly (Shewchuk 1997, doi:10.1007/PL00009321)."""
    for i in range(count):
        x, terms[i] = two_sum(x, terms[i])
    terms[count] = x
    return count + 1


@jit
def _nearest(table: Floats, kind: int, row: int, tau: float, n: int, below: float, above: float) -> float:
    """Return the one of two neighbouring doubles that is nearest to k tau^n; the even one in a tie."""
    mantissa, exponent = frexp(tau)
    lower, upper = ldexp(below, -n * exponent), ldexp(above, -n * exponent)
    half = (upper - lower) / 2
    powers, factors = np.zeros(4), 1
    powers[0] = mantissa
    if n > 1:
        powers[0], powers[1] = two_product(mantissa, mantissa)
        factors = 2
    if n > 2:
        high, low = powers[0], powers[1]
        powers[0], powers[1] = two_product(high, mantissa)
        powers[2], powers[3] = two_product(low, mantissa)
        factors = 4
    terms = np.zeros(2 + 2 * len(table) * factors)
    count = _added(terms, _added(terms, 0, -lower), -half)
    for part in range(len(table)):
        for factor in range(factors):
            product, error = two_product(table[part, kind, row], powers[factor])
            count = _added(terms, _added(terms, count, error), product)
    excess = 0.0
    for i in range(count):
        excess += terms[i]
    if abs(excess) <= abs(upper) * 2.0 ** (-BITS * (len(table) - 1)):
        return ldexp(lower + half, n * exponent)
    return above if excess > 0.0 else below


@jit
def _settle(table: Floats, n: int, tau: float, moves: Floats) -> None:
    """Fill in the moves again, by :func:`_nearest` where the error of double-double leaves two candidates."""
    rows = table.shape[2]
    for i in range(rows):
        for kind in range(KINDS):
            power = n if kind == SQUARE else 1
            below, above = _neighbours(table[0, kind, i], table[1, kind, i], *_power(tau, power))
            if below != above and np.isfinite(above - below):
                above = _nearest(table, kind, i, tau, power, below, above)
            moves[COLUMNS * i + kind] = above


@jit
def fill(table: Floats, flags: Floats, n: int, tau: float, moves: Floats) -> None:
    """Fill in the moves of a step: COLUMNS doubles for each row of :func:`table_of`.

    Parameters
    ----------
    table : (doubles, KINDS, rows) array of float
        Coefficients.
    flags : (rows,) array of float
        Last column of the moves, for kicks of a modified potential.
    n : {2, 3}
        Power of tau in the third column: 2 for the product of kick and drift, which REST follows, 3 for the coefficient
        of the square.
    tau : float
        Step size.
    moves : (rows COLUMNS,) array of float
        Output.
    """
    high, low = _power(tau, n)
    rows, doubtful = table.shape[2], False
    for i in range(rows):
        below, kick = _neighbours(table[0, KICK, i], table[1, KICK, i], tau, 0.0)
        doubtful |= below != kick
        below, drift = _neighbours(table[0, DRIFT, i], table[1, DRIFT, i], tau, 0.0)
        doubtful |= below != drift
        below, third = _neighbours(table[0, SQUARE, i], table[1, SQUARE, i], high, low)
        doubtful |= below != third
        moves[COLUMNS * i + KICK], moves[COLUMNS * i + DRIFT], moves[COLUMNS * i + PRODUCT] = kick, drift, third
    if doubtful:
        _settle(table, n, tau, moves)
    for i in range(rows):
        at = COLUMNS * i
        if n == 2:
            product, error = two_product(moves[at + KICK], moves[at + DRIFT])
            moves[at + REST] = (product - moves[at + PRODUCT]) + error
        else:
            moves[at + REST] = flags[i]


@jit
def fill_all(table: Floats, flags: Floats, n: int, taus: Floats, moves: Floats) -> None:
    """Fill in the moves (steps, rows COLUMNS) of steps of several sizes (steps,), as :func:`fill` does."""
    for i in range(len(taus)):
        fill(table, flags, n, taus[i], moves[i])
