"""Error-free transforms and double-double arithmetic, for floats and for numbers that emit machine code.

A carrier is anything with ``+ - * /``, unary minus and the functions :func:`fma`, :func:`sqrt`, :func:`absolute` and
:func:`times_sign`: a Python float, or a value that emits machine code while a kernel is built. Every line below rounds
once, and no compiler may re-associate or contract the operations. Sources: Dekker (1971), doi:10.1007/BF01397083
(quick_two_sum, Dekker's add); Knuth, TAOCP 2, 4.2.2 (two_sum); Hida, Li & Bailey (2001), doi:10.1109/ARITH.2001.930115
(double-double).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

Pair = tuple[Any, Any]


def fma(x: Any, y: Any, z: Any) -> Any:
    """x*y + z, rounded once if the carrier is a double; for Python floats by exact rational arithmetic."""
    fused = getattr(x, "fma", None)
    if fused is not None:
        return fused(y, z)
    if isinstance(x, float):
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
            return x * y + z
        return float(Fraction(x) * Fraction(y) + Fraction(z))
    return x * y + z


def sqrt(x: Any) -> Any:
    """Square root of a float, a numpy array, an mpmath number or a number of a formula.

    Examples
    --------
    >>> from nearharmonic import math
    >>> math.sqrt(9)
    3.0
    """
    if isinstance(x, float | int):
        return math.sqrt(x)
    if hasattr(x, "context"):  # an mpmath number belongs to a context
        return x.context.sqrt(x)
    if hasattr(x, "sqrt"):
        return x.sqrt()
    if isinstance(x, Fraction):
        return math.sqrt(x)
    import numpy as np

    return np.frompyfunc(sqrt, 1, 1)(x) if str(getattr(x, "dtype", "")) == "object" else np.sqrt(x)


def absolute(x: Any) -> Any:
    """|x| of a carrier."""
    return x.absolute() if hasattr(x, "absolute") else abs(x)


def times_sign(x: Any, y: Any) -> Any:
    """-x where y < 0, else x."""
    if hasattr(x, "times_sign"):
        return x.times_sign(y)
    return -x if y < 0 else x


def whole_pi(bits: int) -> int:
    """Return the integer part of pi 2^bits, by Machin's formula."""
    guard = 64

    def inverse_tangent(n: int) -> int:
        """Return arctan(1/n) 2^(bits + guard), with an error below the number of its terms."""
        term = total = (1 << bits + guard) // n
        k = 1
        while term:
            term //= -n * n
            k += 2
            total += term // k
        return total

    return 4 * (4 * inverse_tangent(5) - inverse_tangent(239)) >> guard


def rounded_pair(numerator: int, denominator: int) -> tuple[float, float]:
    """The double nearest to a quotient of integers, and the double nearest to the remainder.

    It works on integers because the reduction of a Fraction of 80 digits takes ten times as long as its rounding.
    """
    high = numerator / denominator
    top, bottom = high.as_integer_ratio()
    return high, (numerator * bottom - top * denominator) / (denominator * bottom)


def quick_two_sum(a: Any, b: Any) -> Pair:
    """a + b = sum + error exactly, for |a| >= |b|."""
    total = a + b
    return total, b - (total - a)


def two_sum(a: Any, b: Any) -> Pair:
    """a + b = sum + error exactly, for any a and b."""
    total = a + b
    shadow = total - a
    return total, (a - (total - shadow)) + (b - shadow)


def two_product(a: Any, b: Any) -> Pair:
    """a * b = product + error exactly."""
    product = a * b
    return product, fma(a, b, -product)


def two_products(a: Any, b: Any) -> Pair:
    """a * b = product + error exactly, for numpy arrays, without fma (Dekker 1971), if nothing over- or underflows."""
    halves = []
    for x in (a, b):
        shifted = x * 134217729.0  # 2^27 + 1
        high = shifted - (shifted - x)
        halves.append((high, x - high))
    (a1, a2), (b1, b2) = halves
    product = a * b
    return product, a2 * b2 - (((product - a1 * b1) - a2 * b1) - a1 * b2)


def dd_add(a: Pair, b: Pair) -> Pair:
    """Double-double sum, relative error below 3 u^2 with u = 2^-53 (the accurate variant: safe under cancellation)."""
    high, low = two_sum(a[0], b[0])
    tail, rest = two_sum(a[1], b[1])
    high, low = quick_two_sum(high, low + tail)
    return quick_two_sum(high, low + rest)


def dd_add_double(a: Pair, b: Any) -> Pair:
    """Double-double plus double."""
    high, low = two_sum(a[0], b)
    return quick_two_sum(high, low + a[1])


def dd_mul(a: Pair, b: Pair) -> Pair:
    """Double-double product, relative error below 5 u^2."""
    product, error = two_product(a[0], b[0])
    return quick_two_sum(product, fma(a[1], b[0], fma(a[0], b[1], error)))


def dd_div(a: Pair, b: Pair) -> Pair:
    """Double-double quotient: one Newton correction of the double quotient."""
    first = a[0] / b[0]
    product, error = two_product(first, b[0])
    remainder = ((a[0] - product) - error) + fma(-first, b[1], a[1])
    return quick_two_sum(first, remainder / b[0])


def dd_sqrt(a: Pair) -> Pair:
    """Double-double square root of a positive number: one Newton correction of the double root."""
    root = sqrt(a[0])
    remainder = fma(-root, root, a[0]) + a[1]
    return quick_two_sum(root, remainder / (root + root))


def dd_abs(a: Pair) -> Pair:
    """Double-double modulus, exact: the high half has the sign of the number."""
    return absolute(a[0]), times_sign(a[1], a[0])


def distilled(terms: Sequence[Any], count: int) -> tuple[Any, ...]:
    """Return ``count`` numbers with the sum of ``terms``, each about 2^-53 times the previous (Ogita et al. 2005).

    Only the last number is rounded. The terms must be roughly in the order of their sizes. If leading terms cancel, the
    leading results are small, and a second call restores the order (doi:10.1137/030601818, VecSum).
    """
    rest = list(terms)
    for first in range(count - 1):
        for i in range(len(rest) - 1, first, -1):
            rest[i - 1], rest[i] = two_sum(rest[i - 1], rest[i])
    last = rest[-1]
    for term in rest[-2 : count - 2 : -1]:
        last = last + term
    return *rest[: count - 1], last
