"""The data of the functions of formulas against what it stands for, in mpmath."""

from __future__ import annotations

import mpmath
import pytest
from mpmath import mp, mpf

from nearharmonic.core.functions import coefficients as table
from nearharmonic.core.functions import extended


def in_square(function, power, *leading):
    """(function(x) - the sum of leading factors times powers of x) / x^power as a function of x^2."""

    def quotient(z):
        x = mpmath.sqrt(z)
        return (function(x) - sum(c * x**k for k, c in leading)) / x**power

    return quotient


def complement(t):
    """Function of x from 1 to 6 or 9, by t = (x - 5/2) / (x + 5/2)."""
    x = mpf("2.5") * (1 + t) / (1 - t)
    return mpmath.exp(x * x) * mpmath.erfc(x)


def exponential(r):
    return (mpmath.exp(r) - 1 - r) / r**2


X, QUARTER, HALF_LN2, ROOTS = (1, 1), (mp.pi / 4) ** 2, mp.ln2 / 2, (3 - 2 * mp.sqrt(2)) ** 2
erf = in_square(mpmath.erf, 1, X)
#: Function, interval, and largest deviation; each deviation times the weight of its term is far below 2^-53, or 2^-106.
POLYNOMIALS = {
    "SIN": (table.SIN, in_square(mpmath.sin, 3, X), 0, QUARTER, -54.8),
    "COS": (table.COS, in_square(mpmath.cos, 4, (0, 1), (2, -mpf(1) / 2)), 0, QUARTER, -58.5),
    "EXP": (table.EXP, exponential, -HALF_LN2, HALF_LN2, -55),
    "LOG": (table.LOG, in_square(mpmath.atanh, 3, X), 0, ROOTS, -52),
    "LOG_TAIL": (table.LOG_TAIL, lambda z: (in_square(mpmath.atanh, 3, X)(z) - mpf(1) / 3) / z, 0, ROOTS, -54),
    "SINH": (table.SINH, in_square(mpmath.sinh, 3, X), 0, 1, -56),
    "TANH": (table.TANH, in_square(mpmath.tanh, 3, X), 0, mpf("0.55") ** 2, -54),
    "ATAN": (table.ATAN, in_square(mpmath.atan, 3, X), 0, mp.tan(mp.pi / 8) ** 2, -53),
    "ERF": (table.ERF, erf, 0, 1, -53),
    "ERFCX": (table.ERFCX, complement, -mpf(3) / 7, mpf(7) / 17, -54),
    "CBRT": (table.CBRT, lambda m: 1 / mpmath.cbrt(m), 1, 2, -14.5),
    "ERF_EXTENDED": (table.ERF_EXTENDED, erf, 0, 1, -107),
    "ERFCX_EXTENDED": (table.ERFCX_EXTENDED, complement, -mpf(3) / 7, mpf(13) / 23, -105),
    "series of sin": (extended.SIN, in_square(mpmath.sin, 3, X), 0, QUARTER, -104),
    "series of cos": (extended.COS, in_square(mpmath.cos, 2, (0, 1)), 0, QUARTER, -104),
    "series of sinh": (extended.SINH, in_square(mpmath.sinh, 3, X), 0, mpf("0.25"), -104),
    "series of artanh": (extended.ARTANH, in_square(mpmath.atanh, 3, X), 0, mpf("0.0434") ** 2, -104),
    "series of exp": (extended.EXP, exponential, 0, HALF_LN2, -104),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", POLYNOMIALS)
def test_a_polynomial_is_near_its_function(name):
    """At 300 points, which 30 oscillations of a near-minimax error cannot hide between, and at the end for series."""
    parts, function, least, most, bound = POLYNOMIALS[name]
    with mpmath.workdps(150):
        exact = [mpf(c[0]) + mpf(c[1]) if isinstance(c, tuple) else mpf(c) for c in parts]
        points = [least + (mpf(most) - least) * (k + mpf("0.5")) / 300 for k in range(300)]
        worst = max(abs(mp.polyval(exact, x, asc=True) - function(x)) for x in (*points, mpf(most)))
    assert worst < mpf(2) ** bound


@pytest.mark.parametrize(
    ("parts", "value", "bits"),
    [
        (table.HALF_PI, lambda: mp.pi / 2, 320), (table.HALF_PI_SHORT, lambda: mp.pi / 2, 139),
        (table.LN2, lambda: mp.ln2, 265), (table.QUARTER_PI, lambda: mp.pi / 4, 106),
        (table.LN2_SHORT, lambda: mp.ln2, 95), (table.TWO_PI, lambda: 2 * mp.pi, 104),
        (table.THIRD, lambda: mpf(1) / 3, 107), ((table.LOG2_E,), lambda: 1 / mp.ln2, 52),
        ((table.TWO_OVER_PI,), lambda: 2 / mp.pi, 53),
        (table.ERF[:1] + table.ERF_LOW[:1], lambda: 2 / mp.sqrt(mp.pi) - 1, 56),
        *((row[2:], lambda row=row: -mp.log(row[1]), 155) for row in table.LOG_FACTORS),
        *(((root,), lambda t=t: mp.mpf(2) ** (-mpf(t) / 3), 53) for t, root in enumerate(table.CUBE_ROOTS)),
    ],
)  # fmt: skip
def test_the_parts_of_a_constant_sum_to_it(parts, value, bits):
    with mpmath.workdps(150):
        assert abs(mpmath.fsum(parts) - value()) <= mpf(2) ** -bits
